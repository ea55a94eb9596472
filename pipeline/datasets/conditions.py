"""Conditions of a sweep: straight or other blur of several sizes and directions, each under several levels of noise.

Each frame draws its noise once and every condition scales that draw (`pipeline.camera.levels.corrupt` promises as much
for equal streams), so neighbouring conditions differ by their level and their kernel and by nothing else. Noise that
comes after the optics leaves the blur alone: a frame is then blurred once per kernel, whatever the number of levels.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera import chain, levels
from pipeline.camera.psf.bank import bank
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.truth import Corrupted, through_optics
from pipeline.streams import stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.frame import Frame

SHARP = "sharp"


def kernels(kind: str, sizes_px: Sequence[float], angles_deg: Sequence[float], match: str, seed: int) -> list[Kernel]:
    """The kernels of a sweep, no blur at all first.

    Args:
        kind: of blur, as in `pipeline.camera.psf`.
        sizes_px: sizes; 0 stands for no blur, which is always among them.
        angles_deg: rotations.
        match: see `pipeline.camera.psf.bank.bank`.
        seed: root seed, for random kinds.
    """
    sharp = Kernel(SHARP, SHARP, 0.0, 0.0, np.ones((1, 1), np.float32))
    return [sharp, *bank([kind], [size for size in sizes_px if size > 0], angles_deg, seed, match=match)]


def conditions(
    sharp: NDArray[np.float32],
    frame: Frame,
    kernel: Kernel,
    effect: str,
    levels_dn: Sequence[float],
    camera: CameraSettings,
    seed: int,
) -> Iterator[tuple[float, Corrupted]]:
    """One frame behind one kernel, at every level of noise.

    Args:
        sharp: (H, W) float32 in [0, 1], the frame's picture.
        frame: names the random stream.
        kernel: of the optics.
        effect: noise source or preset (`pipeline.camera.chain`).
        levels_dn: standard deviations asked for, DN.
        camera: the camera.
        seed: root seed.

    Yields:
        level, frame and its truth; the image is what `pipeline.camera.levels.corrupt` gives for the frame's stream.
    """
    key = ("conditions", frame.dataset, frame.name, effect)
    psf = None if kernel.name == SHARP else kernel.psf
    options: dict[str, Any] = {"sensor": camera.sensor, "poisson": camera.poisson, "key": (seed, *key)}
    name, effects = chain.preset(effect)
    if camera.kind != "physical" or camera.light != "encoded" or effects.photon or psf is None:
        for level in levels_dn:
            draw = stream(seed, *key)
            yield (
                float(level),
                levels.corrupt(
                    sharp,
                    effect,
                    sigma_dn=float(level),
                    generator=draw,
                    psf=psf,
                    camera=camera.kind,
                    order=camera.order,
                    light=camera.light,
                    **options,
                ),
            )
        return
    light = through_optics(camera.sensor.electrons(chain.as_image(sharp)), psf, "reflect")
    for level in levels_dn:
        drawn, gain = chain.Drawn({}, float("nan"), float("nan")), 0.0
        if level > 0:
            drawn = chain.draw(light, effects, camera.sensor, stream(seed, *key), poisson=camera.poisson)
            gain = levels.gain_to_reach(drawn, float(level), camera.sensor)
        yield float(level), chain.develop(light, drawn, gain=gain, effect=name, level_dn=float(level), **options)


def evaluation_frames(
    folder: Any, name: str, section: Any, options: dict[str, Any], count: int | None = None
) -> list[Frame]:
    """Frames to judge detectors on: those of the stored index, or more of the same dataset with other options.

    Args:
        folder: where the stage `index` wrote.
        name: the dataset's name.
        section: its section of the configuration.
        options: options of its reader that differ, e.g. ``{"moments": "all"}``; with any, every frame of the dataset is
            taken that has no defect.
        count: at most this many, evenly spread; None takes all.
    """
    from pipeline.datasets.index import indexed_frames
    from pipeline.datasets.open import open_section

    if options:
        changed = section.model_copy(update={"options": {**section.options, **options}, "limit": None})
        frames = [frame for frame in open_section(name, changed).frames() if not frame.defect]
    else:
        frames = indexed_frames(folder, name, section)
    return spread(frames, count)


def spread(frames: list[Frame], count: int | None) -> list[Frame]:
    """At most so many frames, evenly spread over them; None takes all."""
    if count is None or len(frames) <= count:
        return frames
    return [frames[number * len(frames) // count] for number in range(count)]


def scene_of(kind: str, frame: str) -> str:
    """What a frame shows: frames of one scene are no independent samples. Sim's moments share their viewpoint."""
    return frame.rpartition("-")[0] or frame if kind == "sim" else frame
