"""Noise estimators measured on photographs of real cameras that the project may not keep.

As `pipeline.recording.blur` for blur: measured by hand, with ``camera-monitor record noise``. Pictures and
weights are named by their SHA-256; no picture is kept.

    noise_patches.csv      dataset, then `pipeline.noise.real_noise.COLUMNS`
    noise_summary.csv      dataset, then `pipeline.noise.real_noise.summarise`
    noise_provenance.json  source, datasets with their files, weights, estimators, seed
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.experiments.real_noise.experiment import Kinds, measure_pairs
from pipeline.experiments.real_noise.records import PATCHES_FILE, PROVENANCE_FILE, SUMMARY_FILE
from pipeline.noise import real_noise
from pipeline.recording.provenance import sha256_of, weights_of_kinds, without_folders, write_record

if TYPE_CHECKING:
    import pandas as pd

RESULTS = (PROVENANCE_FILE, PATCHES_FILE, SUMMARY_FILE)
"""Files of a record, its provenance first."""


def record(
    folders: Mapping[str, Path],
    kinds: Kinds,
    out: Path,
    source: str,
    run_map: Callable[..., list[Any]],
    *,
    seed: int = 1,
    draws: int = 500,
) -> pd.DataFrame:
    """Measure noise estimators on pairs of pictures and write everything into a folder.

    Args:
        folders: name of a dataset -> folder of its pairs, see `pipeline.noise.real_noise.pairs`.
        kinds: name in the tables -> registered estimator and its options.
        out: folder; replaced.
        source: where the pictures come from, their revision and licence, in words.
        run_map: see `pipeline.executor.run_map`; changes no result.
        seed: root of the bootstrap's streams.
        draws: its resamples.

    Returns:
        the summary.

    Raises:
        InputError: a folder, a picture or weights are absent or broken, or there is no such estimator.
    """
    import pandas as pd

    weights = weights_of_kinds(kinds)
    patches: list[pd.DataFrame] = []
    summaries: list[pd.DataFrame] = []
    files: dict[str, dict[str, str]] = {}
    for name, folder in folders.items():
        table = measure_pairs(folder, kinds, run_map, f"noise of {name}")
        for part, rows in ((table, patches), (real_noise.summarise(table, seed, draws), summaries)):
            part.insert(0, "dataset", name)
            rows.append(part)
        files[name] = sha256_of(path for pair in real_noise.pairs(folder) for path in (pair.real, pair.mean))
    summary = pd.concat(summaries, ignore_index=True)
    about = {
        "source": source,
        "datasets": files,
        "weights": weights,
        "estimators": {
            name: {"kind": kind, "options": without_folders(options)} for name, (kind, options) in kinds.items()
        },
        "tile_px": real_noise.TILE_PX,
        "seed": seed,
        "bootstrap_draws": draws,
    }
    tables = {PATCHES_FILE: pd.concat(patches, ignore_index=True), SUMMARY_FILE: summary}
    write_record(out, tables, about, PROVENANCE_FILE)
    return summary
