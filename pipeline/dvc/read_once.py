"""Parameters are parsed, files hashed and stages loaded once, not once per stage that depends on them.

DVC parses all of ``params.yaml`` for every stage, searches it anew for every key, and asks its database for the hash of
every file for every stage that names it: 68 parses and 6,000 questions for 1,100 files of the smoke graph. Here the
answer is kept for as long as the file's inode, size and time of change are the same, which DVC's own database goes by.

``dvc repro`` loads all stages of ``dvc.yaml`` twice, to choose those to run and for the graph, and looks up for each of
their 10,000 files where such a file is stored. Here those of the graph are chosen, and a place is looked up once.

Parsing ``dvc.yaml`` and ``dvc.lock`` is most of what remains of ``dvc status``. What they hold is kept for the next
call in DVC's folder for temporary files, as JSON with the hash of the text that it was parsed from.
"""

from __future__ import annotations

import contextlib
import copy
import hashlib
import json
import stat
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from pipeline.store import write_text

Signature = tuple[int, int, int, int]
LEAST_KEPT = 50_000
"""Characters of a text that takes longer to parse than to read what it holds."""


def signature(path: str) -> Signature | None:
    """What changes with a file: device, inode, size and time of change in ns; None where there is no regular file."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    if not stat.S_ISREG(status.st_mode):
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


class Kept:
    """Answers about files, each given for as long as the file's `signature` is the same."""

    def __init__(self) -> None:
        self._answers: dict[tuple[str, Any], tuple[Signature, Any]] = {}

    def get(self, path: str, question: Any, answer: Callable[[], Any]) -> Any:
        """The answer to a question about a file, computed where it is not known."""
        now = signature(path)
        if now is None:
            return answer()
        known = self._answers.get((path, question))
        if known is not None and known[0] == now:
            return known[1]
        value = answer()
        self._answers[path, question] = now, value
        return value


def at(content: Any, key: str) -> Any:
    """The value at a dotted key of nested dictionaries.

    Raises:
        LookupError: there is no such key, or it is none of plain names.
    """
    for part in key.split("."):
        if not isinstance(content, dict) or not part or not part.replace("_", "").replace("-", "").isalnum():
            raise LookupError(key)
        content = content[part]
    return content


class ParsedTexts:
    """`dvc.utils.serialize.parse_yaml`, with what large texts hold kept as JSON.

    Args:
        folder: for the JSON, one file per parsed file.
        original: parses a text.
    """

    def __init__(self, folder: Path, original: Callable[..., Any]) -> None:
        self._folder, self._original = folder, original

    def parse(self, text: str, path: Any, typ: str = "safe") -> Any:
        """What a YAML text holds, in new objects.

        Args:
            text: to parse.
            path: of its file.
            typ: of parsing; only ``safe`` is kept, others hold comments.
        """
        if typ != "safe" or not isinstance(text, str) or len(text) < LEAST_KEPT:
            return self._original(text, path, typ=typ)
        kept = self._folder / f"{_sha256(str(path))[:16]}.json"
        with contextlib.suppress(OSError, ValueError, LookupError, TypeError):
            known = json.loads(kept.read_text(encoding="utf-8"))
            if known["sha256"] == _sha256(text):
                return known["content"]
        content = self._original(text, path, typ=typ)
        with contextlib.suppress(OSError, ValueError, TypeError):  # what JSON cannot hold is not kept
            written = json.dumps({"sha256": _sha256(text), "content": content})
            if json.loads(written)["content"] == content:
                write_text(kept, written)
        return content


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def _read_param_file(original: Callable[..., Any]) -> Callable[..., Any]:
    """`dvc.dependency.param.read_param_file`, with the parsed file kept; the original for what is not plain."""
    from dvc.utils.serialize import load_path

    kept = Kept()

    def read_param_file(
        fs: Any, path: str, key_paths: Sequence[str] | None = None, flatten: bool = False, **options: Any
    ) -> Any:
        if fs.protocol != "local" or not key_paths or not flatten or options:
            return original(fs, path, key_paths, flatten, **options)
        content = kept.get(path, "content", lambda: load_path(path, fs))
        try:
            return {key: copy.deepcopy(at(content, key)) for key in key_paths}
        except LookupError:
            return original(fs, path, key_paths, flatten)

    return read_param_file


def _build(original: Callable[..., Any]) -> Callable[..., Any]:
    """`dvc.output.Output._build`, with the hashes of single files that are not to be stored kept."""
    from dvc_data.hashfile.obj import HashFile

    kept = Kept()

    def build(output: Any, odb: Any, path: str, fs: Any, name: str, **options: Any) -> Any:
        if fs.protocol != "local" or not options.get("dry_run"):
            return original(output, odb, path, fs, name, **options)
        staging, meta, obj = kept.get(path, name, lambda: original(output, odb, path, fs, name, **options))
        return (
            staging,
            copy.copy(meta),
            HashFile(obj.path, obj.fs, copy.copy(obj.hash_info)) if type(obj) is HashFile else obj,
        )

    return build


def _get_cloud_fs(original: Callable[..., Any]) -> Callable[..., Any]:
    """`dvc.output.get_cloud_fs`, looked up once for all paths of the machine itself; the original for addresses."""
    known: dict[int, tuple[Any, Any, dict[str, Any]]] = {}

    def get_cloud_fs(repo_config: Any, **options: Any) -> tuple[Any, dict[str, Any], str]:
        url = options.get("url")
        if set(options) != {"url"} or not isinstance(url, str) or ":" in url:
            return original(repo_config, **options)
        config, cls, settings = known.get(id(repo_config), (None, None, {}))
        if config is not repo_config or config is None:
            cls, settings, _ = original(repo_config, url=url)
            known[id(repo_config)] = repo_config, cls, settings
        return cls, dict(settings), cls._strip_protocol(url)

    return get_cloud_fs


def _collect_stages(original: Callable[..., list[Any]]) -> Callable[..., list[Any]]:
    """`dvc.repo.reproduce.collect_stages`, with the stages of ``dvc.yaml`` taken from those of the graph."""
    from dvc.dvcfile import PROJECT_FILE

    def collect_stages(repo: Any, targets: Iterable[str], **options: Any) -> list[Any]:
        targets = list(targets)
        if targets == [PROJECT_FILE] and not any(options.values()):
            path = repo.fs.abspath(PROJECT_FILE)
            stages = [stage for stage in repo.index.stages if stage.path == path]
            if stages:
                return stages
        return original(repo, targets, **options)

    return collect_stages


def install() -> None:
    """Let DVC in this process read and hash a file again only after a change of it, and load stages once."""
    from dvc import output
    from dvc.dependency import param
    from dvc.exceptions import NotDvcRepoError
    from dvc.output import Output
    from dvc.repo import Repo, reproduce
    from dvc.utils import serialize, strictyaml
    from dvc.utils.serialize import _yaml

    param.read_param_file = _read_param_file(param.read_param_file)
    Output._build = _build(Output._build)
    output.get_cloud_fs = _get_cloud_fs(output.get_cloud_fs)
    reproduce.collect_stages = _collect_stages(reproduce.collect_stages)
    with contextlib.suppress(NotDvcRepoError):
        texts = ParsedTexts(Path(Repo.find_root()) / ".dvc/tmp/parsed", serialize.parse_yaml)
        serialize.parse_yaml = strictyaml.parse_yaml = _yaml.parse_yaml = texts.parse
