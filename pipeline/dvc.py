"""``python -m pipeline.dvc repro``: DVC as it is, but quick at writing ``dvc.lock``.

After every stage DVC parses all of ``dvc.lock`` and writes it anew with a parser and a writer that keep comments and
layout: with the 8,600 dependencies of the default graph that is 7 s of processor time per stage, more than most stages
compute. Here the entry of the stage that ran is written, by DVC's writer, into the text in the place of the one before:
the same bytes in 0.05 s. Every command and option is DVC's, and ``dvc`` itself may be used before and after.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

HEAD = "schema: '2.0'\nstages:\n"


def with_entry(text: str, entry: Mapping[str, Any]) -> str:
    """The text of a ``dvc.lock`` with the entry of one stage replaced, or added at its end.

    Args:
        text: of the file, as DVC writes it; empty where there is none yet.
        entry: name of the stage -> its content.

    Raises:
        ValueError: the text is not laid out as DVC does.
    """
    from dvc.utils.serialize import dumps_yaml

    text = text or HEAD
    if not text.startswith(HEAD) or re.search(r"^[^ \n]", text.removeprefix(HEAD), re.MULTILINE):
        raise ValueError("not the layout of DVC's schema 2.0")
    (name,) = entry
    block = dumps_yaml({"stages": dict(entry)}).removeprefix("stages:\n")
    key = block.partition("\n")[0]
    if not re.fullmatch(rf"  {re.escape(name)}:", key):
        raise ValueError(f"not a plain key: {key}")
    start = text.find(f"\n{key}\n")
    if start < 0:
        return text + block
    following = re.compile(r"^  [^ \n]", re.MULTILINE).search(text, start + 1 + len(key))
    return text[: start + 1] + block + (text[following.start() :] if following else "")


def _dump_stages(original: Callable[..., None]) -> Callable[..., None]:
    """`dvc.dvcfile.Lockfile.dump_stages` by `with_entry`; the original where the file has another layout."""
    from dvc.stage.serialize import to_lockfile

    def dump_stages(lockfile: Any, stages: Sequence[Any], **options: Any) -> None:
        path = Path(lockfile.path)
        before = path.read_text(encoding="utf-8") if path.exists() else ""
        text = before
        try:
            for stage in stages:
                text = with_entry(text, to_lockfile(stage, **options))
        except ValueError:
            original(lockfile, stages, **options)
            return
        if text == before:
            return
        writing = path.with_name(f".{path.name}.writing-{os.getpid()}")
        writing.write_text(text, encoding="utf-8")
        writing.replace(path)
        lockfile.repo.scm_context.track_file(lockfile.relpath)

    return dump_stages


def main(arguments: Sequence[str] | None = None) -> int:
    """Run DVC; returns its exit status."""
    from dvc.cli import main as run_dvc
    from dvc.dvcfile import Lockfile

    Lockfile.dump_stages = _dump_stages(Lockfile.dump_stages)
    return int(run_dvc(list(sys.argv[1:] if arguments is None else arguments)))


if __name__ == "__main__":
    raise SystemExit(main())
