"""Noise of real cameras: pairs are read completely, the truth is the noise, what the mean explains is removed."""

import cv2
import numpy as np
import pandas as pd
import pytest

from pipeline.camera.processing import presets, temporal_noise
from pipeline.camera.processing.delivered import linear_scene
from pipeline.camera.processing.develop import grey
from pipeline.errors import InputError
from pipeline.noise import real_noise
from pipeline.streams import stream

SIZE = 256


def scene(name):
    """A smooth coloured picture with an edge, [0, 1]."""
    field = cv2.GaussianBlur(stream(1, "real noise", name).random((SIZE, SIZE, 3)).astype(np.float32), (0, 0), 12)
    picture = 0.45 + 4 * (field - field.mean())
    picture[:, SIZE // 2 :] += 0.15
    return np.clip(picture, 0.05, 0.95)


def write_pair(folder, name, iso=1600, shots=12):
    camera = presets.named("reflex").at_iso(iso)
    generator = stream(1, "real noise shots", name)
    greys = np.stack([grey(camera.shoot(linear_scene(scene(name)), generator)) for _ in range(shots)])
    cv2.imwrite(str(folder / f"{name}_real.png"), greys[0])
    cv2.imwrite(str(folder / f"{name}_mean.png"), np.rint(greys[1:].mean(axis=0)).astype(np.uint8))
    return temporal_noise.measure(greys)


def test_truth_and_estimates_of_a_simulated_camera(tmp_path):
    truth = {name: write_pair(tmp_path, name) for name in ("a", "b")}
    result = real_noise.pairs(tmp_path)
    assert [pair.name for pair in result] == ["a", "b"]
    kinds = {name: real_noise.ESTIMATORS[name] for name in ("pca", "pca_stride_2")}
    table = pd.concat([real_noise.measure(pair, real_noise.estimators(kinds)) for pair in result], ignore_index=True)
    assert list(table.columns) == list(real_noise.COLUMNS) and len(table) == 2 * 2 * 4
    for name, noise in truth.items():
        rows = table[table["picture"] == name]
        rms = np.sqrt((rows["cleaned_sigma_dn"] ** 2).mean())
        # The mean of 11 shots has 1/11 of the variance, and is rounded.
        assert rms == pytest.approx(np.sqrt(noise.sigma_dn**2 * 12 / 11 + 1 / 12), rel=0.04)
        assert rows["true_correlation"].mean() == pytest.approx(noise.correlation, abs=0.06)
        assert (rows["cleaned_sigma_dn"] <= rows["true_sigma_dn"] + 1e-9).all()
        white_rms = np.sqrt((rows["true_white_sigma_dn"] ** 2).mean())
        assert white_rms == pytest.approx(np.sqrt(noise.white_sigma_dn**2 * 12 / 11 + 1 / 12), rel=0.1)
    summary = real_noise.summarise(table).set_index("estimator")
    assert summary.loc["pca_stride_2", "true_mae_dn"] < 0.5 * summary.loc["pca", "true_mae_dn"]
    assert (summary["answered_fraction"] == 1).all() and (summary["pictures"] == 2).all()
    assert summary.loc["pca", "mean_picture_sigma_dn"] < summary.loc["pca", "mean_sigma_dn"]


def test_cleaning_removes_drift_and_misregistration_and_keeps_noise():
    mean = 255 * cv2.GaussianBlur(scene("clean"), (0, 0), 1.5)[..., 0].astype(np.float64)
    noise = stream(1, "real noise", "clean").normal(0, 3, mean.shape)
    shifted = np.roll(mean, 1, axis=1) - mean
    shifted[:, 0] = 0
    residual = real_noise.cleaned(0.05 * mean + shifted + noise, mean)
    assert (0.05 * mean + shifted + noise).std() > 1.1 * noise.std()
    assert residual.std() == pytest.approx(noise.std(), rel=0.01)


def test_cleaning_removes_a_difference_in_sharpness():
    """The photograph was focused a little otherwise than the others, whose mean it is compared with."""
    mean = 255 * cv2.GaussianBlur(stream(1, "real noise", "focus").random((SIZE, SIZE)), (0, 0), 3)
    noise = stream(1, "real noise", "focus noise").normal(0, 0.5, mean.shape)
    softer = cv2.GaussianBlur(mean, (0, 0), 1.0) - mean
    assert softer.std() > noise.std()
    assert real_noise.cleaned(softer + noise, mean).std() == pytest.approx(noise.std(), rel=0.05)


@pytest.mark.parametrize("sigma_px", [0.0, 1.0])
def test_the_white_part_is_that_of_many_shots(sigma_px):
    """White noise of 5 DN, and noise smoothed by a Gaussian beside white noise of 2 DN, whose white part is that."""
    shots = stream(1, "white part", sigma_px).normal(0, 5, (16, 128, 128))
    if sigma_px:
        shots = np.stack([cv2.GaussianBlur(shot, (0, 0), sigma_px) for shot in shots])
        shots += stream(1, "white part", "beside").normal(0, 2, shots.shape)
    single = np.mean([real_noise.white_sigma_dn(shot) for shot in shots])
    assert single == pytest.approx(temporal_noise.measure(shots).white_sigma_dn, rel=0.08)
    assert single == pytest.approx(2 if sigma_px else 5, rel=0.12)
    assert real_noise.white_sigma_dn(np.zeros((128, 128))) == 0.0


def test_the_summary_is_arithmetic():
    table = pd.DataFrame(
        {
            "picture": ["a", "a", "b", "b"],
            "estimator": "x",
            "sigma_dn": [1.0, 3.0, 2.0, np.nan],
            "low_dn": [0.5, 2.5, 1.5, np.nan],
            "high_dn": [2.5, 3.5, 2.2, np.nan],
            "correlation": [0.5, 0.5, 0.5, np.nan],
            "true_correlation": 0.4,
            "white_sigma_dn": [0.5, 0.5, 1.0, np.nan],
            "true_white_sigma_dn": [1.0, 1.5, 1.0, 9.0],
            "mean_picture_sigma_dn": [0.1, 0.3, np.nan, np.nan],
            "true_sigma_dn": [2.0, 2.0, 2.0, 2.0],
            "cleaned_sigma_dn": [1.0, 1.0, 1.0, 1.0],
        }
    )
    row = real_noise.summarise(table).iloc[0]
    assert row["answered_fraction"] == 0.75 and row["mean_picture_answered_fraction"] == 0.5
    assert row["true_mae_dn"] == pytest.approx(2 / 3) and row["true_bias_dn"] == pytest.approx(0)
    assert row["cleaned_mae_dn"] == pytest.approx(1) and row["cleaned_bias_dn"] == pytest.approx(1)
    assert row["true_coverage_fraction"] == pytest.approx(2 / 3)
    assert row["cleaned_coverage_fraction"] == pytest.approx(1 / 3)
    assert row["mean_picture_sigma_dn"] == pytest.approx(0.2) and row["correlation_mae"] == pytest.approx(0.1)
    assert row["white_mae_dn"] == pytest.approx(0.5) and row["mean_white_sigma_dn"] == pytest.approx(2 / 3)
    assert row["true_white_mean_dn"] == pytest.approx(3.5 / 3)  # of the patches with an estimate
    assert (row["mean_correlation"], row["true_correlation_mean"]) == pytest.approx((0.5, 0.4))
    assert 0 <= row["white_mae_low_dn"] <= row["white_mae_dn"] <= row["white_mae_high_dn"]
    mixed = real_noise.summarise(table.assign(correlation=[0.5, 0.3, 0.4, np.nan])).iloc[0]
    assert mixed["correlation_mae"] == pytest.approx(0.2 / 3)
    assert 0 <= row["true_mae_low_dn"] <= row["true_mae_dn"] <= row["true_mae_high_dn"]
    assert row["true_mae_high_dn"] > 1  # of two pictures: beyond what either shows


def patches(estimator, sigma_dn, true_dn):
    numbers = range(len(sigma_dn))
    table = pd.DataFrame({"picture": [f"p{number // 2}" for number in numbers], "x_px": [128 * n for n in numbers]})
    return table.assign(
        y_px=0, estimator=estimator, sigma_dn=sigma_dn, true_sigma_dn=true_dn, cleaned_sigma_dn=true_dn, low_dn=np.nan,
        high_dn=np.nan, correlation=np.nan, true_correlation=0.0, mean_picture_sigma_dn=np.nan, white_sigma_dn=np.nan,
        true_white_sigma_dn=true_dn,
    )  # fmt: skip


def test_the_noise_beside_an_error_is_that_of_the_same_patches():
    """The estimator abstains from the patch with 9 DN, so that its error is one of 2 DN, not of 3.75 DN."""
    row = real_noise.summarise(patches("x", [1.0, 2.0, 3.0, np.nan], [2.0, 2.0, 2.0, 9.0])).iloc[0]
    assert row["true_mean_dn"] == row["cleaned_mean_dn"] == 2.0


def test_errors_are_compared_on_the_patches_that_the_reference_answers_too():
    """It abstains from the hard patch, on which the other errs by 6 DN: on the others that errs less."""
    true = [2.0, 2.0, 2.0, 9.0]
    other = patches("other", [2.1, 2.1, np.nan, 3.0], true)
    table = pd.concat([patches("reference", [2.5, 2.5, 2.5, np.nan], true), other])
    rows = real_noise.shared_errors(table, "reference").set_index("estimator")
    assert list(rows["shared_patches"]) == [3, 2]
    np.testing.assert_allclose(rows["true_shared_mae_dn"], [0.5, 0.1])
    np.testing.assert_allclose(rows["cleaned_shared_mae_dn"], [0.5, 0.1])
    assert real_noise.summarise(table).set_index("estimator").loc["other", "true_mae_dn"] > 2
    assert real_noise.shared_errors(other, "reference").empty


def test_patches_of_other_colour_planes_in_the_same_place_are_other_patches():
    """Four planes: the reference answers two of the patches that share picture and place, the other all four."""
    true = [2.0, 2.0, 2.0, 2.0]
    parts = [patches("reference", [2.5, np.nan, 2.5, np.nan], true), patches("other", [2.1, 9.0, 2.1, 9.0], true)]
    rows = real_noise.shared_errors(pd.concat(parts).assign(picture="p", x_px=0), "reference").set_index("estimator")
    assert list(rows["shared_patches"]) == [2, 2]
    np.testing.assert_allclose(rows["true_shared_mae_dn"], [0.5, 0.1])


def test_an_estimator_that_never_answers_has_no_figures():
    table = pd.DataFrame(np.nan, range(2), real_noise.COLUMNS).assign(picture="a", estimator="x")
    row = real_noise.summarise(table).iloc[0]
    assert row["answered_fraction"] == 0 and np.isnan(row["true_mae_dn"]) and np.isnan(row["true_coverage_fraction"])


def test_incomplete_folders_are_refused(tmp_path):
    with pytest.raises(InputError, match="no folder"):
        real_noise.pairs(tmp_path / "absent")
    with pytest.raises(InputError, match="no pairs"):
        real_noise.pairs(tmp_path)
    cv2.imwrite(str(tmp_path / "a_real.png"), np.zeros((128, 128), np.uint8))
    with pytest.raises(InputError, match="a has no partner"):
        real_noise.pairs(tmp_path)
    cv2.imwrite(str(tmp_path / "a_mean.png"), np.zeros((128, 130), np.uint8))
    with pytest.raises(InputError, match=r"pair a: .*130"):
        real_noise.measure(real_noise.pairs(tmp_path)[0], {})


def test_two_pictures_of_one_name_are_refused(tmp_path):
    for file in ("a_mean.bmp", "a_mean.png", "a_real.bmp", "a_real.png"):
        cv2.imwrite(str(tmp_path / file), np.zeros((128, 128), np.uint8))
    with pytest.raises(InputError, match=r"a_mean\.bmp and a_mean\.png have one name"):
        real_noise.pairs(tmp_path)
