"""Noise of frames behind HEVC, VP9 and AV1, with and without the codec's name: right or wrong.

    python benchmarks/video_codecs.py [--dataset NAME=KIND:ROOT ...] [--frames N] [--out FILE]

Frames of *Sim* and of the datasets named (as for `benchmarks/coded_noise.py`) get normal noise of 0 to 25 DN, equal in
all colours. The last of three frames of a video is estimated whole, twice: as a picture of which nothing is known
(``unknown``), and as the commands do it, which know the codec from its file (``named``; see
`pipeline.condition.video_codecs`). Truth, and what is counted, are those of `benchmarks/coded_noise.py`. Frames are cut
to their middle `LARGEST_PX`.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import av  # noqa: E402
import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

from benchmarks import coded_noise  # noqa: E402
from pipeline import noise  # noqa: E402
from pipeline.condition import noise_of_frame  # noqa: E402
from pipeline.datasets.pictures import read_grey8  # noqa: E402
from pipeline.datasets.selection import evenly_spread  # noqa: E402
from pipeline.streams import stream  # noqa: E402

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.datasets.dataset import Dataset


@dataclass(frozen=True)
class VideoCodec:
    """How videos are coded.

    Attributes:
        name: of the codec, as FFmpeg has it.
        encoder: likewise.
        factor: constant rate factor.
        options: of the encoder.
    """

    name: str
    encoder: str
    factor: int
    options: tuple[tuple[str, str], ...]


X265 = (("x265-params", "log-level=none:pools=none:frame-threads=1"),)
CODECS = (
    *(VideoCodec("hevc", "libx265", factor, X265) for factor in (23, 28, 33)),
    VideoCodec("vp9", "libvpx-vp9", 31, (("b", "0"), ("deadline", "realtime"), ("cpu-used", "6"))),
    VideoCodec("av1", "libsvtav1", 35, (("preset", "8"),)),
)
SIGMAS_DN = (0.0, 2.0, 5.0, 10.0, 25.0)
SHOTS, FRAMES = 2, 3
LARGEST_PX = (600, 1224)
SEED = 1


def last_of(pictures: Sequence[NDArray[np.uint8]], codec: VideoCodec) -> NDArray[np.uint8]:
    """The last picture (H, W), even sides, of a video of these as it comes back; grey is the mean of the colours."""
    height, width = pictures[0].shape
    file = io.BytesIO()
    with av.open(file, "w", format="matroska") as container:
        track: Any = container.add_stream(
            codec.encoder, rate=25, options={"crf": str(codec.factor), **dict(codec.options)}
        )
        track.width, track.height, track.pix_fmt = width, height, "yuv420p"
        track.codec_context.thread_count = 1
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(np.repeat(picture[..., None], 3, axis=2), format="rgb24")
            container.mux(track.encode(frame))
        container.mux(track.encode())
    file.seek(0)
    with av.open(file, "r") as stored:
        decoded = [frame.to_ndarray(format="rgb24") for frame in stored.decode(video=0)]
    return np.rint(decoded[-1].mean(axis=2)).astype(np.uint8)


def shots(frame: NDArray[np.uint8], codec: VideoCodec, sigma_dn: float, *key: str) -> NDArray[np.uint8]:
    """(SHOTS, H, W) the same scene from videos of their own, each frame of which has its own noise."""
    generator = stream(SEED, "video codecs", *key, codec.name, codec.factor, sigma_dn)

    def noisy() -> NDArray[np.uint8]:
        return np.clip(np.rint(frame + sigma_dn * generator.standard_normal(frame.shape)), 0, 255).astype(np.uint8)

    return np.stack([last_of([noisy() for _ in range(FRAMES)], codec) for _ in range(SHOTS)])


def middle(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The middle of a frame, with even sides of at most `LARGEST_PX`."""
    sides = [min(side, most) // 2 * 2 for side, most in zip(frame.shape, LARGEST_PX, strict=True)]
    top, left = ((whole - side) // 2 for whole, side in zip(frame.shape, sides, strict=True))
    return np.ascontiguousarray(frame[top : top + sides[0], left : left + sides[1]])


def measure(dataset: Dataset, frames: int) -> pd.DataFrame:
    """Estimates of frames of a dataset, each with its truth, one row each."""
    estimator, rows = noise.create(noise.DEFAULT), []
    chosen = evenly_spread(dataset.frames(), frames)
    for number, frame in enumerate(chosen):
        grey = middle(read_grey8(frame.path))
        for codec in CODECS:
            for sigma_dn in SIGMAS_DN:
                taken = shots(grey, codec, sigma_dn, dataset.name, frame.name)
                image = taken[0].astype(np.float32) / np.float32(255)
                states = {
                    known: noise_of_frame(estimator, image, codec=name)
                    for known, name in (("unknown", ""), ("named", codec.name))
                }
                truth = float(np.median(coded_noise.true_dn(taken, states["named"].patches)))
                for known, state in states.items():
                    value = float(state.summary.value)
                    rows.append(
                        {"codec": f"{codec.name} {codec.factor}", "added_dn": sigma_dn, "as": known, "true_dn": truth}
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
    parser.add_argument("--frames", type=common.positive, default=4, help="at most this many of each dataset")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/video_codecs.json")
    options = parser.parse_args(arguments)
    common.hold_loaded_libraries()
    named = [coded_noise.parse(text) for text in (f"sim=sim:{ROOT / 'data/sim'}", *options.dataset)]
    common.check_datasets("video_codecs", [dataset.name for dataset in named], options.out)
    table = pd.concat([measure(dataset, options.frames) for dataset in named], ignore_index=True)
    record = {
        str(codec): {
            f"{added:g}": {str(known): coded_noise.summarised(rows) for known, rows in cell.groupby("as", sort=False)}
            for added, cell in part.groupby("added_dn")
        }
        for codec, part in table.groupby("codec", sort=False)
    }
    about = {"datasets": [dataset.name for dataset in named], "frames_per_dataset": options.frames, "seed": SEED}
    print(common.write("video_codecs", about | {"by_codec": record}, options.out))


if __name__ == "__main__":
    common.run(main)
