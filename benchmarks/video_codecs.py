"""Noise of frames behind HEVC, VP8, VP9, AV1 and coarse H.264, with and without what their file states: right or wrong.

    python benchmarks/video_codecs.py [--stills] [--dataset NAME=KIND:ROOT ...] [--frames N] [--rows CSV] [--out FILE]

Frames of *Sim* and of the datasets named (as for `benchmarks/coded_noise.py`) get normal noise of 0 to 25 DN, equal in
all colours. The last of three frames of a video is estimated whole, three times: as a picture of which nothing is
known (``unknown``), with the codec's name (``named``), and as the commands do it, which also read the quantiser from
the file (``file``; see `pipeline.condition.video_codecs`). Codecs (`pipeline.camera.processing.codec`) are fine to very
coarse; ``--stills`` takes pictures in HEIF files (x265) and AVIF files (libaom) instead. Truth, here of two shots, and
what is counted, are those of `benchmarks/coded_noise.py`. Frames are cut to their middle `LARGEST_PX`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
import pillow_heif  # noqa: E402
from PIL import Image  # noqa: E402

from benchmarks import coded_noise  # noqa: E402
from pipeline import noise  # noqa: E402
from pipeline.camera.processing.codec import Codec, video_file  # noqa: E402
from pipeline.cli.frames.pictures import read  # noqa: E402
from pipeline.condition import noise_of_frame  # noqa: E402
from pipeline.datasets.decoding.pictures import read_grey8  # noqa: E402
from pipeline.datasets.decoding.video_coding import UNKNOWN, Coding  # noqa: E402
from pipeline.datasets.selection import evenly_spread  # noqa: E402
from pipeline.streams import stream  # noqa: E402

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.datasets.dataset import Dataset


CODECS = (
    *(Codec("hevc", factor) for factor in (18, 23, 28, 33, 38, 43)),
    *(Codec("vp8", step) for step in (10, 30, 50, 63)),
    *(Codec("vp9", factor) for factor in (20, 31, 40, 50)),
    *(Codec("av1", factor) for factor in (25, 35, 45, 55)),
    *(Codec("h264", factor) for factor in (28, 38, 43, 48)),
)


class Still(NamedTuple):
    """A format of picture files, by its suffix, and Pillow's quality."""

    name: str
    quality: int


STILLS = (
    *(Still("heic", quality) for quality in (20, 35, 50, 65, 80, 90)),
    *(Still("avif", quality) for quality in (20, 40, 60, 75, 90)),
)
SIGMAS_DN = (0.0, 2.0, 5.0, 10.0, 25.0)
SHOTS = 2
LARGEST_PX = (600, 1224)


