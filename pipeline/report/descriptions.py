"""Tables, captions and paragraphs of a section as data: ``pipeline/report/sections/<section>.yaml``.

A table is a caption, columns, notes and the stage that made its numbers; its rows come from a data frame::

    tables:
      noise_saturated:
        name: noise_saturated_{dataset}   # of its files; the key where left out
        caption: Saturated patches on {dataset:word}.
        stage: noise@{dataset}-<estimator>
        columns:
          dataset: {title: Dataset, word: dataset}
          error_dn: {title: Error, unit: DN, decimals: 2, estimate: [error_dn, low_dn, high_dn, count]}
          "*": {unit: DN, decimals: 2}    # one column for each entry of ``across``
        notes: [Shown always.]
        further_notes: {code: Shown where asked for.}
    figures:
      noise: Caption of a figure.
    texts:
      introduction: A paragraph.

Of a column, ``source`` names the column of the frame where it has another name, ``word`` one whose display name is
shown, ``percent`` one in fractions, ``estimate`` the columns of value, ends of the interval, count and published value
(`pipeline.report.tables.estimate`); ``wide`` is that of `Column`. Words in braces are filled in; ``{x:word}`` is the
display name of x, ``{x:lower}`` the same in lower case.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError, did_you_mean
from pipeline.report.display_names import word
from pipeline.report.sections import description
from pipeline.report.spec import Figure
from pipeline.report.style import Drawing
from pipeline.report.tables import Cell, Column, Row, Table, estimate, named, table

if TYPE_CHECKING:
    import pandas as pd

Cells = dict[str, Callable[[Row], Cell]]
"""Column -> what makes its cells from a row."""


class _Word(str):
    """A name that a description may show as it is, or by its display name."""

    def __format__(self, spec: str) -> str:
        if spec in ("word", "lower"):
            return word(self).lower() if spec == "lower" else word(self)
        return super().__format__(spec)


def _filled(text: str, words: Mapping[str, Any]) -> str:
    names = {name: _Word(value) if isinstance(value, str) else value for name, value in words.items()}
    return text.format_map(names).rstrip()


def _column(name: str, about: Mapping[str, Any], cell: Callable[[Row], Cell] | None) -> Column:
    """A column of a description; ``cell`` makes its cells where that is no plain value of the row."""
    head = (name, str(about.get("title", "")), str(about.get("unit", "")), about.get("decimals"))
    wide = bool(about.get("wide", False))
    if cell is not None:
        return Column(*head, cell, wide)
    if "word" in about:
        return named(name, head[1], str(about["word"]))
    if "percent" in about:
        fraction = str(about["percent"])
        return Column(*head, lambda row: 100 * row[fraction] if math.isfinite(row[fraction]) else None, wide)
    return Column(*head, estimate(*about["estimate"]) if "estimate" in about else str(about.get("source", "")), wide)


class Descriptions:
    """The descriptions of one section.

    Args:
        section: stem of its file.
    """

    def __init__(self, section: str) -> None:
        self.section = section

    @functools.cached_property
    def _content(self) -> dict[str, dict[str, Any]]:
        import yaml

        file = description(self.section)
        content: dict[str, dict[str, Any]] = yaml.safe_load(file.read_text(encoding="utf-8"))
        return content

    def _entry(self, part: str, key: str) -> Any:
        entries = self._content.get(part, {})
        if key not in entries:
            raise InputError(f"{self.section}.yaml: no {part}.{key}; {did_you_mean(key, entries)}")
        return entries[key]

    def text(self, key: str, **words: Any) -> str:
        """A paragraph.

        Args:
            key: under ``texts``.
            words: to fill in.

        Raises:
            InputError: there is no such text.
        """
        return _filled(self._entry("texts", key), words)

    def figure(
        self, key: str, drawing: Drawing, stages: Iterable[str] = (), *, name: str = "", after: str = "", **words: Any
    ) -> Figure:
        """A figure with its caption.

        Args:
            key: under ``figures``; also the figure's name where none is given.
            drawing: see `Figure`.
            stages: see `Figure`.
            name: of its files; words are filled in.
            after: sentences that follow the caption.
            words: to fill in.

        Raises:
            InputError: there is no such caption.
        """
        caption = f"{_filled(self._entry('figures', key), words)} {after}".strip()
        return Figure(_filled(name or key, words), drawing, caption, tuple(stages))

    def table(
        self,
        key: str,
        frame: pd.DataFrame | Iterable[Row],
        *,
        cells: Mapping[str, Callable[[Row], Cell]] | None = None,
        across: Mapping[str, str] | None = None,
        also: Sequence[str] = (),
        notes: Sequence[str] = (),
        **words: Any,
    ) -> Table:
        """A table of a data frame.

        Args:
            key: under ``tables``; also the table's name where the description gives none.
            frame: rows in the order shown.
            cells: column -> what makes its cells, where they are no plain values of the row.
            across: name -> title of the columns that stand for ``"*"``.
            also: notes under ``further_notes`` to show.
            notes: sentences that follow the notes.
            words: to fill in.

        Raises:
            InputError: there is no such table, or a cell, note or word has no counterpart in its description.
        """
        about, cells = self._entry("tables", key), cells or {}
        columns: list[Column] = []
        for name, entry in about["columns"].items():
            if name == "*":
                columns += [_column(one, {**entry, "title": title}, None) for one, title in (across or {}).items()]
            else:
                filled = {**entry, "title": _filled(entry.get("title", ""), words)}
                columns.append(_column(name, filled, cells.get(name)))
        for name in cells:
            if name not in about["columns"]:
                raise InputError(f"{self.section}.yaml: tables.{key} has no column '{name}'")
        further = about.get("further_notes", {})
        lines = [*about.get("notes", ()), *(further[name] for name in also)]
        return table(
            _filled(about.get("name", key), words),
            _filled(about["caption"], words),
            frame,
            columns,
            [*(_filled(line, words) for line in lines), *notes],
            _filled(about.get("stage", ""), words),
            about.get("reference_word", "paper"),
        )
