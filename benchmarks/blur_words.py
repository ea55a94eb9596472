"""How often the words of the monitor about blur are right and wrong: of sharp frames, and of blurred ones.

Usage::

    python benchmarks/blur_words.py --realdata FOLDER [--frames N] [--out FILE]

Sharp frames of recorded datasets are graded (`pipeline.condition.verdict`) without and with white noise of 3, 10 and 25
DN, as they are and stored as JPEG of quality 80, and through a simulated telephone at three ISO settings, which leaves
noise of about 3, 10 and 25 DN. All blur that is stated there is wrong, as far as the frames are sharp: the lower edge
of Udacity's is the bonnet of the car, out of focus.

The same frames are blurred by a disc of defocus or a line of motion of 5, 9 and 15 px, along rows and columns in turn:
the left half, a disc of about a third of the smaller side in radius, or all of the frame. Noise of 0, 3 and 10 DN
follows, or the telephone. *Noticed* are those that are stated to be partly blurred or graded as moderately blurred or
worse; 5 px are at the border to slightly blurred.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import cv2  # noqa: E402
import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from pipeline.camera import psf  # noqa: E402
from pipeline.camera.blur import blur  # noqa: E402
from pipeline.camera.processing import presets  # noqa: E402
from pipeline.camera.processing.codec import jpeg  # noqa: E402
from pipeline.camera.processing.delivered import linear_scene  # noqa: E402
from pipeline.camera.processing.develop import grey  # noqa: E402
from pipeline.camera.quantise import to_8bit  # noqa: E402
from pipeline.condition import Condition, ConditionMonitor  # noqa: E402
from pipeline.condition.verdict import AXES, BAD_BLUR, blurred_fraction, directed, grade, is_partly_blurred  # noqa: E402
from pipeline.datasets.decoding.pictures import SUFFIXES, read_grey8  # noqa: E402
from pipeline.datasets.selection import evenly_spread  # noqa: E402
from pipeline.errors import InputError  # noqa: E402
from pipeline.streams import stream  # noqa: E402

Picture = NDArray[np.float32]
Counts = dict[str, int]

PICTURES = {
    "kitti": "kitti/training/image_2/*", "kitti_more": "kitti_more/training/image_2/*", "udacity": "udacity/*/*",
    "sim_authors": "sim_authors/images/*", "pennfudan": "pennfudan/PNGImages/*", "cc": "cc_noise/*_mean.*",
    "polyu": "polyu/*_mean.*",
}  # fmt: skip
"""Datasets -> their sharp pictures, of CC and PolyU the means of many shots."""
SEED = 1
WHITE_DN = (0, 3, 10, 25)
JPEG_QUALITY = 80
CAMERA, ISO = "phone", (400, 11_000, 102_400)
KINDS, SIZES_PX, BLURRED_DN = ("defocus", "linear_motion"), (5, 9, 15), (0, 3, 10)
PARTS = ("left", "disc", "whole")
DISC_RADIUS, EDGE_PX = 0.35, 8.0  # of the smaller side; width of the border between sharp and blurred
COUNTED = ("pictures", "partly", "certain", "noticed", "direction", "right_direction", "motion", "other_cause")


def words(condition: Condition, axis: str = "") -> Counts:
    """What the monitor states of the blur of a frame, each 0 or 1.

    Args:
        condition: of the frame.
        axis: of the motion in it, one of `AXES`; empty for none.

    Returns:
        `COUNTED`: ``partly`` blurred; ``certain``, moderately blurred or worse without an uncertain grade; ``noticed``,
        partly blurred or moderately or worse; a ``direction``, and one that is that of the motion; the cause:
        ``motion``, or ``other_cause``.
    """
    estimate, summary = condition.blur.estimate, condition.mtf
    grades = grade(np.nan, summary.value, ends=(summary.low, summary.high), shares=directed(estimate.mtf))
    partly = is_partly_blurred(grades.blur, blurred_fraction(estimate.mtf, estimate.high))
    bad = grades.blur in BAD_BLUR
    motion = bool(grades.blur_cause) and bool(grades.direction)
    values = (
        True, partly, bad and not grades.blur_range, partly or bad, bool(grades.direction),
        bool(axis) and grades.direction == axis, motion, bool(grades.blur_cause) and not motion,
    )  # fmt: skip
    return {name: int(value) for name, value in zip(COUNTED, values, strict=True)}


def sharp(frame: Picture, colours: Picture, name: str) -> Iterator[tuple[str, Picture]]:
    """Condition and picture, in [0, 1], of a sharp frame (H, W) whose colours are (H, W, 3)."""
    for sigma_dn in WHITE_DN:
        noisy = _noisy(frame, sigma_dn, name)
        yield f"{sigma_dn} DN", noisy
        stored = jpeg(np.repeat(to_8bit(noisy)[..., None], 3, axis=2), JPEG_QUALITY)
        yield f"{sigma_dn} DN, JPEG {JPEG_QUALITY}", _unit(grey(stored))
    for iso in ISO:
        yield f"{CAMERA}, ISO {iso}", _delivered(colours, iso, name)


def blurred(frame: Picture, colours: Picture, name: str, axis: str) -> Iterator[tuple[str, Picture]]:
    """Condition and picture of a frame that is blurred in part or as a whole; motion is along an axis."""
    masks = {part: mask(frame.shape, part, name) for part in PARTS}
    planes = np.ascontiguousarray(np.moveaxis(colours, 2, 0))[:, None]
    for kind in KINDS:
        for size_px in SIZES_PX:
            angle_deg = 90.0 * AXES.index(axis)
            kernel = psf.create(kind, size_px, angle_deg, stream(SEED, "blur words", kind, size_px, angle_deg))
            soft, soft_colours = np.asarray(blur(frame[None, None], kernel))[0, 0], np.asarray(blur(planes, kernel))
            for part, weight in masks.items():
                mixed = weight * soft + (1 - weight) * frame
                key = f"{part}, {kind} {size_px} px"
                for sigma_dn in BLURRED_DN:
                    yield f"{key}, {sigma_dn} DN", _noisy(mixed, sigma_dn, f"{name} {key}")
                mixed_colours = np.moveaxis(weight * soft_colours + (1 - weight) * planes, 0, -1)[0]
                yield f"{key}, {CAMERA}, ISO {ISO[0]}", _delivered(mixed_colours, ISO[0], f"{name} {key}")


def mask(shape: Sequence[int], part: str, name: str) -> Picture:
    """(H, W) weight of the blurred picture, 0 to 1: the left half, a disc at a drawn place, or all of it."""
    height, width = shape
    y, x = np.mgrid[:height, :width]
    if part == "whole":
        return np.ones((height, width), np.float32)
    inside_px = width / 2 - x
    if part == "disc":
        radius_px = DISC_RADIUS * min(height, width)
        draws = stream(SEED, "blur words", "disc", name)
        across, down = (draws.uniform(radius_px, side - radius_px) for side in (width, height))
        inside_px = radius_px - np.hypot(x - across, y - down)
    return np.clip(inside_px / EDGE_PX + 0.5, 0, 1).astype(np.float32)


def counted(monitor: ConditionMonitor, files: Sequence[Path]) -> dict[str, dict[str, Counts]]:
    """Counts of words over frames: ``sharp`` and ``blurred`` -> condition -> `COUNTED`."""
    counts: dict[str, dict[str, Counts]] = {"sharp": {}, "blurred": {}}
    for number, file in enumerate(files):
        frame, colours = _unit(read_grey8(file)), _colours(file)
        axis = AXES[number % 2]
        for group, pictures in (
            ("sharp", sharp(frame, colours, file.name)),
            ("blurred", blurred(frame, colours, file.name, axis)),
        ):
            for condition, picture in pictures:
                moved = axis if "linear_motion" in condition else ""
                total = counts[group].setdefault(condition, dict.fromkeys(COUNTED, 0))
                for key, value in words(monitor.frame(picture), moved).items():
                    total[key] += value
    return counts


def summed(results: Mapping[str, Mapping[str, Mapping[str, Counts]]]) -> dict[str, dict[str, Counts]]:
    """Counts of all datasets together."""
    totals: dict[str, dict[str, Counts]] = {}
    for groups in results.values():
        for group, conditions in groups.items():
            for condition, counts in conditions.items():
                total = totals.setdefault(group, {}).setdefault(condition, dict.fromkeys(COUNTED, 0))
                for key in COUNTED:
                    total[key] += counts[key]
    return totals


def sharp_pictures(folder: Path, most: int) -> dict[str, list[Path]]:
    """Datasets that a folder holds -> an even selection of at most so many of their sharp pictures.

    Raises:
        InputError: it holds none of them.
    """
    files_of = {
        name: [path for path in sorted(folder.glob(pattern)) if path.suffix.lower() in SUFFIXES]
        for name, pattern in PICTURES.items()
    }
    chosen = {name: evenly_spread(files, most) for name, files in files_of.items() if files}
    if not chosen:
        raise InputError(f"--realdata {folder}: no pictures; expected one of {', '.join(PICTURES.values())} there")
    return chosen


def _colours(file: Path) -> Picture:
    stored = cv2.imread(str(file), cv2.IMREAD_COLOR)
    if stored is None:
        raise InputError(f"{file}: OpenCV cannot read its colours; expected a picture of 8 bits")
    return _unit(np.asarray(stored[..., ::-1], np.uint8))


def _noisy(frame: Picture, sigma_dn: float, name: str) -> Picture:
    noise = stream(SEED, "blur words", "white", name, sigma_dn).normal(0, sigma_dn / 255, frame.shape)
    noisy: Picture = frame + noise.astype(np.float32)
    return _unit(to_8bit(noisy))


def _delivered(colours: Picture, iso: int, name: str) -> Picture:
    camera = presets.named(CAMERA).at_iso(iso)
    return _unit(grey(camera.shoot(linear_scene(colours), stream(SEED, "blur words", CAMERA, name, iso))))


def _unit(levels: NDArray[np.integer]) -> Picture:
    return levels.astype(np.float32) / np.float32(255)


def main(given: Sequence[str] | None = None) -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--realdata", type=Path, required=True, help="folder with kitti, udacity and others")
    parser.add_argument("--frames", type=common.positive, default=8, help="of each dataset at most")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args(given)
    datasets = sharp_pictures(options.realdata, options.frames)
    common.check_datasets("blur_words", datasets, options.out)
    common.hold_loaded_libraries()
    monitor = ConditionMonitor(noise_name="immerkaer")  # quick; words about blur do not depend on noise
    results = {}
    for name, files in datasets.items():
        results[name] = counted(monitor, files)
        print(f"{name}: {len(files)} frames", flush=True)
    totals = summed(results)
    print(f"{'condition':44}" + "".join(f"{name:>16}" for name in COUNTED))
    for conditions in totals.values():
        for condition, counts in conditions.items():
            print(f"{condition:44}" + "".join(f"{counts[name]:16}" for name in COUNTED))
    about = {"datasets": list(datasets), "frames": options.frames, "jpeg_quality": JPEG_QUALITY, "iso": ISO}
    record = {**about, "totals": totals, "results": results}
    print(f"written to {common.write('blur_words', record, options.out)}")


if __name__ == "__main__":
    common.run(main)
