"""The default noise estimator on frames with noise behind a codec, a filter or a tone curve: right or wrong.

    python benchmarks/coded_noise.py [--dataset NAME=KIND:ROOT ...] [--frames N] [--patches N] [--rows CSV] [--out FILE]

Frames of *Sim* and of the datasets named (kinds of `pipeline.datasets`, e.g. ``kitti=kitti:data/raw/kitti``) get normal
noise of 0 to 25 DN, equal in all colours, and are stored as JPEG, Motion JPEG, MPEG-4 or H.264
(`pipeline.camera.processing.codec`); a video is of three frames, the last is taken. Others are filtered, scaled,
turned, sharpened or demosaiced (`FILTERS`), as frames are that were denoised, resized or rectified before, or get
photon or readout noise in linear light (`CURVES`), as those of a monochrome camera with a gamma, whose noise is
strongest in the shadows. The *truth* of a patch is the standard deviation over four shots of the processed frames, each
with its own noise: what differs from shot to shot is noise, whoever made it. Noise that a recorded frame has itself
stays the same and is not among it, so that weak noise is judged fairly only on frames with hardly any. Patches of 128
px are cut anywhere; those with more than 5 % of black or white pixels (``saturated``) are left out: clipping took part
of their noise, and the estimate is of the rest of the patch. Frames are estimated whole
(`pipeline.condition.ConditionMonitor`), and their truth is that of the median tile.

An answer is ``wrong`` where it is off by more than 20 % of the truth and by more than 0.5 DN. ``wrong_fraction`` and
``held_fraction`` (of truths in the 95 % interval) are of the answers; ``compressed_fraction`` is that of abstentions
that name compression. Where there is no answer but a bound (`NoiseEstimate.at_most_dn`, of frames
`NoiseState.at_most_dn`), ``bounded`` counts them, ``bound_dn`` is its median and ``bound_held_fraction`` the share of
truths below it. ``none``, the same frames as they were, stands beside them.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import cv2  # noqa: E402
import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

from pipeline.camera import tone_curve  # noqa: E402
from pipeline.camera.processing import temporal_noise  # noqa: E402
from pipeline.camera.processing.codec import VIDEO, Codec, store  # noqa: E402
from pipeline.camera.saturation import saturated_fraction  # noqa: E402
from pipeline.condition import ConditionMonitor  # noqa: E402
from pipeline.datasets import open_dataset  # noqa: E402
from pipeline.datasets.decoding.pictures import read_grey8  # noqa: E402
from pipeline.datasets.patches import Patch, cut  # noqa: E402
from pipeline.datasets.selection import evenly_spread  # noqa: E402
from pipeline.errors import InputError  # noqa: E402
from pipeline.noise.base import COMPRESSED  # noqa: E402
from pipeline.noise.training.samples import noise_by_level  # noqa: E402
from pipeline.streams import stream  # noqa: E402

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.datasets.dataset import Dataset
    from pipeline.noise.base import NoiseEstimate

CODECS = (
    Codec("none"),
    *(Codec("jpeg", quality) for quality in (60, 80, 90, 95)),
    Codec("mjpeg", 4),
    Codec("mpeg4", 4),
    Codec("h264", 23),
)
TURNED_DEG = 2.0
ZOOM = 4
SHARPENING = np.array([[0, -0.5, 0], [-0.5, 3, -0.5], [0, -0.5, 0]], np.float32)
"""A picture with half its Laplacian added."""


def turned(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A frame turned about its middle, as rectification does."""
    height, width = frame.shape
    matrix = cv2.getRotationMatrix2D((width / 2, height / 2), TURNED_DEG, 1)
    return np.asarray(cv2.warpAffine(frame, matrix, (width, height), borderMode=cv2.BORDER_REFLECT), np.uint8)