def middle(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The middle of a frame, with even sides of at most `LARGEST_PX`."""
    sides = [min(side, most) // 2 * 2 for side, most in zip(frame.shape, LARGEST_PX, strict=True)]
    top, left = ((whole - side) // 2 for whole, side in zip(frame.shape, sides, strict=True))
    return np.ascontiguousarray(frame[top : top + sides[0], left : left + sides[1]])


def shots(
    frame: NDArray[np.uint8], codec: Codec | Still, sigma_dn: float, *key: str
) -> tuple[NDArray[np.uint8], Coding]:
    """Shots of one scene as commands read them from video or picture files.

    Args:
        frame: (H, W) grey levels, without added noise.
        codec: of the videos, of which each shot is the last frame, or of the pictures.
        sigma_dn: of the normal noise added before.
        key: of the random stream.

    Returns:
        (`SHOTS`, H, W), each with its own noise, and how the first was stored.
    """
    generator, taken = stream(coded_noise.SEED, "video codecs", *key, codec.name, codec.quality, sigma_dn), []
    for _ in range(SHOTS):
        with tempfile.TemporaryDirectory() as folder:
            if isinstance(codec, Still):
                path = Path(folder) / f"shot.{codec.name}"
                picture = Image.fromarray(coded_noise.coloured(coded_noise.noisy(frame, sigma_dn, generator)))
                writer = pillow_heif.from_pillow(picture) if codec.name == "heic" else picture
                writer.save(path, quality=codec.quality)
            else:
                path, count = Path(folder) / "shot.mkv", coded_noise.FRAMES_BEFORE + 1
                greys = [coded_noise.noisy(frame, sigma_dn, generator) for _ in range(count)]
                path.write_bytes(video_file([coded_noise.coloured(grey) for grey in greys], codec.name, codec.quality))
            *_, (_, image, coding) = read(path)
        taken.append((np.rint(image * 255).astype(np.uint8), coding))
    return np.stack([image for image, _ in taken]), taken[0][1]


def measure(dataset: Dataset, frames: int, codecs: Sequence[Codec | Still]) -> pd.DataFrame:
    """Estimates of frames of a dataset, each with its truth, one row each."""
    estimator, rows = noise.create(noise.DEFAULT), []
    chosen = evenly_spread(dataset.frames(), frames)
    for number, frame in enumerate(chosen):
        grey = middle(read_grey8(frame.path))
        for codec in codecs:
            for sigma_dn in SIGMAS_DN:
                taken, stored = shots(grey, codec, sigma_dn, dataset.name, frame.name)
                image = taken[0].astype(np.float32) / np.float32(255)
                codings = {"unknown": UNKNOWN, "named": Coding(stored.codec), "file": stored}
                states = {
                    known: noise_of_frame(estimator, image, codec=coding.codec, quantiser=coding.quantiser)
                    for known, coding in codings.items()
                }
                truth = float(np.median(coded_noise.true_dn(taken, states["named"].patches)))
                for known, state in states.items():
                    value = float(state.summary.value)
                    rows.append(
                        {"dataset": dataset.name, "codec": f"{codec.name} {codec.quality}", "added_dn": sigma_dn}
                        | {"as": known, "true_dn": truth, "quantiser": stored.quantiser}
                        | {"sigma_dn": value, "low_dn": float(state.summary.low), "high_dn": float(state.summary.high)}
                        | {"reason": "" if np.isfinite(value) else coded_noise.reason_of(state.estimate)}
                        | {"at_most_dn": state.at_most_dn, "saturated": 0.0}
                    )
        print(dataset.name, f"{number + 1} of {len(chosen)} frames", flush=True)
    return pd.DataFrame(rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Code, estimate, compare, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", action="append", default=[], metavar="NAME=KIND:ROOT", help="may be repeated")
    parser.add_argument("--stills", action="store_true", help="pictures in HEIF and AVIF files instead of videos")
    parser.add_argument("--frames", type=common.positive, default=4, help="at most this many of each dataset")
    parser.add_argument("--rows", type=Path, metavar="CSV", help="every estimate with its truth, for a closer look")
    parser.add_argument(
        "--out", type=Path, help="JSON file, by default benchmarks/results/video_codecs.json, or still_codecs.json"
    )
    options = parser.parse_args(arguments)
    common.hold_loaded_libraries()
    named = [coded_noise.parse(text) for text in (f"sim=sim:{ROOT / 'data/sim'}", *options.dataset)]
    name, codecs = ("still_codecs", STILLS) if options.stills else ("video_codecs", CODECS)
    common.check_datasets(name, [dataset.name for dataset in named], options.out)
    table = pd.concat([measure(dataset, options.frames, codecs) for dataset in named], ignore_index=True)
    if options.rows:
        table.to_csv(options.rows, index=False)
    record = {
        str(codec): {
            f"{added:g}": {str(known): coded_noise.summarised(rows) for known, rows in cell.groupby("as", sort=False)}
            for added, cell in part.groupby("added_dn")
        }
        for codec, part in table.groupby("codec", sort=False)
    }
    about = {
        "datasets": [dataset.name for dataset in named],
        "frames_per_dataset": options.frames,
        "seed": coded_noise.SEED,
    }
    print(common.write(name, about | {"by_codec": record}, options.out))


if __name__ == "__main__":
    common.run(main)
