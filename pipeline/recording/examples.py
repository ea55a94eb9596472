"""Noise estimates on single pictures that the project may not keep as data: numbers, and a small crop to look at.

Measured by hand, with ``camera-monitor record examples``. Pictures and weights are named by their SHA-256.

    examples.csv              `pipeline.experiments.pictures.noise_examples.COLUMNS`
    examples_N.png            128 px of each example, as a figure of the report shows them
    examples_provenance.json  source, files, weights, seed
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.camera.processing.codec import Codec
from pipeline.experiments.pictures import noise_examples
from pipeline.experiments.real_noise.records import EXAMPLES_FILE, EXAMPLES_PROVENANCE_FILE, example_crop
from pipeline.noise import real_noise
from pipeline.recording.provenance import sha256_of, weights_of_kinds, write_record
from pipeline.report import style

if TYPE_CHECKING:
    import pandas as pd

KINDS: Mapping[str, tuple[str, Mapping[str, Any]]] = {"cellwise": ("cellwise", {}), "adaptive": ("adaptive", {})}
CROP_PX = 128
JPEG_SIGMA_DN, JPEG_QUALITY = 10.0, 80
VIDEO_SIGMA_DN, VIDEO_FACTOR = 5.0, 23
RESULTS = (EXAMPLES_PROVENANCE_FILE, EXAMPLES_FILE, "examples_[0-9].png")
"""Files of a record, its provenance first; a pattern for the crops."""


def record(real: Path, mean: Path, frames: Sequence[Path], out: Path, source: str, seed: int = 1) -> pd.DataFrame:
    """Measure a photograph, a frame stored as JPEG and one stored as H.264 video, and write everything into a folder.

    Args:
        real: a photograph.
        mean: the mean of many photographs of its scene.
        frames: sharp frames in the order of time.
        out: folder; replaced.
        source: where the pictures come from, their revision and licence, in words.
        seed: root of the noise's stream.

    Returns:
        `pipeline.experiments.pictures.noise_examples.COLUMNS`.

    Raises:
        InputError: a picture is absent or broken.
    """
    import pandas as pd

    jpeg, video = Codec("jpeg", JPEG_QUALITY), Codec("h264", VIDEO_FACTOR)
    examples = [
        noise_examples.photograph(f"Photograph {real.stem.removesuffix(real_noise.REAL)}", real, mean),
        noise_examples.stored(f"{JPEG_SIGMA_DN:g} DN, JPEG {JPEG_QUALITY}", frames[-1:], JPEG_SIGMA_DN, jpeg, seed),
        noise_examples.stored(f"{VIDEO_SIGMA_DN:g} DN, H.264 video", frames, VIDEO_SIGMA_DN, video, seed),
    ]
    estimators = real_noise.estimators(KINDS)
    table = pd.concat([noise_examples.measure(example, estimators) for example in examples], ignore_index=True)
    crops = {
        example_crop(number): style.middle(example.picture, CROP_PX, CROP_PX) for number, example in enumerate(examples)
    }
    about = {
        "source": source,
        "files": sha256_of((real, mean, *frames)),
        "weights": weights_of_kinds(KINDS),
        "jpeg": {"sigma_dn": JPEG_SIGMA_DN, "quality": JPEG_QUALITY},
        "video": {"sigma_dn": VIDEO_SIGMA_DN, "codec": "h264", "constant_rate_factor": VIDEO_FACTOR},
        "seed": seed,
    }
    write_record(out, {EXAMPLES_FILE: table}, about, EXAMPLES_PROVENANCE_FILE, crops)
    return table
