"""Settings of the camera to noise and blur, and back."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.curves.calibration import PAPER, Calibration, calibrate, motion_mtf, size_for_mtf_px
from pipeline.errors import InputError
from pipeline.streams import stream

PRINTED = Path(__file__).resolve().parents[2] / "data" / "paper" / "worked_examples.csv"


def test_the_papers_axes() -> None:
    """ISO 100 is sigma 1 DN; 1 ms moves by a pixel and leaves the MTF at 1."""
    np.testing.assert_allclose(PAPER.sigma_dn([100, 500, 2500]), [1, 5, 25])
    np.testing.assert_allclose(PAPER.iso([1, 25]), [100, 2500])
    assert PAPER.size_px(21) == 21 and PAPER.exposure_ms(21) == 21
    assert PAPER.mtf(1.0) == 1.0


def test_the_mtf_of_a_length_falls_and_comes_back() -> None:
    values = [motion_mtf(size) for size in (1, 3, 7, 11, 15)]
    assert all(np.diff(values) < 0)
    for size, value in zip((3, 7, 11, 15), values[1:], strict=True):
        assert size_for_mtf_px(value) == pytest.approx(size, abs=1e-3)
    assert size_for_mtf_px(1.0) == 1.0
    camera = Calibration(0.05, 0.76)
    assert camera.mtf(float(camera.exposure_ms(size_for_mtf_px(0.8)))) == pytest.approx(0.8, abs=1e-6)


def test_the_papers_worked_examples() -> None:
    """It prints an estimated MTF beside lengths of 3, 7, 12 and 15 px; measured here: at most 0.025 apart."""
    rows = pd.read_csv(PRINTED).dropna(subset=["blur_px"])
    assert len(rows) == 5
    for length, printed in zip(rows.blur_px, rows["mtf_at_0.1"], strict=True):
        assert motion_mtf(length) == pytest.approx(printed, abs=0.03)


def test_constants_are_recovered_with_their_deviation() -> None:
    """400 calibrations of six noisy measurements each: centred, and as scattered as they say."""
    generator = stream(1, "calibration")
    iso, exposure = np.array([100.0, 200, 400, 800, 1600, 3200]), np.array([1.0, 2, 4, 8, 16])
    results = [
        calibrate(
            iso, 0.012 * iso + generator.normal(0, 0.5, 6), exposure, 0.76 * exposure + generator.normal(0, 0.3, 5)
        )
        for _ in range(400)
    ]
    first, second = np.array([one.lambda1 for one in results]), np.array([one.lambda2 for one in results])
    assert first.mean() == pytest.approx(0.012, rel=0.005) and second.mean() == pytest.approx(0.76, rel=0.005)
    assert np.sqrt(np.mean([one.std_dev1**2 for one in results])) == pytest.approx(first.std(), rel=0.12)
    assert np.sqrt(np.mean([one.std_dev2**2 for one in results])) == pytest.approx(second.std(), rel=0.12)
    assert math.isnan(PAPER.std_dev1)


def test_the_deviation_of_two_measurements_rests_on_one_degree_of_freedom() -> None:
    """Y = 1, 3 at x = 1, 2: slope 7 / 5, residuals -.4 and .2, of which one is free."""
    made = calibrate([1.0, 2.0], [1.0, 3.0], [1.0, 2.0], [2.0, 4.0])
    assert (made.lambda1, made.std_dev1) == pytest.approx((1.4, np.sqrt((0.4**2 + 0.2**2) / 5)))
    assert (made.lambda2, made.std_dev2) == pytest.approx((2.0, 0.0))


def test_bad_input_is_named() -> None:
    for arguments, words in (
        (([100], [1], [1, 2], [1, 2]), "iso, sigma_dn: expected two lists"),
        (([100, 200], [1, 2], [1, 2], [1]), "exposure_ms, size_px: expected two lists"),
        (([100, -200], [1, 2], [1, 2], [1, 2]), "positive settings"),
        (([100, 200], [1, np.nan], [1, 2], [1, 2]), "finite"),
        (([100, 200], [-1, -2], [1, 2], [1, 2]), "sigma_dn does not grow with iso"),
    ):
        with pytest.raises(InputError, match=words):
            calibrate(*arguments)
    with pytest.raises(InputError, match="lambda2"):
        Calibration(0.01, 0.0)
    with pytest.raises(InputError, match="less than straight motion leaves"):
        size_for_mtf_px(0.1)
    with pytest.raises(InputError, match=r"\(0, 1\]"):
        size_for_mtf_px(1.2)
