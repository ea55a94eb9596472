"""The files of one run of ``camera-monitor health``: a table and JSON lines that grow, one JSON, pictures with maps."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from pipeline.cli.health_rows import COLUMNS
from pipeline.cli.outputs import LineFile, OutputFolder, RowFile
from pipeline.cli.pictures import result_stem

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.condition import Condition


def run_content(
    about: dict[str, Any], rows: Sequence[dict[str, Any]], set_aside: Sequence[str], *, complete: bool
) -> dict[str, Any]:
    """A run as one JSON object.

    Args:
        about: estimators and settings.
        rows: of the finished frames.
        set_aside: one reason per file or frame that could not be used.
        complete: whether the run came to its end.
    """
    from pipeline.camera.mtf import FREQUENCIES

    alarmed = sum(bool(row["alarms"]) for row in rows)
    return {
        **about, "alarmed_frames": alarmed, "complete": complete, "frequencies_of_nyquist": FREQUENCIES,
        "pictures": list(rows), "set_aside": list(set_aside),
    }  # fmt: skip


class HealthFiles:
    """``health.csv`` and ``health.jsonl``, complete after every frame; ``health.json``, written when the run ends.

    Args:
        path: the folder.
        inputs: files the run reads.
        about: what the JSON states of the run: estimators, settings, version.

    Raises:
        OutputError: the folder cannot be written.
    """

    def __init__(self, path: Path, inputs: Sequence[Path], about: dict[str, Any]) -> None:
        self._folder = OutputFolder(path, "--out", inputs)
        table, lines, self._json = (self._folder.claim("health", suffix) for suffix in (".csv", ".jsonl", ".json"))
        self._table, self._lines = RowFile(table, COLUMNS), LineFile(lines)
        self._about, self._rows = about, list[dict[str, Any]]()
        self.set_aside: list[str] = []

    def __enter__(self) -> HealthFiles:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        from pipeline.store import write_json

        self._table.__exit__(kind, error, trace)
        self._lines.__exit__(kind, error, trace)
        try:
            content = run_content(self._about, self._rows, self.set_aside, complete=kind is None)
            write_json(self._json, content)
        finally:
            self._folder.__exit__(kind, error, trace)

    def add(self, row: dict[str, Any], image: NDArray[np.float32], condition: Condition) -> None:
        """Draw a frame's maps and append its row."""
        from pipeline.cli.health_picture import draw
        from pipeline.store import plain_json, write_image

        target = self._folder.claim(result_stem(row["picture"]), ".health.png")
        write_image(target, draw(image, condition))
        row["drawn"] = target.name
        self._table.write(row)
        self._lines.write(json.dumps(plain_json(row), sort_keys=True, ensure_ascii=False))
        self._rows.append(row)
