"""Table of blurs of a kind that no network was trained on, as a benchmark recorded them.

`benchmarks/unseen_kernels.py` renders the light of real optics (irises, mirror lenses, aberrations, hand shake); the
report shows its record (``benchmarks/results/unseen_kernels.json``), recorded datasets among it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pipeline.report.inputs import benchmark_record
from pipeline.report.tables import Cell, Column, Table
from pipeline.report.wording import DATASETS, in_order, word

LINE = "python benchmarks/unseen_kernels.py"
GROUPS = ("out of focus", "aberrated", "shaken")
WAYS = {"raw": "", "typical": ", typical lens", "calibrated": ", calibrated", "fitted": ", fitted"}


def table(path: Path | None) -> Table | None:
    """The table, or None where nothing was recorded.

    Args:
        path: of the record.

    Raises:
        InputError: the file holds something else.
    """
    content = benchmark_record(path, {"kernels", "results"}, LINE)
    if content is None:
        return None
    rows = [row for name in in_order(content["results"], DATASETS) for row in _rows(name, content["results"][name])]
    columns = [
        Column("dataset", "Dataset"),
        Column("estimator", "Estimator"),
        Column("patches", "Patches"),
        *(Column(group, group.capitalize(), "%", 1) for group in GROUPS),
        Column("mean", "Mean", "%", 1),
    ]
    notes = (
        f"{len(content['kernels'])} kernels rendered by wave optics, of 3 to 22 px: irises of five and seven blades, "
        "mirror lenses and cat's eyes out of focus; coma, spherical aberration, astigmatism, diffraction; lenses "
        "shaken by hand. None is of a family that networks were trained on. AMAE, mean over the kernels of a group "
        "and over all. Fits and divisions as in Table I. PMP and GBB on few patches, the network on the same beside "
        "them. Errors are largest where a sharp core stands in a wide faint halo (spherical aberration, coma), which "
        "no kernel that the network was trained on has.",
    )
    return Table("blur_unseen_kernels", "Blurs of a kind nobody trained on: AMAE.", columns, rows, notes)


def _rows(dataset: str, content: Mapping[str, Any]) -> Iterator[dict[str, Cell]]:
    """A row for every way to read every estimator, on all patches and then on few."""
    for part in (content, content.get("few", {})):
        for estimator in ("spectral", "pmp", "gbb"):
            for way, suffix in WAYS.items():
                found = part.get(estimator, {}).get(way)
                # A kernel estimator's own sharp answer is no measure of its camera: divided answers are not shown.
                if found is None or (estimator != "spectral" and way != "raw"):
                    continue
                yield {
                    "dataset": word(dataset),
                    "estimator": word(estimator) + suffix,
                    "patches": part["patches"],
                    **{group: float(found["mean_of_group_percent"][group]) for group in GROUPS},
                    "mean": float(found["mean_amae_percent"]),
                }
