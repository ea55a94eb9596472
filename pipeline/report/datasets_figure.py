"""The figure of the datasets: sample frames with their boxes and patches, beside the statistics of their pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report import style
from pipeline.report.inputs import records
from pipeline.report.style import Drawing
from pipeline.report.wording import listing, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

SHOWN_PX = 300  # longest side of a picture inside the figure
MOST_FRAMES = 4


@dataclass(frozen=True)
class DatasetSample:
    """What the figure shows of one dataset.

    Attributes:
        name: of the dataset.
        frames: frame name -> (H, W) uint8.
        boxes: frame name -> list of ``{label, x1, y1, x2, y2, ignore}``.
        patches: columns frame, purpose, x_px, y_px, size_px; None where there is no such table.
    """

    name: str
    frames: Mapping[str, np.ndarray]
    boxes: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)
    patches: pd.DataFrame | None = None


def radial_spectrum(image: np.ndarray, bins: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Power spectrum averaged over directions, of the frame under a Hann window with its mean removed.

    Args:
        image: (H, W) grey levels, 0..255.
        bins: logarithmically spaced, from 0.008 to 0.5 cycles per pixel.

    Returns:
        (bins,) frequency in cycles per pixel, (bins,) mean power in DN^2; bins without a sample are NaN.
    """
    grey = image.astype(np.float64)
    window = np.hanning(grey.shape[0])[:, None] * np.hanning(grey.shape[1])[None, :]
    power = np.abs(np.fft.rfft2((grey - grey.mean()) * window)) ** 2 / max((window**2).sum(), 1e-12)
    radius = np.hypot(np.fft.fftfreq(grey.shape[0])[:, None], np.fft.rfftfreq(grey.shape[1])[None, :])
    edges = np.geomspace(0.008, 0.5, bins + 1)
    place = np.digitize(radius.ravel(), edges) - 1
    inside = (place >= 0) & (place < bins)
    total = np.bincount(place[inside], power.ravel()[inside], bins)
    count = np.bincount(place[inside], minlength=bins)
    mean = np.divide(total, count, out=np.full(bins, np.nan), where=count > 0)
    return np.sqrt(edges[1:] * edges[:-1]), mean


def _shrunk(image: np.ndarray) -> tuple[np.ndarray, float]:
    """The picture with its longest side at most `SHOWN_PX`, and the scale used (area averages, no aliasing)."""
    import cv2

    scale = min(1.0, SHOWN_PX / max(image.shape))
    if scale == 1.0:
        return image, 1.0
    size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA), scale


def _picture(axes: Axes, sample: DatasetSample, frame: str) -> None:
    from matplotlib.patches import Rectangle

    picture, scale = _shrunk(sample.frames[frame])
    axes.imshow(picture, cmap="gray", vmin=0, vmax=255)
    style.bare(axes)
    axes.set_xlim(-0.5, picture.shape[1] - 0.5)
    axes.set_ylim(picture.shape[0] - 0.5, -0.5)

    def outline(x: float, y: float, width: float, height: float, **look: Any) -> None:
        corner = (x * scale - 0.5, y * scale - 0.5)
        axes.add_patch(Rectangle(corner, width * scale, height * scale, fill=False, **look))

    if sample.patches is not None:
        here = sample.patches[(sample.patches["frame"] == frame) & (sample.patches["purpose"] == "blur")]
        for patch in records(here):
            side = patch["size_px"]
            outline(patch["x_px"], patch["y_px"], side, side, edgecolor=style.PALETTE[5], lw=0.7, ls=(0, (2.5, 1.5)))
    for box in sample.boxes.get(frame, ()):
        colour, dash = (style.MUTED, ":") if box.get("ignore") else (style.PALETTE[4], "-")
        width, height = box["x2"] - box["x1"], box["y2"] - box["y1"]
        outline(box["x1"], box["y1"], width, height, edgecolor=colour, lw=0.8, linestyle=dash)


@style.styled
def draw(samples: Sequence[DatasetSample]) -> Drawing:
    """One row of frames per dataset (boxes solid, blur patches dashed), then spectrum and histogram of all.

    Args:
        samples: datasets in the order shown, each with at least one frame.
    """
    import pandas as pd

    across = max(1, min(MOST_FRAMES, max(len(sample.frames) for sample in samples)))
    width = style.TWO_COLUMNS_IN
    heights = []
    for sample in samples:
        shapes = [frame.shape for frame in list(sample.frames.values())[:across]]
        heights.append(max(height / long for height, long in shapes) * width / across + 0.12)
    figure = style.new_figure(width, sum(heights) + 2.0)
    upper, lower = np.ravel(np.asarray(figure.subfigures(2, 1, height_ratios=[sum(heights), 2.0])))
    pictures = upper.subplots(len(samples), across, squeeze=False, height_ratios=heights)
    spectrum_axes, histogram_axes = lower.subplots(1, 2)

    rows: list[dict[str, Any]] = []
    for number, sample in enumerate(samples):
        names = list(sample.frames)[:across]
        for axes, frame in zip(pictures[number], names, strict=False):
            _picture(axes, sample, frame)
        for axes in pictures[number][len(names) :]:
            axes.set_axis_off()
        pictures[number][0].set_title(word(sample.name), loc="left", pad=3)
        look = style.series_look(sample.name, number)
        spectra = np.array([radial_spectrum(sample.frames[frame])[1] for frame in names])
        frequency = radial_spectrum(sample.frames[names[0]])[0]
        power = np.exp(np.log(np.maximum(spectra, 1e-9)).mean(axis=0))
        counts = sum(np.bincount(sample.frames[frame].ravel(), minlength=256) for frame in names)
        share = np.asarray(counts, dtype=float).reshape(64, 4).sum(axis=1) / max(int(np.sum(counts)), 1)
        spectrum_axes.loglog(
            frequency, power, color=look["color"], linestyle=look["linestyle"], label=word(sample.name),
            gid=style.series_id(sample.name, "spectrum"),
        )  # fmt: skip
        histogram_axes.stairs(
            100 * share, np.arange(0, 257, 4), color=look["color"],
            label=word(sample.name), gid=style.series_id(sample.name, "histogram"), linewidth=1.0,
        )  # fmt: skip
        rows += [
            {"dataset": sample.name, "curve": "spectrum", "x": x, "y": y} for x, y in zip(frequency, power, strict=True)
        ]
        rows += [
            {"dataset": sample.name, "curve": "histogram_percent", "x": 4 * i, "y": 100 * y}
            for i, y in enumerate(share)
        ]
    spectrum_axes.set(xlabel="spatial frequency [cycles/px]", ylabel="power [DN²]", title="Power spectrum")
    histogram_axes.set(xlabel="grey level [DN]", ylabel="share of pixels [%]", title="Histogram", xlim=(0, 256))
    spectrum_axes.legend()
    words = [f"{word(sample.name)} ({len(sample.frames)} shown)" for sample in samples]
    boxes = sum(len(list(sample.boxes.get(frame, ()))) for sample in samples for frame in sample.frames)
    alt = (
        f"Sample frames of {listing(words)} with {boxes} object boxes drawn; below, the radially averaged power "
        "spectrum and the grey-level histogram of the frames shown."
    )
    series = style.switches(sample.name for sample in samples) if len(samples) > 1 else ()
    return Drawing(figure, alt, pd.DataFrame(rows), series)
