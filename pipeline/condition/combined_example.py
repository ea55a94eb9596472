"""Pictures of the combined experiments: one patch after each step of image formation, and under growing noise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.truth import Corrupted, through_optics
from pipeline.condition.combined_design import Experiment
from pipeline.datasets.corrupted import CameraSettings, corrupted
from pipeline.datasets.patches import Patch

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame

STEPS = ("scene", "photon", "optics", "dark", "readout", "frame")
"""What a picture shows: the light, after photon noise, after the optics, dark current, readout, and as recorded."""


def example_kernel(kernels: Sequence[Kernel], kind: str, size_px: float, wanted_deg: float = 45.0) -> Kernel | None:
    """The kernel of a kind and size whose rotation is nearest to the one wanted; None where the bank has none."""
    held = [kernel for kernel in kernels if kernel.kind == kind and kernel.size_px == size_px]
    return min(held, key=lambda kernel: (abs(kernel.angle_deg - wanted_deg), kernel.angle_deg)) if held else None


def steps(shown: Corrupted, patch: Patch) -> dict[str, NDArray[np.uint8]]:
    """One patch after every step of image formation that did something.

    Args:
        shown: a corrupted frame.
        patch: where to look.

    Returns:
        name of `STEPS` -> (h, w) uint8, in their order.
    """
    light = shown.signal_e
    made = {"scene": light}
    if "photon" in shown.noise_e:
        made["photon"] = light = light + shown.noise_e["photon"]
    if shown.psf is not None:
        made["optics"] = light = through_optics(light, shown.psf, shown.boundary)
    for source in ("dark", "readout"):
        if source in shown.noise_e:
            made[source] = light = light + shown.noise_e[source]
    pictures = {name: _middle(np.clip(shown.sensor.dn(value), 0, 255), patch) for name, value in made.items()}
    return {**pictures, "frame": _middle(shown.image * 255.0, patch)}


def _middle(image_dn: NDArray[np.floating], patch: Patch) -> NDArray[np.uint8]:
    """The middle quarter of a patch, uint8."""
    side, edge = patch.size_px // 2, patch.size_px // 4
    piece = image_dn[patch.y_px + edge : patch.y_px + edge + side, patch.x_px + edge : patch.x_px + edge + side]
    return np.rint(piece).astype(np.uint8)


def liveliest(places: Iterable[tuple[Frame, Sequence[Patch]]]) -> tuple[Frame, Patch]:
    """The patch whose middle has the most contrast (standard deviation), so that a blur can be seen in it.

    Args:
        places: frames with their patches, at least one; the first of equals is taken.
    """
    found = []
    for frame, patches in places:
        image = frame.image()
        found += [(float(_middle(image * 255.0, patch).std()), frame, patch) for patch in patches]
    _, frame, patch = max(found, key=lambda entry: entry[0])
    return frame, patch


def example(
    frame: Frame,
    patch: Patch,
    experiments: Sequence[Experiment],
    kernels: Sequence[Kernel],
    size_px: float,
    levels_dn: Sequence[float],
    camera: CameraSettings,
    seed: int,
) -> tuple[dict[str, NDArray[np.uint8]], dict[str, Any]]:
    """Pictures and their description, as the report draws them.

    Args:
        frame: the frame shown.
        patch: its patch.
        experiments: what comes together.
        kernels: the bank.
        size_px: of the blur shown.
        levels_dn: shown; the steps are those of the highest.
        camera: the camera that forms the image.
        seed: root of the random streams.

    Returns:
        ``step_<experiment>_<step>`` and ``level_<experiment>_<number>`` (h, w) uint8; and ``{"dataset", "frame",
        "label", "size_px", "experiments": [{"experiment", "kernel", "kind", "effect", "angle_deg", "steps",
        "levels_dn"}]}``. Experiments whose kernel the bank lacks are left out.
    """
    sharp = frame.image()
    arrays: dict[str, NDArray[np.uint8]] = {}
    entries = []
    for experiment in experiments:
        kernel = example_kernel(kernels, experiment.kind, size_px)
        if kernel is None:
            continue
        for number, level in enumerate(levels_dn):
            effect = experiment.effect if level else "photon"  # at level 0 no noise is drawn, whatever its name
            shown = corrupted(sharp, frame, effect, level, camera, seed, kernel.psf, kernel.name)
            arrays[f"level_{experiment.name}_{number}"] = _middle(shown.image * 255.0, patch)
            if level == max(levels_dn):
                made = steps(shown, patch)
                arrays |= {f"step_{experiment.name}_{name}": picture for name, picture in made.items()}
        entries.append(
            {
                "experiment": experiment.name,
                "kernel": kernel.name,
                "kind": kernel.kind,
                "effect": experiment.effect,
                "angle_deg": float(kernel.angle_deg),
                "steps": list(made),
                "levels_dn": [float(level) for level in levels_dn],
            }
        )
    head = {"dataset": frame.dataset, "frame": frame.name, "label": patch.label, "size_px": float(size_px)}
    return arrays, {**head, "experiments": entries}
