"""Tables, figures, captions and paragraphs of a section as data: ``pipeline/report/texts/<section>.yaml``.

A table is a caption, columns, notes and the stage that made its numbers; its rows come from a data frame::

    sections:
      noise: {title: Noise estimation, text: First paragraph.}
    tables:
      noise_saturated:
        name: noise_saturated_{dataset}   # of its files; the key where left out
        caption: Saturated patches on {dataset:word}.
        stage: noise@{dataset}-<estimator>
        order: [dataset, noise_source]    # columns that rows are sorted by, each in the order of its display names
        columns:
          dataset: {title: Dataset, word: dataset}
          error_dn: {title: Error, unit: DN, decimals: 2, estimate: [error_dn, low_dn, high_dn, count]}
          "*": {unit: DN, decimals: 2}    # one column for each entry of ``across``
        notes: [Shown always.]
        further_notes: {code: Shown where asked for.}
    figures:
      noise_patches: Caption of a figure.
      noise:
        name: noise_{dataset}             # of its files; the key where left out
        stage: noise@{dataset}-<estimator>
        caption: Caption of a figure.
        alt: "Estimates over the target level: {words}."   # for readers who do not see the figure
        words: "{estimator:word} {median:.1f} DN"          # one of its phrases
        grid: {down: dataset, across: noise_source, ...}   # small multiples, see `figures.grid`
    texts:
      introduction: A paragraph.

Of a column, ``source`` names the column of the frame where it has another name, ``word`` one whose display name is
shown, ``choices`` the words for its values, ``text`` a text to fill in from the row, ``percent`` one in fractions,
``sum`` columns of counts, ``estimate`` the columns of value, ends of the interval, count and published value
(`pipeline.report.tables.estimate`); ``wide`` and ``signed`` are those of `Column`. A column ``"*"`` with
``spread: {across, index}`` stands for one column for each value of ``across`` (`pipeline.report.tables.pivot`), whose
name and heading follow from ``key`` and ``heading`` (``"level_{:g}"``, ``"{:g} DN"``; by default the value and its
display name). Words in braces are filled in; ``{x:word}`` is the display name of x, ``{x:lower}`` the same in lower
case.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import pandas as pd

from pipeline.errors import InputError, did_you_mean
from pipeline.report.display_names import NAMES, in_order, listing, word
from pipeline.report.figures import grid
from pipeline.report.spec import Block, Figure, Run, Section, missing, of_benchmark
from pipeline.report.style import Drawing, Look
from pipeline.report.tables import Cell, Column, Row, Table, estimate, ordered, pivot, records
from pipeline.report.texts import description

if TYPE_CHECKING:
    from pipeline.report.inputs import Benchmark, ReportInputs

Cells = dict[str, Callable[[Row], Cell]]
"""Column -> what makes its cells from a row."""


class _Word(str):
    """A name that a description may show as it is, or by its display name."""

    def __format__(self, spec: str) -> str:
        if spec in ("word", "lower"):
            return word(self).lower() if spec == "lower" else word(self)
        return super().__format__(spec)


def filled(text: str, words: Mapping[str, Any]) -> str:
    """A text with its words in braces filled in."""
    names = {name: _Word(value) if isinstance(value, str) else value for name, value in words.items()}
    return text.format_map(names).rstrip()


def _cell(name: str, about: Mapping[str, Any]) -> Callable[[Row], Cell]:
    """What makes the cells of a described column from a row."""
    source = str(about.get("source", name))
    if "word" in about:
        return lambda row: word(str(row[about["word"]]))
    if "percent" in about:
        fraction = str(about["percent"])
        return lambda row: 100 * row[fraction] if math.isfinite(row[fraction]) else None
    if "choices" in about:
        return lambda row: str(about["choices"].get(row[source], row[source]))
    if "text" in about:
        return lambda row: filled(about["text"], row)
    if "sum" in about:
        return lambda row: sum(int(row[name]) for name in about["sum"])
    return estimate(*about["estimate"]) if "estimate" in about else lambda row: row.get(source)


class Descriptions:
    """The descriptions of one section.

    Args:
        name: stem of its file.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    @functools.cached_property
    def _content(self) -> dict[str, dict[str, Any]]:
        return cast("dict[str, dict[str, Any]]", description(self.name))

    def _entry(self, part: str, key: str) -> Any:
        entries = self._content.get(part, {})
        if key not in entries:
            raise InputError(f"{self.name}.yaml: no {part}.{key}; {did_you_mean(key, entries)}")
        return entries[key]

    def section(
        self,
        blocks: Iterable[Block | None],
        runs: Sequence[Run] = (),
        findings: Sequence[str] = (),
        *,
        key: str = "",
        text: Sequence[str] = (),
        **words: Any,
    ) -> Section:
        """A section of the page, which has the name of its file unless ``key`` is given.

        Its title and first paragraph are described; parts that are None have nothing to show; notes on runs that are
        absent follow.
        """
        key = key or self.name
        about = self._entry("sections", key)
        text = [*([filled(about["text"], words)] if "text" in about else []), *text]
        shown = [*(block for block in blocks if block is not None), *missing(about["title"], runs)]
        return Section(key, about["title"], text, shown, runs, findings)

    def of_benchmarks(
        self, inputs: ReportInputs, benchmarks: Iterable[tuple[str, Benchmark, Callable[[Any], Sequence[Table]]]]
    ) -> Section | None:
        """A section of tables that benchmarks have recorded.

        Args:
            inputs: of the report.
            benchmarks: of each its line in the overview, its record, and what makes tables of this.

        Returns:
            the section; None where there is no record at all.

        Raises:
            InputError: as `ReportInputs.benchmark`.
        """
        blocks, runs = list[Table](), list[Run]()
        for title, benchmark, made in benchmarks:
            tables = inputs.benchmark(benchmark, made)
            if tables is not None:
                recorded, run = of_benchmark(title, benchmark, tables)
                blocks += recorded
                runs.append(run)
        return self.section(blocks, runs) if blocks else None

    def text(self, key: str, **words: Any) -> str:
        """A paragraph.

        Raises:
            InputError: there is no such text.
        """
        return filled(self._entry("texts", key), words)

    def figure(
        self, key: str, drawing: Drawing, stages: Iterable[str] = (), *, name: str = "", after: str = "", **words: Any
    ) -> Figure:
        """A figure with its caption, of the description's stage and name (its key by default) unless given here.

        Args:
            key: under ``figures``.
            drawing: see `Figure`.
            stages: see `Figure`.
            name: of its files.
            after: sentences that follow the caption.
            words: to fill in.

        Raises:
            InputError: there is no such caption.
        """
        entry = self._entry("figures", key)
        about = {"caption": entry} if isinstance(entry, str) else entry
        caption, made_by = filled(about["caption"], words), [about["stage"]] if "stage" in about else []
        stages = tuple(stages) or tuple(filled(stage, words) for stage in made_by)
        return Figure(filled(name or about.get("name", key), words), drawing, f"{caption} {after}".strip(), stages)

    def alt(self, key: str, rows: pd.DataFrame | Iterable[Row], **words: Any) -> str:
        """The alternative text of a figure, its phrases for each of some rows in ``{words}``."""
        about = self._entry("figures", key)
        phrases = [filled(about.get("words", ""), row) for row in records(rows)]
        joined = {"words": listing(phrases), "clauses": "; ".join(phrases)}
        return filled(about["alt"], {**joined, **words})

    def grid(self, key: str, frame: pd.DataFrame, alt: str, looks: Mapping[Any, Look], **more: Any) -> Drawing:
        """The small multiples that a figure describes under ``grid``; arguments of `pipeline.report.figures.grid`."""
        return grid(self._entry("figures", key)["grid"], frame, alt, looks, **more)

    def headings(self, key: str, values: Iterable[Any]) -> dict[str, str]:
        """Name -> heading of the columns that stand for ``"*"``, one for each value of what is spread over them."""
        about = self._entry("tables", key)["columns"]["*"]
        name, heading = about.get("key", "{}"), about.get("heading")
        known = in_order(values, NAMES.get(about.get("spread", {}).get("across", "estimator"), ()))
        return {name.format(value): heading.format(value) if heading else word(str(value)) for value in known}

    def table(
        self,
        key: str,
        frame: pd.DataFrame | Iterable[Row],
        *,
        cells: Mapping[str, Callable[[Row], Cell]] | None = None,
        across: Mapping[str, str] | None = None,
        also: Sequence[str] = (),
        notes: Sequence[str] = (),
        without: Collection[str] = (),
        **words: Any,
    ) -> Table:
        """A table of a data frame.

        Args:
            key: under ``tables``; also the table's name where the description gives none.
            frame: rows in the order shown.
            cells: column -> what makes its cells, where the description does not.
            across: name -> title of the columns that stand for ``"*"``, where they are not spread over it.
            also: notes under ``further_notes`` to show.
            notes: sentences that follow the notes.
            without: columns to leave out.
            words: to fill in.

        Raises:
            InputError: there is no such table, or a cell, note or word has no counterpart in its description.
        """
        about, made, rows = self._entry("tables", key), dict(cells or {}), cast("Any", frame)
        unknown = set(made) - set(about["columns"])
        if unknown:
            raise InputError(f"{self.name}.yaml: tables.{key} has no column '{min(unknown)}'")
        if "order" in about:
            rows = ordered(rows, **{name: NAMES.get(name, ()) for name in about["order"]})
        star = about["columns"].get("*", {})
        if across is None and "spread" in star:
            spread = star["spread"]
            across = self.headings(key, rows[spread["across"]])
            rows = pivot(rows, spread["index"], spread["across"], _cell("*", star), star.get("key", "{}").format)
        columns: list[Column] = []
        for name, entry in about["columns"].items():
            unit, decimals, signed = str(entry.get("unit", "")), entry.get("decimals"), bool(entry.get("signed", False))
            if name == "*":
                columns += [Column(one, title, unit, decimals, False, signed) for one, title in (across or {}).items()]
            elif name not in without:
                title, wide = filled(entry.get("title", ""), words), bool(entry.get("wide", False))
                columns.append(Column(name, title, unit, decimals, wide, signed))
                made.setdefault(name, _cell(name, entry))
        lines = []
        for row in records(rows):
            cells_of = {one.name: made[one.name](row) if one.name in made else row.get(one.name) for one in columns}
            lines.append({name: cell for name, cell in cells_of.items() if cell is not None})
        further = about.get("further_notes", {})
        listed = [*about.get("notes", ()), *(further[name] for name in also)]
        return Table(
            filled(about.get("name", key), words),
            filled(about["caption"], words),
            columns,
            lines,
            (*(filled(line, words) for line in listed), *notes),
            filled(about.get("stage", ""), words),
            about.get("reference_word", "paper"),
        )
