"""The monitor of a run of ``camera-monitor health``, calibrated as its options ask for."""

from __future__ import annotations

import warnings
from collections import Counter
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.calibration import camera_store
from pipeline.cli.frames.pictures import least_side_px, read

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.cli.health.options import HealthOptions
    from pipeline.condition import ConditionMonitor


def monitor_of(options: HealthOptions, about: dict[str, Any]) -> tuple[ConditionMonitor, set[tuple[int, ...]]]:
    """The monitor, calibrated as asked for, and the sizes (H, W) of frames that its calibration is of.

    Args:
        options: of the command.
        about: of the run; its weights are written to it.

    Raises:
        InputError: an unknown estimator, or sharp pictures that it cannot be calibrated to.
    """
    from pipeline.condition import ConditionMonitor  # which loads the estimators: only once no option can be refused
    from pipeline.recording.provenance import monitor_weights

    monitor = ConditionMonitor(
        options.estimator, options.noise_name, blur_options={"output": "relative"} if options.generic_lens else None,
        most_tiles=options.most_tiles, most_patches=options.most_patches,
    )  # fmt: skip
    about |= {"weights_released": monitor.weights_released, "weights_sha256": monitor_weights(monitor)}
    if options.sharp:
        return monitor, _calibrate(monitor, options)
    if options.camera is None:
        return monitor, set()
    camera_store.apply(options.camera, monitor)
    if doubt := options.camera.doubt():
        click.echo(f"warning: {doubt}", err=True)
    return monitor, set() if options.camera.size_px is None else {options.camera.size_px}


def _calibrate(monitor: ConditionMonitor, options: HealthOptions) -> set[tuple[int, ...]]:
    """Calibrate a monitor to sharp frames, whose sizes (H, W) are returned; warns of those that do not look sharp."""
    images: list[NDArray[np.float32]] = []
    names: list[str] = []
    hinted = Counter[int]()
    for file in options.sharp_files:
        for name, image, _ in read(file, options.every, hinted, least_side_px(monitor.noise_estimator)):
            images.append(image)
            names.append(f"--sharp {name}")
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always")
        monitor.calibrate(images, fitted=options.calibrate_estimator, names=names)
    for doubt in doubts:
        if doubt.category is UserWarning:  # and not the remarks of a library
            click.echo(f"warning: {doubt.message}", err=True)
    return {image.shape for image in images}
