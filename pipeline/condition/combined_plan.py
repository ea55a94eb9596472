"""From the configuration to the work: which frames, kernels and estimators a combined experiment takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pipeline.camera.psf.defocus import create as disc
from pipeline.camera.psf.kernel import Kernel
from pipeline.condition.combined import Bench, Rows
from pipeline.condition.combined_design import DISC, Experiment, Smoothing, Subset, chosen_kernels, spread
from pipeline.datasets.corrupted import CameraSettings
from pipeline.datasets.patches import Patch
from pipeline.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame

Made = tuple[str, Mapping[str, Any]]  # an estimator's registry name and options
Work = tuple["Frame", Sequence[Patch], Sequence[Patch], frozenset[str]]


@dataclass(frozen=True)
class Plan:
    """A `Bench` before its estimators are made; it travels to worker processes.

    Attributes:
        experiments, kernels, levels_dn, camera, seed: see `Bench`.
        blur: name -> how to make it, and its part of the conditions.
        blur_frames: name -> how many frames it is run on; None for all.
        noise: name -> how to make it.
        filters_px, from_sigma_dn: see `Smoothing`.
        sigma_by: the noise estimator that says which patches are noisy; None smooths all.
    """

    experiments: Sequence[Experiment]
    kernels: Sequence[Kernel]
    levels_dn: Sequence[float]
    blur: Mapping[str, tuple[Made, Subset]]
    camera: CameraSettings
    seed: int
    blur_frames: Mapping[str, int | None] = field(default_factory=dict)
    noise: Mapping[str, Made] = field(default_factory=dict)
    filters_px: tuple[float, ...] = ()
    from_sigma_dn: float = 0.0
    sigma_by: Made | None = None

    def work(
        self,
        frames: Sequence[Frame],
        patches: Mapping[str, Sequence[Patch]],
        tiles: Mapping[str, Sequence[Patch]],
        count: int | None,
    ) -> list[Work]:
        """What each worker is given: a frame, its patches and tiles, and the blur estimators that take it.

        Args:
            frames: of the dataset.
            patches: frame -> where blur is estimated; frames without any are passed over.
            tiles: frame -> where noise is estimated.
            count: of frames, evenly spread; None takes all.
        """
        usable = spread([frame for frame in frames if frame.name in patches], count)
        takes = {
            name: {frame.name for frame in spread(usable, self.blur_frames.get(name))}
            for name in self.blur
        }  # fmt: skip
        return [
            (
                frame,
                patches[frame.name],
                tiles.get(frame.name, []),
                frozenset(name for name, chosen in takes.items() if frame.name in chosen),
            )
            for frame in usable
        ]

    def evaluate(self, work: Work) -> tuple[Rows, Rows]:
        """What one worker does; see `Bench.evaluate`."""
        from pipeline import blur, noise

        frame, patches, tiles, names = work
        gate = None
        if self.sigma_by is not None:
            judge = noise.create(self.sigma_by[0], **self.sigma_by[1])

            def gate(seen: Any) -> Any:
                return judge.estimate(seen).sigma_dn

        bench = Bench(
            experiments=self.experiments,
            kernels=self.kernels,
            levels_dn=self.levels_dn,
            blur={
                name: (blur.create(kind, **options), part)
                for name, ((kind, options), part) in self.blur.items()
                if name in names
            },
            noise={name: noise.create(kind, **options) for name, (kind, options) in self.noise.items()},
            smoothing=Smoothing(self.filters_px, self.from_sigma_dn, gate),
            camera=self.camera,
            seed=self.seed,
        )
        return bench.evaluate(frame, patches, tiles)


def _made(sections: Mapping[str, Any], name: str, key: str, where: str) -> Made:
    """How to make a configured estimator.

    Raises:
        InputError: it is not configured.
    """
    if name not in sections:
        raise InputError(f"{key}: '{name}' is not among {where}; {did_you_mean(name, sections)}")
    return sections[name].kind, dict(sections[name].options)


def combined_plan(
    section: Any,
    blur_sections: Mapping[str, Any],
    noise_sections: Mapping[str, Any],
    bank: Sequence[Kernel],
    camera: CameraSettings,
    seed: int,
) -> Plan:
    """The plan of the stage `combined`.

    Args:
        section: ``combined`` of the configuration.
        blur_sections: ``blur.estimators``.
        noise_sections: ``noise.estimators``.
        bank: of kernels.
        camera: the camera that forms the image.
        seed: root of the random streams.

    Raises:
        InputError: an estimator that is not configured, or a kernel that the bank lacks.
    """
    experiments = [Experiment(name, each.kind, each.effect) for name, each in section.experiments.items()]
    kinds = [each.kind for each in experiments]
    denoise = section.denoise
    parts = {
        name: Subset(part.sizes_px, part.angles_deg, part.levels_dn, part.experiments)
        for name, part in section.blur_estimators.items()
    }
    key, where = "combined.blur_estimators", "blur.estimators"
    return Plan(
        experiments=experiments,
        kernels=chosen_kernels(bank, kinds, section.sizes_px, "combined.sizes_px"),
        levels_dn=section.levels_dn,
        blur={name: (_made(blur_sections, name, key, where), part) for name, part in parts.items()},
        camera=camera,
        seed=seed,
        blur_frames={name: part.frames for name, part in section.blur_estimators.items()},
        noise={
            name: _made(noise_sections, name, "combined.noise_estimators", "noise.estimators")
            for name in section.noise_estimators
        },
        filters_px=() if denoise.filter_px is None else (denoise.filter_px,),
        from_sigma_dn=denoise.from_sigma_dn,
        sigma_by=_made(noise_sections, denoise.sigma_by, "combined.denoise.sigma_by", "noise.estimators"),
    )


def denoised_plan(
    section: Any, blur_sections: Mapping[str, Any], bank: Sequence[Kernel], camera: CameraSettings, seed: int
) -> Plan:
    """The plan of the stage `denoised_blur`: every patch is smoothed, and the discs themselves are read as well.

    Args:
        section: ``denoised_blur`` of the configuration.
        blur_sections: ``blur.estimators``.
        bank: of kernels.
        camera: the camera that forms the image.
        seed: root of the random streams.

    Raises:
        InputError: an estimator that is not configured, or a kernel that the bank lacks.
    """
    discs = [Kernel(f"disc_{size:g}", DISC, float(size), 0.0, disc(float(size))) for size in section.filters_px]
    key, where = "denoised_blur.blur_estimators", "blur.estimators"
    return Plan(
        experiments=[
            Experiment(f"{section.kind}_{section.effect}", section.kind, section.effect),
            Experiment(DISC, DISC, section.effect),
        ],
        kernels=[*chosen_kernels(bank, [section.kind], section.sizes_px, "denoised_blur.sizes_px"), *discs],
        levels_dn=[0.0, *section.levels_dn],
        blur={
            name: (_made(blur_sections, name, key, where), Subset())
            for name in section.blur_estimators
        },
        camera=camera,
        seed=seed,
        filters_px=tuple(section.filters_px),
    )  # fmt: skip
