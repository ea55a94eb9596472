"""The paper's network gives the same bytes by AVX2 and by AVX-512, which only a stage's process is allowed."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from pipeline import processor
from pipeline.blur.networks import wide_convolutions

PROGRAM = """
import hashlib, sys
from pipeline.blur.networks import wide_convolutions
print(wide_convolutions.allow())
import numpy as np
import torch
torch.set_num_threads(1)
from pipeline import blur
patches = np.random.default_rng(3).random((8, 1, 192, 192)).astype(np.float32)
estimator = blur.create("cnn")
single, several = estimator.estimate(patches[:3]), estimator.estimate_sequences(patches.reshape(2, 4, 1, 192, 192))
print(hashlib.sha256(single.mtf.tobytes() + several.mtf.tobytes()).hexdigest())
"""


def run(*arguments: str) -> list[str]:
    command = [sys.executable, "-c", PROGRAM, *arguments]
    return subprocess.check_output(command, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"}).split()


@pytest.mark.skipif("avx512f" not in processor.cpu_features(), reason="the processor has no AVX-512")
@pytest.mark.skipif(processor.status() != processor.PINNED, reason="libraries are not pinned")
def test_the_paper_network_gives_the_same_bytes_by_avx2_and_avx512() -> None:
    (kept, narrow), (allowed, wide) = run(), run("--params")
    assert (kept, allowed) == ("False", "True")
    assert narrow == wide


def test_a_process_that_is_no_stage_keeps_its_pins() -> None:
    before = os.environ.get(wide_convolutions.VARIABLE)
    assert not wide_convolutions.allow()
    assert os.environ.get(wide_convolutions.VARIABLE) == before
