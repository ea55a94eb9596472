"""A made-up sweep of a detector: one car a frame, found less often the longer the blur and the stronger the noise."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.experiments.detect import DETECTIONS, LOOKED, OBJECTS
from pipeline.experiments.tables import CONDITIONS

SIZES, ANGLES, LEVELS = (0.0, 3.0, 7.0, 14.0, 21.0), (0.0, 90.0), (0.0, 10.0, 20.0)
FRAMES = 12


def names() -> list[tuple[str, str, float, float]]:
    blurred = [(f"motion_{s:g}_{a:g}", "linear_motion", s, a) for s in SIZES[1:] for a in ANGLES]
    return [("sharp", "sharp", 0.0, 0.0), *blurred]


def sweep_tables(scenes: int = FRAMES) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """One car a frame; it is found in the first frames, the fewer the longer, steeper and noisier the blur."""
    results, looked, objects, medians = [], [], [], []
    for number in range(FRAMES):
        frame, box = f"f{number:02d}", {"x1": 10.0, "y1": 10.0, "x2": 60.0, "y2": 50.0}
        objects.append({"frame": frame, "label": "car", **box, "ignore": False, "visible_fraction": 1.0})
        low = {"x1": 0.0, "y1": 0.0, "x2": 20.0, "y2": 20.0}  # lower than 25 px: ignored
        objects.append({"frame": frame, "label": "car", **low, "ignore": False, "visible_fraction": np.nan})
    for kernel, kind, size, angle in names():
        for level in LEVELS:
            position = {
                "kernel": kernel,
                "blur_kind": kind,
                "kernel_size_px": size,
                "angle_deg": angle,
                "noise_source": "dcsn",
            }
            share = 1.0 - size / 30.0 * (1.2 if angle else 0.8) - level / 100.0
            count = round(FRAMES * share)
            for number in range(FRAMES):
                frame, hit = f"f{number:02d}", number < count
                scene = f"s{number * scenes // FRAMES}"
                looked.append(
                    {"frame": frame, "scene": scene, **position, "target_sigma_dn": level, "detections": int(hit)}
                )
                if hit:
                    box = {"x1": 10.0, "y1": 10.0, "x2": 60.0, "y2": 50.0}
                    results.append(
                        {"frame": frame, "kernel": kernel, "target_sigma_dn": level, "label": "car", "score": 0.9} | box
                    )
            row = dict.fromkeys(CONDITIONS.columns, 0.0) | position | {"target_sigma_dn": level, "sigma_dn": level}
            medians.append(row | {"mtf": 1.0 - size / 30.0 + (0.01 if angle else -0.01) * (size > 0)})
    return (
        DETECTIONS.conform(pd.DataFrame(results)),
        LOOKED.conform(pd.DataFrame(looked)),
        OBJECTS.conform(pd.DataFrame(objects)),
        CONDITIONS.conform(pd.DataFrame(medians)),
    )
