"""``dvc.lock`` is written entry by entry.

After every stage DVC parses all of ``dvc.lock`` and writes it anew with a parser and a writer that keep comments and
layout: with the 8,600 dependencies of the default graph that is 7 s of processor time per stage, more than most stages
compute. Here the entry of the stage that ran is written, by DVC's writer, into the text in the place of the one before:
the same bytes in 0.05 s, whatever order stages end in.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.store import write_text

HEAD = "schema: '2.0'\nstages:\n"


def with_entry(text: str, entry: Mapping[str, Any], followers: Collection[str] = ()) -> str:
    """The text of a ``dvc.lock`` with the entry of one stage replaced, or added at its end.

    Args:
        text: of the file, as DVC writes it; empty where there is none yet.
        entry: name of the stage -> its content.
        followers: names of entries that a new entry goes before.

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
        starts = [text.find(f"\n  {follower}:\n") for follower in followers]
        end = min((first + 1 for first in starts if first >= 0), default=len(text))
        return text[:end] + block + text[end:]
    following = re.compile(r"^  [^ \n]", re.MULTILINE).search(text, start + 1 + len(key))
    return text[: start + 1] + block + (text[following.start() :] if following else "")


class LockFileWriter:
    """`dvc.dvcfile.Lockfile.dump_stages` by `with_entry`; the original where the file has another layout.

    Attributes:
        order: names of the stages of this run in the order DVC runs them, which is that of new entries in the file.
    """

    def __init__(self, original: Callable[..., None]) -> None:
        self.order: list[str] = []
        self._original = original
        self._added: set[str] = set()

    def followers(self, name: str) -> list[str]:
        """Entries added in this run whose stages come after a stage in the order."""
        if name not in self.order:
            return []
        return [other for other in self.order[self.order.index(name) + 1 :] if other in self._added]

    def write(self, lockfile: Any, stages: Sequence[Any], **options: Any) -> None:
        """Write the entries of stages that ran."""
        from dvc.stage.serialize import to_lockfile

        path = Path(lockfile.path)
        before = path.read_text(encoding="utf-8") if path.exists() else ""
        text = before
        try:
            for stage in stages:
                (entry,) = to_lockfile(stage, **options).items()
                if f"\n  {entry[0]}:\n" not in text:
                    self._added.add(entry[0])
                text = with_entry(text, dict([entry]), self.followers(entry[0]))
        except ValueError:
            self._original(lockfile, stages, **options)
            return
        if text == before:
            return
        write_text(path, text)
        lockfile.repo.scm_context.track_file(lockfile.relpath)


def install() -> LockFileWriter:
    """Let DVC in this process write the lock file so; returns the writer, whose order may be set."""
    from dvc.dvcfile import Lockfile

    writer = LockFileWriter(Lockfile.dump_stages)
    Lockfile.dump_stages = lambda lockfile, stages, **options: writer.write(lockfile, stages, **options)
    return writer
