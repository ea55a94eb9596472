"""The files of one run of ``camera-monitor health``: growing table and JSON lines, JSON, page, pictures with maps."""

from __future__ import annotations

import json
from types import TracebackType
from typing import TYPE_CHECKING, Any

from pipeline.cli.analysis.rows import WRITTEN
from pipeline.cli.frames.names import result_stem
from pipeline.cli.health.page import PageFrames
from pipeline.cli.health.run import HealthRun
from pipeline.cli.results.growing_files import LineFile, RowFile
from pipeline.cli.results.output_folder import OutputFolder

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.condition import Condition

SUFFIXES = (".csv", ".jsonl", ".json", ".html")
"""Of the files that are called ``health``."""


class HealthFiles:
    """``health.csv`` and ``health.jsonl``, complete after every frame; ``health.json`` and ``health.html`` at the end.

    Args:
        folder: that they go to, entered.
        run: what the JSON and the page state of it.
        maps: whether every frame is drawn with its maps; else only the worst are, on the page.

    Raises:
        OutputError: the folder cannot be written.
    """

    def __init__(self, folder: OutputFolder, run: HealthRun, *, maps: bool = False) -> None:
        self._folder = folder
        table, lines, self._json, self.page = (folder.claim("health", suffix) for suffix in SUFFIXES)
        self._table, self._lines = RowFile(table, WRITTEN), LineFile(lines)
        self._run, self._frames, self._maps = run, PageFrames(_draw), maps

    def __enter__(self) -> HealthFiles:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        from pipeline.cli.health.page import page
        from pipeline.cli.results import streamed_json
        from pipeline.store import write_text

        self._table.__exit__(kind, error, trace)
        self._lines.__exit__(kind, error, trace)
        content = self._run.content()
        streamed_json.write(self._json, content)
        write_text(self.page, page(content, self._frames))

    def add(self, row: dict[str, Any], image: NDArray[np.float32], condition: Condition) -> None:
        """Append a frame's row, and draw its maps where every frame's are wanted."""
        from pipeline.store import plain_json, write_image

        if self._maps:
            target = self._folder.claim(result_stem(row["picture"]), ".health.png")
            write_image(target, _draw(image, condition))
            row["drawn"] = target.name
        self._frames.add(row, image, condition)
        self._table.write(row)
        self._lines.write(json.dumps(plain_json(row), sort_keys=True, ensure_ascii=False))


def _draw(image: NDArray[np.float32], condition: Condition) -> NDArray[np.uint8]:
    """A frame with its maps (`pipeline.cli.health.picture.draw`), whose plots are imported when one is drawn."""
    from pipeline.cli.health.picture import draw

    return draw(image, condition)