def zoomed(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The middle of a frame enlarged to its size, as by a digital zoom."""
    height, width = (side // ZOOM for side in frame.shape)
    top, left = (frame.shape[0] - height) // 2, (frame.shape[1] - width) // 2
    middle = frame[top : top + height, left : left + width]
    return np.asarray(cv2.resize(middle, None, fx=ZOOM, fy=ZOOM, interpolation=cv2.INTER_CUBIC), np.uint8)


def demosaiced(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A grey frame as a colour camera would deliver it: taken as a Bayer mosaic, and interpolated bilinearly."""
    return np.asarray(cv2.cvtColor(cv2.cvtColor(frame, cv2.COLOR_BayerRGGB2BGR), cv2.COLOR_BGR2GRAY), np.uint8)


FILTERS: Mapping[str, Callable[[NDArray[np.uint8]], Any]] = {
    "scaled 0.7": partial(cv2.resize, dsize=None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA),
    "scaled 1.3": partial(cv2.resize, dsize=None, fx=1.3, fy=1.3, interpolation=cv2.INTER_LINEAR),
    "scaled 4": zoomed,
    "aliased 0.5": partial(cv2.resize, dsize=None, fx=0.5, fy=0.5, interpolation=cv2.INTER_CUBIC),
    "turned": turned,
    "demosaiced": demosaiced,
    "sharpened": partial(cv2.filter2D, ddepth=-1, kernel=SHARPENING),
    "gaussian": partial(cv2.GaussianBlur, ksize=(0, 0), sigmaX=0.8),
    "median": partial(cv2.medianBlur, ksize=3),
    "bilateral": partial(cv2.bilateralFilter, d=5, sigmaColor=25, sigmaSpace=2),
    "nlm": partial(cv2.fastNlMeansDenoising, h=7, templateWindowSize=5, searchWindowSize=15),
}
"""Name -> what is done to the grey frame with its noise."""

CURVES: Mapping[str, tuple[tuple[float, float, float], float]] = {
    "photons 2.2": ((1.0, 0.0, 0.0), 2.2),
    "readout 2.2": ((0.0, 0.0, 1.0), 2.2),
}
"""Name -> noise that comes before a tone curve, as shares of photons, dark current and readout, and its gamma."""

PROCESSINGS: tuple[Codec | str, ...] = (*CODECS, *FILTERS, *CURVES)
SIGMAS_DN = (0.0, 2.0, 5.0, 10.0, 25.0)
SHOTS, FRAMES_BEFORE = 4, 2
PATCH_PX = 128
MOST_SATURATED = 0.05
TOLERANCE, TOLERANCE_DN = 0.2, 0.5
SEED = 1


def behind_curve(
    frame: NDArray[np.uint8],
    sigma_dn: float,
    source: tuple[float, float, float],
    gamma: float,
    generator: np.random.Generator,
) -> NDArray[np.uint8]:
    """A frame with noise from before its tone curve; arguments: `pipeline.noise.training.samples.noise_by_level`."""
    sigma, _ = noise_by_level(np.bincount(frame.ravel(), minlength=256), sigma_dn, source, gamma)
    light = tone_curve.decode(frame / 255, gamma) + sigma[frame] * generator.standard_normal(frame.shape)
    return np.rint(255 * tone_curve.encode(np.clip(light, 0, 1), gamma)).astype(np.uint8)


def noisy(frame: NDArray[np.uint8], sigma_dn: float, generator: np.random.Generator) -> NDArray[np.uint8]:
    """A frame with normal noise, in whole grey levels."""
    return np.clip(np.rint(frame + sigma_dn * generator.standard_normal(frame.shape)), 0, 255).astype(np.uint8)


def coloured(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Grey levels (H, W) as (H, W, 3)."""
    return np.repeat(grey[..., None], 3, axis=2)


def shots(frame: NDArray[np.uint8], processing: Codec | str, sigma_dn: float, *key: str | float) -> NDArray[np.uint8]:
    """Shots of one scene as they come back from a codec or a filter.

    Args:
        frame: (H, W) grey levels, without added noise.
        processing: the codec that stores them, one of `FILTERS`, or one of `CURVES`.
        sigma_dn: of the normal noise added before; behind a tone curve, of that over the frame.
        key: of the random stream.

    Returns:
        (`SHOTS`, H, W), each with its own noise; grey is the mean of the colours.
    """
    generator = stream(SEED, "coded noise", *key)

    def grey() -> NDArray[np.uint8]:
        return noisy(frame, sigma_dn, generator)

    if isinstance(processing, str) and processing in CURVES:
        return np.stack([behind_curve(frame, sigma_dn, *CURVES[processing], generator) for _ in range(SHOTS)])
    if isinstance(processing, str):
        return np.stack([FILTERS[processing](grey()) for _ in range(SHOTS)])
    before = FRAMES_BEFORE if processing.name in VIDEO else 0
    stored = [store(coloured(grey()), processing, [coloured(grey()) for _ in range(before)]) for _ in range(SHOTS)]
    return np.stack([np.rint(picture.mean(axis=2)).astype(np.uint8) for picture in stored])


def places(shape: Sequence[int], count: int, generator: np.random.Generator) -> list[Patch]:
    """Patches anywhere in a frame, on a codec's grid or off it."""
    if min(shape) < PATCH_PX:
        raise InputError(f"a frame of {shape[1]}x{shape[0]} px; expected at least {PATCH_PX} px on either side")
    rows, columns = (generator.integers(0, side - PATCH_PX + 1, count) for side in shape)
    return [Patch(int(x), int(y), PATCH_PX) for y, x in zip(rows, columns, strict=True)]


def true_dn(taken: NDArray[np.uint8], patches: Sequence[Patch]) -> NDArray[np.float64]:
    """(N,) standard deviation over the shots in each patch, DN."""
    stack = np.stack([cut(shot, patches)[:, 0] * 255 for shot in taken], axis=1)
    return np.array([temporal_noise.measure(part).sigma_dn for part in stack])


def measure(dataset: Dataset, frames: int, patches: int) -> pd.DataFrame:
    """Estimates of patches and of whole frames of a dataset, each with its truth, one row each."""
    monitor, rows = ConditionMonitor(), []
    chosen = evenly_spread(dataset.frames(), frames)
    for number, frame in enumerate(chosen):
        grey = read_grey8(frame.path)
        for processing in PROCESSINGS:
            for sigma_dn in SIGMAS_DN:
                key = (processing,) if isinstance(processing, str) else (processing.name, processing.quality)
                taken = shots(grey, processing, sigma_dn, dataset.name, frame.name, *key, sigma_dn)
                where = stream(SEED, "coded noise", "places", dataset.name, frame.name)
                squares = places(taken.shape[1:], patches, where)
                about = {"dataset": dataset.name, "codec": described(processing), "added_dn": sigma_dn}
                windows = cut(taken[0], squares)
                estimate, saturated = monitor.noise_estimator.estimate(windows), saturated_fraction(windows)
                for index, truth in enumerate(true_dn(taken, squares)):
                    ends = {
                        name: getattr(estimate, name)[index]
                        for name in ("sigma_dn", "low_dn", "high_dn", "reason", "at_most_dn")
                    }
                    rows.append(about | {"of": "patches", "true_dn": truth, "saturated": saturated[index]} | ends)
                whole = monitor.frame(taken[0].astype(np.float32) / np.float32(255)).noise
                middle = whole.summary
                rows.append(
                    about
                    | {"of": "frames", "true_dn": float(np.median(true_dn(taken, whole.patches))), "saturated": 0.0}
                    | {"sigma_dn": float(middle.value), "low_dn": float(middle.low), "high_dn": float(middle.high)}
                    | {"reason": "" if np.isfinite(middle.value) else reason_of(whole.estimate)}
                    | {"at_most_dn": whole.at_most_dn}
                )
        print(dataset.name, f"{number + 1} of {len(chosen)} frames", flush=True)
    return pd.DataFrame(rows)


def reason_of(estimate: NoiseEstimate) -> str:
    """Why a frame is abstained from: compression where its tiles say so, else their most common reason."""
    counts = Counter(reason for reason in estimate.reason.tolist() if reason)
    return COMPRESSED if counts[COMPRESSED] > np.count_nonzero(~estimate.abstained) else counts.most_common(1)[0][0]


def parse(text: str) -> Dataset:
    """The dataset that NAME=KIND:ROOT names.

    Raises:
        InputError: it is no such text, or there is no such dataset.
    """
    name, kind, root = common.dataset(text)
    return open_dataset(kind, name, root)


def described(processing: Codec | str) -> str:
    """Of a codec or filter, for the record."""
    if isinstance(processing, str):
        return processing
    return processing.name if processing.name == "none" else f"{processing.name} {processing.quality}"


def summarised(table: pd.DataFrame) -> dict[str, Any]:
    """Counts and fractions over some rows."""
    saturated = int((table["saturated"] > MOST_SATURATED).sum())
    table = table[table["saturated"] <= MOST_SATURATED]
    answered = table[np.isfinite(table["sigma_dn"])]
    error = (answered["sigma_dn"] - answered["true_dn"]).abs()
    wrong = error > np.maximum(TOLERANCE * answered["true_dn"], TOLERANCE_DN)
    held = answered["true_dn"].between(answered["low_dn"], answered["high_dn"])
    abstained = table[~np.isfinite(table["sigma_dn"])]
    bounded = abstained[np.isfinite(abstained["at_most_dn"])]

    def fraction(values: pd.Series) -> float | None:
        return round(float(values.mean()), 4) if len(values) else None

    return {
        "count": len(table),
        "saturated": saturated,
        "true_dn": round(float(table["true_dn"].mean()), 3),
        "answered": len(answered),
        "wrong": int(wrong.sum()),
        "wrong_fraction": fraction(wrong),
        "held_fraction": fraction(held),
        "mean_error_dn": round(float(error.mean()), 3) if len(error) else None,
        "compressed_fraction": fraction(abstained["reason"] == COMPRESSED),
        "bounded": len(bounded),
        "bound_dn": round(float(bounded["at_most_dn"].median()), 2) if len(bounded) else None,
        "bound_held_fraction": fraction(bounded["true_dn"] <= bounded["at_most_dn"]),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Store, estimate, compare, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", action="append", default=[], metavar="NAME=KIND:ROOT", help="may be repeated")
    parser.add_argument("--frames", type=common.positive, default=6, help="at most this many of each dataset")
    parser.add_argument("--patches", type=common.positive, default=6, help="of each frame")
    parser.add_argument("--rows", type=Path, metavar="CSV", help="every estimate with its truth, for a closer look")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/coded_noise.json")
    options = parser.parse_args(arguments)
    common.hold_loaded_libraries()
    named = [parse(text) for text in (f"sim=sim:{ROOT / 'data/sim'}", *options.dataset)]
    common.check_datasets("coded_noise", [dataset.name for dataset in named], options.out)
    table = pd.concat([measure(dataset, options.frames, options.patches) for dataset in named], ignore_index=True)
    if options.rows:
        table.to_csv(options.rows, index=False)
    record: dict[str, Any] = {
        str(of): {
            "by_codec": {
                str(codec): {f"{added:g}": summarised(cell) for added, cell in part.groupby("added_dn")}
                for codec, part in kind.groupby("codec", sort=False)
            },
            "by_dataset": {
                str(name): summarised(part[~part["codec"].isin(["none", *FILTERS, *CURVES])])
                for name, part in kind.groupby("dataset", sort=False)
            },
        }
        for of, kind in table.groupby("of", sort=False)
    }
    about = {
        "datasets": [dataset.name for dataset in named],
        "frames_per_dataset": options.frames,
        "patches_per_frame": options.patches,
        "seed": SEED,
    }
    print(common.write("coded_noise", about | record, options.out))


if __name__ == "__main__":
    common.run(main)
