"""Blur estimators measured on recorded pictures that the project may not keep: Table I and where it comes from.

Measured by hand, with ``camera-monitor blur record``, and kept as small files from which the report draws. Pictures,
kernels and weights are named by their SHA-256; no picture is kept.

    summary.csv      AMAE of every kind and size of blur, raw and calibrated (`BLUR_SUMMARY`)
    sharp.csv        what is read from sharp frames (`pipeline.experiments.sharp_curves.sharp_curves`)
    patches.csv      where the patches lie
    estimates.parquet  estimates of every patch (`BLUR_ESTIMATES`), from which `pipeline.recording.blur_statistics`
                     computes the statistics again
    metrics.json     estimator -> `pipeline.experiments.metrics.table_one_metrics`
    provenance.json  source, dataset, frames, kernels, weights, settings
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import store
from pipeline.camera.mtf import SYSTEM
from pipeline.camera.psf import stored
from pipeline.datasets.selection import evenly_spread
from pipeline.errors import InputError, did_you_mean
from pipeline.experiments import table_one
from pipeline.experiments.frames import TestFrame, with_patches
from pipeline.experiments.metrics import table_one_metrics
from pipeline.experiments.recorded.blur import (
    ESTIMATES_FILE,
    KEYS,
    METRICS_FILE,
    PATCHES_FILE,
    SHARP_FILE,
    SUBSETS,
    SUMMARISED,
    SUMMARY_FILE,
    estimates_of,
    read_folder,
)
from pipeline.experiments.recorded.frames import PROVENANCE_FILE, provenance_of
from pipeline.experiments.sharp_curves import sharp_curves
from pipeline.experiments.tables import BLUR_ESTIMATES
from pipeline.recording.frames import Request, indexed
from pipeline.recording.kept_results import keyed
from pipeline.recording.provenance import blur_weights, provenance, write_csv

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel

SAME = ("dataset", "kind", "frames", "previous", "kernels", "psf", "camera", "seed")
"""What must agree, beside how patches are taken, for two measurements to stand in one record."""

RESULTS = (PROVENANCE_FILE, SUMMARY_FILE, SHARP_FILE, PATCHES_FILE, ESTIMATES_FILE, METRICS_FILE)
"""Files of a record, its provenance first."""


def record(
    request: Request,
    estimators: Sequence[str],
    *,
    join: bool = False,
    frame_count: int | None = None,
    patches_per_frame: int | None = None,
) -> dict[str, Any]:
    """Measure blur estimators on one dataset and write everything into a folder.

    Args:
        request: what is to be recorded.
        estimators: their names in the configuration.
        join: keep what the folder has of other estimators.
        frame_count: of the frames with patches, how many these estimators are run on, evenly spread; None for all.
        patches_per_frame: how many of the patches of such a frame; None for all. `per_frame` of the estimators in the
            configuration, which is for the stages, has no effect; the provenance has this number in its place.

    Returns:
        estimator -> metrics of those measured: see `pipeline.experiments.metrics.table_one_metrics`.

    Raises:
        InputError: the dataset, its labels, the kernels or weights are absent, there is no such estimator, or the
            folder to join was measured on other pictures, kernels or settings.
    """
    known = request.config.blur.estimators
    for name in estimators:
        if name not in known:
            raise InputError(f"blur.estimators.{name}: not in the configuration; {did_you_mean(name, known)}")
    bank = request.kernels()
    weights = {name: blur_weights(known[name].kind, known[name].options) for name in estimators}
    request = replace(request, run_map=keyed(request.run_map, __name__, weights))
    frames, all_patches = _frames(request)
    measured_frames = [
        replace(item, patches={"mtf": evenly_spread(item.patches["mtf"], patches_per_frame)})
        for item in evenly_spread(frames, frame_count)
    ]
    count = {"frames": len(measured_frames), "patches": sum(len(item.patches["mtf"]) for item in measured_frames)}
    metadata = _provenance(request, frames, bank, weights, patches_per_frame)
    metadata[SUBSETS] = {name: dict(count) for name in estimators}
    earlier = others(request.out, metadata) if join else None
    measured = _measured(request, estimators, measured_frames, all_patches, bank, metadata)
    content = measured if earlier is None else earlier.joined_by(measured)
    content.write(request.out, frames)
    return measured.metrics


@dataclass(frozen=True)
class Content:
    """What a record holds of some estimators.

    Attributes:
        metadata: its provenance, of these estimators.
        summary, sharp: see `pipeline.experiments.recorded.blur.BlurRecord`.
        estimates: of those that it keeps estimates of (`pipeline.experiments.tables.BLUR_ESTIMATES`).
        metrics: estimator -> metrics.
    """

    metadata: dict[str, Any]
    summary: pd.DataFrame
    sharp: pd.DataFrame
    estimates: pd.DataFrame
    metrics: dict[str, Any]

    def joined_by(self, new: Content) -> Content:
        """This and what was measured of other estimators, whose provenance is that of both where they agree."""
        import pandas as pd

        metadata = dict(new.metadata)
        metadata["weights"] = new.metadata["weights"] | self.metadata["weights"]
        metadata[SUBSETS] = new.metadata[SUBSETS] | self.metadata.get(SUBSETS, {})
        both = new.metadata["blur"]["estimators"] | self.metadata["blur"]["estimators"]
        metadata["blur"] = new.metadata["blur"] | {"estimators": both}
        if self.metadata.get(SUMMARISED):
            metadata[SUMMARISED] = self.metadata[SUMMARISED]
        summary, estimates = (
            pd.concat(tables, ignore_index=True)
            for tables in ([self.summary, new.summary], [self.estimates, new.estimates])
        )
        # An empty table would make the numbers objects, which are written otherwise.
        sharp = pd.concat([self.sharp, new.sharp], ignore_index=True) if len(new.sharp) else self.sharp
        return Content(metadata, summary, sharp, estimates, self.metrics | new.metrics)

    def write(self, out: Path, frames: Sequence[TestFrame]) -> None:
        """Write the record.

        Args:
            out: folder; replaced.
            frames: with the patches measured.
        """
        with store.replacing_folder(out) as folder:
            write_csv(folder / SUMMARY_FILE, self.summary)
            write_csv(folder / SHARP_FILE, self.sharp)
            write_csv(folder / PATCHES_FILE, _patches(frames))
            store.write_table(folder / ESTIMATES_FILE, self.estimates, BLUR_ESTIMATES)
            store.write_json(folder / METRICS_FILE, self.metrics)
            store.write_json(folder / PROVENANCE_FILE, self.metadata)


def others(folder: Path, metadata: Mapping[str, Any]) -> Content | None:
    """What a folder holds of estimators other than those of a new measurement; None where there is no such folder.

    Args:
        folder: of a record.
        metadata: provenance of the new measurement.

    Raises:
        InputError: the record is broken, or of other pictures, kernels or settings.
    """
    if not folder.is_dir():
        return None
    earlier = provenance_of(folder, KEYS)
    metadata = json.loads(json.dumps(metadata))  # lists for tuples, as in the file
    new, old = (
        {name: one["blur"][name] for name in one["blur"] if name != "estimators"} for one in (metadata, earlier)
    )
    differing = [name for name in SAME if earlier.get(name) != metadata[name]] + ["blur"] * (new != old)
    if differing:
        raise InputError(
            f"{folder}: measured with another {', '.join(differing)}, so nothing can join it; measure all estimators "
            "anew into another folder"
        )
    names = [name for name in earlier["blur"]["estimators"] if name not in metadata["blur"]["estimators"]]
    for part in (earlier["weights"], earlier["blur"]["estimators"], earlier.get(SUBSETS, {})):
        for name in set(part) - set(names):
            del part[name]
    if SUMMARISED in earlier:
        earlier[SUMMARISED] = [name for name in earlier[SUMMARISED] if name in names]
    known = read_folder(folder)
    tables = (known.summary, known.sharp, estimates_of(folder))
    summary, sharp, estimates = (table[table["estimator"].isin(names)] for table in tables)
    metrics = {name: item for name, item in store.read_json(folder / METRICS_FILE).items() if name in names}
    return Content(earlier, summary, sharp, estimates, metrics)


def _measured(
    request: Request,
    estimators: Sequence[str],
    frames: Sequence[TestFrame],
    all_patches: Sequence[TestFrame],
    bank: Sequence[Kernel],
    metadata: dict[str, Any],
) -> Content:
    """Estimates of each estimator, what they are summarised to, and the provenance given."""
    import pandas as pd

    config = request.config
    measured = [
        table_one.measure(
            {name: table_one.Candidate.configured(config.blur.estimators[name])},
            frames,
            stored.as_stored(bank),
            calibration_frames=all_patches,
            camera=config.camera,
            seed=config.seed,
            draws=config.blur.bootstrap_draws,
            executor=request.executor,
            label=f"blur of {request.dataset} by {{}}".format,
        )
        for name in estimators
    ]
    # A relative MTF of sharp frames is no curve of theirs: with no other estimator there are no rows.
    absolute = pd.concat([one.estimates[one.estimates["relative_to"] == SYSTEM] for one in measured], ignore_index=True)
    summary, estimates = (
        pd.concat(tables, ignore_index=True)
        for tables in ([one.summary for one in measured], [one.estimates for one in measured])
    )
    metrics = {name: table_one_metrics(one.summary) for name, one in zip(estimators, measured, strict=True)}
    return Content(metadata, summary, sharp_curves(absolute, config.seed), estimates, metrics)


def _provenance(
    request: Request,
    frames: Sequence[TestFrame],
    bank: Sequence[Kernel],
    weights: Mapping[str, Mapping[str, str]],
    patches_per_frame: int | None,
) -> dict[str, Any]:
    """As `pipeline.recording.provenance.provenance`, with the settings of the blur and of its kernels."""
    config, section = request.config, request.config.blur
    estimators = {
        name: section.estimators[name].model_copy(update={"per_frame": patches_per_frame}).model_dump()
        for name in weights
    }
    settings = {
        "blur": {**section.model_dump(exclude={"estimators"}), "estimators": estimators},
        "psf": config.psf.model_dump(exclude={"folder"}),
    }
    known = {name: files for name, files in weights.items() if files}
    pictures = (item.frame for item in frames)
    metadata = provenance(config, request.dataset, request.source, pictures, settings, known, bank)
    return metadata | metadata.pop("settings")


def _frames(request: Request) -> tuple[list[TestFrame], list[TestFrame]]:
    """Usable frames with the patches to evaluate on, and with all of them, as the stages take them."""
    result = indexed(request.config, request.dataset, request.run_map)
    some, every = (result.patches_for("blur", count) for count in (request.config.blur.patches_per_frame, None))
    where = f"dataset '{request.dataset}'"
    return with_patches(result.usable, {"mtf": some}, where), with_patches(result.usable, {"mtf": every}, where)


def _patches(frames: Sequence[TestFrame]) -> pd.DataFrame:
    import pandas as pd

    rows = [
        {"frame": item.frame.name, "patch": number, **asdict(patch)}
        for item in frames
        for number, patch in enumerate(item.patches["mtf"])
    ]
    return pd.DataFrame(rows)
