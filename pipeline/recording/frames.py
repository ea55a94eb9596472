"""Experiments on frames that the project may not keep: noise, blur and noise, denoised blur, factors of Table I.

The first three are those of the stages `noise`, `combined` and `denoised_blur`, with their settings; only the frames
are the user's. Measured by hand, with ``camera-monitor record``, and kept as small files
(`pipeline.experiments.recorded.frames` reads them); no picture is kept.

    noise_levels.csv     `pipeline.tables.NOISE_SUMMARY`
    combined_blur.csv    `pipeline.experiments.tables.BLUR_CELLS`, without noise rows
    combined_noise.csv   `pipeline.experiments.tables.NOISE_CELLS`
    combined_curves.csv  `pipeline.experiments.tables.CURVES`
    denoised_blur.csv    `pipeline.experiments.tables.BLUR_CELLS`
    factor_cells.csv     `pipeline.experiments.factors.FACTOR_CELLS`
    factor_effects.csv   `pipeline.experiments.factors.EFFECTS`
    frames.csv           frame, width_px, height_px, blur_patches, noise_tiles: those measured
    provenance.json      `pipeline.recording.provenance`
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import noise as noise_estimators
from pipeline.camera.psf import configured_bank as kernel_bank
from pipeline.camera.psf import stored
from pipeline.datasets.index import Index, index
from pipeline.datasets.open import open_section
from pipeline.datasets.selection import evenly_spread
from pipeline.experiments import combined, factors, noise
from pipeline.experiments.condition import Quantity
from pipeline.experiments.frames import PURPOSES, TestFrame, with_patches
from pipeline.experiments.pictures.combined_example import example_curves
from pipeline.experiments.recorded.frames import (
    COMBINED_FILES,
    DENOISED_FILE,
    FACTOR_FILES,
    FRAMES_FILE,
    NOISE_FILE,
    PROVENANCE_FILE,
)
from pipeline.experiments.run import Registered
from pipeline.experiments.settings import EstimatorSettings
from pipeline.recording.kept_results import Map, keyed
from pipeline.recording.provenance import configured_weights, provenance, write_record
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.config.schema import Config

COMMON_FILES = (PROVENANCE_FILE, FRAMES_FILE)
"""Files of every record, its provenance first."""


def indexed(config: Config, dataset: str, run_map: Map, patches_from: str = "auto") -> Index:
    """Usable frames of a dataset and where their patches lie, as the stages take them.

    Args:
        config: with the dataset in it.
        dataset: its name there.
        run_map: see `pipeline.executor.run_map`; changes no result.
        patches_from: where patches for blur lie, see `pipeline.datasets.index.index`.

    Raises:
        InputError: the dataset is absent, or too many frames are bad.
    """
    section = config.datasets[dataset]
    return index(
        open_section(dataset, section),
        tile_px=config.noise.tile_px,
        patch_px=config.blur.patch_px,
        max_rejected_fraction=section.max_rejected_fraction,
        patches_from=patches_from,
        run_map=run_map,
    )


@dataclass(frozen=True)
class Request:
    """What is to be recorded.

    Attributes:
        config: with the dataset and the estimators in it.
        dataset: its name there.
        out: folder to write; replaced.
        source: where pictures and kernels come from, their revision and licence, in words.
        run_map: see `pipeline.executor.run_map`; changes no result.
        weights: `pipeline.recording.provenance.configured_weights` of the estimators measured; set by `of_estimators`.
    """

    config: Config
    dataset: str
    out: Path
    source: str
    run_map: Map
    weights: Mapping[str, Any] = field(default_factory=dict)

    def of_estimators(
        self, blur: Mapping[str, EstimatorSettings], noise: Mapping[str, EstimatorSettings] | None = None
    ) -> Request:
        """The same request with the weights of these estimators, which kept results belong to.

        Args:
            blur: name in the configuration -> kind and options of a blur estimator.
            noise: likewise of noise estimators.

        Raises:
            InputError: weights are absent.
        """
        weights = configured_weights(blur, noise or {})
        return replace(self, weights=weights, run_map=keyed(self.run_map, __name__, weights))

    def executor(self, function: Callable[[Any], Any], items: Sequence[Any], label: str = "") -> list[Any]:
        """The map as experiments call it (`pipeline.experiments.run.Executor`)."""
        return list(self.run_map(function, items, label=label))

    def frames(self, per_frame: Mapping[Quantity, int | None], patches_from: str = "auto") -> list[TestFrame]:
        """Usable frames of the dataset with their patches, as the stages take them.

        Args:
            per_frame: quantity -> patches of each frame at most, evenly spread; None takes all.
            patches_from: where patches for blur lie, see `pipeline.datasets.index.index`.

        Raises:
            InputError: the dataset or its patches are absent, or too many frames are bad.
        """
        result = indexed(self.config, self.dataset, self.run_map, patches_from)
        patches = {quantity: result.patches_for(PURPOSES[quantity], count) for quantity, count in per_frame.items()}
        return with_patches(result.usable, patches, f"dataset '{self.dataset}'")

    def kernels(self) -> Sequence[Kernel]:
        """The kernels of the configuration."""
        config = self.config
        return kernel_bank.configured(config.psf, config.camera.kind, config.seed)

    def write(
        self,
        tables: Mapping[str, pd.DataFrame],
        frames: Sequence[TestFrame],
        settings: Mapping[str, Any],
        kernels: Sequence[Kernel] = (),
    ) -> None:
        """Write the record.

        Args:
            tables: file name -> table.
            frames: measured.
            settings: of the experiment.
            kernels: behind which frames were measured.
        """
        about = provenance(
            self.config,
            self.dataset,
            self.source,
            (item.frame for item in frames),
            settings,
            self.weights,
            kernels,
        )
        write_record(self.out, {**tables, FRAMES_FILE: _sizes(frames)}, about, PROVENANCE_FILE)


def record_noise(request: Request) -> pd.DataFrame:
    """Noise estimators over noise sources and levels, as the stage `noise`.

    Args:
        request: what is to be recorded.

    Returns:
        `pipeline.tables.NOISE_SUMMARY`.

    Raises:
        InputError: the dataset or weights are absent, or no frame has a tile.
    """
    import pandas as pd

    config, section = request.config, request.config.noise
    request = request.of_estimators({}, section.estimators)
    groups: dict[int | None, list[str]] = {}
    for name, estimator in section.estimators.items():
        groups.setdefault(estimator.per_frame or section.tiles_per_frame, []).append(name)
    parts, measured = [], list[TestFrame]()
    for count, names in groups.items():
        frames = request.frames({"sigma_dn": count})
        measured = max(measured, frames, key=_tiles)  # a slow estimator takes fewer tiles of the same frames
        chosen = {
            name: Registered(
                noise_estimators.create, section.estimators[name].kind, section.estimators[name].options
            )
            for name in names
        }  # fmt: skip
        result = noise.measure(
            chosen,
            frames,
            section.noise_sources,
            section.target_sigmas_dn,
            camera=config.camera,
            seed=config.seed,
            draws=section.bootstrap_draws,
            executor=request.executor,
            label=f"noise of {request.dataset} by {', '.join(names)}",
        )
        parts.append(result.summary)
    summary = pd.concat(parts, ignore_index=True)
    request.write({NOISE_FILE: summary}, measured, {"noise": section.model_dump()})
    return summary


def record_combined(request: Request) -> pd.DataFrame:
    """Blur and noise at once, as the stage `combined`.

    Args:
        request: what is to be recorded.

    Returns:
        `pipeline.experiments.tables.BLUR_CELLS`.

    Raises:
        InputError: the dataset, its labels, kernels or weights are absent.
    """
    config, section = request.config, request.config.combined
    of_blur = {name: config.blur.estimators[name] for name in section.blur_estimators}
    of_noise = {name: config.noise.estimators[name] for name in section.noise_estimators}
    smoothing = {section.denoise.sigma_by: config.noise.estimators[section.denoise.sigma_by]}
    request = request.of_estimators(of_blur, of_noise | smoothing)
    bank = request.kernels()
    experiment = combined.configured(section, config.blur.estimators, config.noise.estimators, stored.as_stored(bank))
    frames = combined.frames_of(
        section, request.frames({"mtf": section.patches_per_frame, "sigma_dn": section.tiles_per_frame})
    )
    label = f"blur and noise of {request.dataset}"
    measurements = experiment.run(frames, config.camera, config.seed, request.executor, label)
    blur = combined.blur_cells(measurements, config.seed, section.bootstrap_draws)
    sigma = combined.sigma_cells(measurements, config.seed, section.bootstrap_draws)
    tables = dict(zip(COMBINED_FILES, (blur, sigma, example_curves(measurements, section.example_px)), strict=True))
    estimators = {
        "blur": {name: one.model_dump() for name, one in of_blur.items()},
        "noise": {name: one.model_dump() for name, one in of_noise.items()},
    }
    settings = {"combined": section.model_dump(), "estimators": estimators}
    request.write(tables, frames, settings, _used(bank, experiment.kernels))
    return blur


def record_denoised(request: Request) -> pd.DataFrame:
    """Noisy patches smoothed before their blur is estimated (the supplement's table), as the stage `denoised_blur`.

    Args:
        request: what is to be recorded.

    Returns:
        `pipeline.experiments.tables.BLUR_CELLS` with the errors to be expected.

    Raises:
        InputError: the dataset, its labels, kernels or weights are absent.
    """
    config, section = request.config, request.config.denoised_blur
    chosen = {name: config.blur.estimators[name] for name in section.blur_estimators}
    request = request.of_estimators(chosen)
    bank = request.kernels()
    experiment = combined.denoised(section, config.blur.estimators, stored.as_stored(bank))
    frames = combined.frames_of(section, request.frames({"mtf": section.patches_per_frame}))
    label = f"denoised blur of {request.dataset}"
    measurements = experiment.run(frames, config.camera, config.seed, request.executor, label)
    cells = combined.with_expected(combined.blur_cells(measurements, config.seed, section.bootstrap_draws))
    estimators = {"blur": {name: one.model_dump() for name, one in chosen.items()}}
    settings = {"denoised_blur": section.model_dump(), "estimators": estimators}
    request.write({DENOISED_FILE: cells}, frames, settings, _used(bank, experiment.kernels))
    return cells


def record_factors(
    request: Request, frame_count: int, exact_sizes_px: Sequence[float], *, with_grid: bool = True
) -> pd.DataFrame:
    """Each choice behind Table I switched, all else equal (`pipeline.experiments.factors`).

    Args:
        request: what is to be recorded; ``blur.patches_per_frame`` patches of each frame.
        frame_count: frames, evenly spread over those with labelled objects.
        exact_sizes_px: kernels on which exact and fast programs are compared.
        with_grid: whether patches over objects are compared with those of a grid.

    Returns:
        `pipeline.experiments.factors.EFFECTS`.

    Raises:
        InputError: the dataset, its labels, kernels or weights are absent.
    """
    config = request.config
    request = request.of_estimators({factors.NETWORK: EstimatorSettings(kind=factors.NETWORK)})
    count = config.blur.patches_per_frame
    on_objects = evenly_spread(request.frames({"mtf": count}, "objects"), frame_count)
    frames = {"objects": on_objects}
    if with_grid:
        names = {item.frame.name for item in on_objects}
        tiled = [item for item in request.frames({"mtf": None}, "frame") if item.frame.name in names]
        frames["grid"] = [_sampled(item, count, config.seed) for item in tiled]
    bank = request.kernels()
    cells, effects = factors.measure(
        frames,
        stored.as_stored(bank),
        exact_sizes_px,
        camera=config.camera,
        seed=config.seed,
        draws=config.blur.bootstrap_draws,
        executor=request.executor,
        label=f"factors on {request.dataset}",
    )
    settings = {"factors": dict(factors.SETTINGS), "patches_per_frame": count, "exact_sizes_px": list(exact_sizes_px)}
    request.write(dict(zip(FACTOR_FILES, (cells, effects), strict=True)), on_objects, settings, bank)
    return effects


def _sampled(frame: TestFrame, count: int | None, seed: int) -> TestFrame:
    """The frame with so many of its blur patches, drawn at random: every n-th of a grid may be one column of it."""
    patches = frame.patches["mtf"]
    drawn = stream(seed, "factors", "grid", frame.frame.name).permutation(len(patches))[:count]
    return replace(frame, patches={**frame.patches, "mtf": [patches[index] for index in sorted(drawn)]})


def _used(bank: Sequence[Kernel], kernels: Iterable[Kernel]) -> list[Kernel]:
    """The kernels of a bank that an experiment takes: discs that only denoise are none of them."""
    names = {kernel.name for kernel in kernels}
    return [kernel for kernel in bank if kernel.name in names]


def _tiles(frames: Sequence[TestFrame]) -> int:
    return sum(len(item.patches["sigma_dn"]) for item in frames)


def _sizes(frames: Sequence[TestFrame]) -> pd.DataFrame:
    import pandas as pd

    rows = []
    for item in frames:
        height, width = item.frame.image().shape
        counts = {name: len(item.patches.get(quantity, ())) for quantity, name in _COUNTS.items()}
        rows.append({"frame": item.frame.name, "width_px": width, "height_px": height, **counts})
    return pd.DataFrame(rows)


_COUNTS: Mapping[Quantity, str] = {"mtf": "blur_patches", "sigma_dn": "noise_tiles"}
