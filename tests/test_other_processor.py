"""The same bytes on another processor: blur, noise and deconvolution estimates and a rendered star.

The emulated processor is a Haswell (Intel, AVX2, no AVX-512) under qemu's user mode.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from benchmarks.processors import INTERPRETER, command, environment
from pipeline import processor

ROOT = Path(__file__).resolve().parents[1]
QEMU = shutil.which("qemu-x86_64")
PROGRAM = """
from pipeline import blur, noise, processor  # before NumPy, so that it is pinned
import hashlib, json, sys
import numpy as np
from pipeline.blur.spectral_and_pixels import SpectralAndPixels
from pipeline.scenes.star import render_star
from pipeline.streams import stream

generator = stream(1, "other processor")
yy, xx = np.mgrid[:192, :192]
patch = np.full((192, 192), 0.5)
for _ in range(60):
    x, y, radius, level = generator.random(4) * (192, 192, 40, 1)
    patch[(xx - x) ** 2 + (yy - y) ** 2 < radius**2] = level
patch = (patch + np.roll(patch, 1, 1) + np.roll(patch, 2, 1)) / 3 + 0.01 * generator.standard_normal(patch.shape)
patch = (np.rint(255 * patch.clip(0.02, 0.98)) / 255).astype(np.float32)[None, None]


def of_cells(name):
    level, cells = noise.create(name).measure_cells(patch[:, 0, :128, :128], np.array([""], object))
    return np.concatenate([level.sigma_dn, level.low_dn, level.high_dn, cells.ravel()])


answers = {
    "spectral": blur.create("spectral").estimate(patch).mtf,
    "pixels": SpectralAndPixels(blur.create("spectral")).estimate(np.concatenate([patch, patch[:, :, ::-1]])).members,
    "cellwise": of_cells("cellwise"),
    "correlated": of_cells("correlated"),
    "pca": noise.create("pca").estimate(patch[..., :128, :128]).sigma_dn,
    "star": render_star(1, width_px=96, height_px=64, periods=12),
    "gbb": blur.create("gbb", mode="fast").estimate(patch).mtf,
}
assert all(np.isfinite(answer).all() for answer in answers.values())
print(json.dumps({name: hashlib.sha256(answer.tobytes()).hexdigest() for name, answer in answers.items()}))
"""


def answers(words):
    unpinned = {name: value for name, value in os.environ.items() if name not in processor.AVX512_PINS}
    ran = subprocess.run(words, env=unpinned | environment(ROOT), cwd=ROOT, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout.splitlines()[-1])


def emulated():
    """Answers of the emulated Haswell; where the emulator itself crashed there is none, and it starts again, twice."""
    for _ in range(2):
        try:
            return answers(command(QEMU, "Haswell", PROGRAM))
        except AssertionError as crash:
            if "qemu: uncaught target signal" not in str(crash):
                raise
    return answers(command(QEMU, "Haswell", PROGRAM))


@pytest.mark.full("instruction by instruction the answers take half a minute")
@pytest.mark.skipif(QEMU is None, reason="qemu-x86_64 is absent: apt-get install qemu-user")
@pytest.mark.skipif(not processor.pins(processor.cpu_features()), reason="the processor has no AVX2")
def test_answers_are_the_same_bytes_on_an_emulated_haswell():
    assert emulated() == answers([INTERPRETER, "-c", PROGRAM])
