"""Noise estimators on recordings of real cameras: pairs, raw frames with photon transfer, the stage."""

from dataclasses import replace
from functools import partial

import composed
import cv2
import numpy as np
import pandas as pd
import pytest

from pipeline.camera.characterisation.emva1288 import PLANES
from pipeline.datasets.decoding.raw_frames import raw_frames
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.experiments.real_noise import records as real_noise_records
from pipeline.experiments.real_noise.bounds import picture_bounds
from pipeline.experiments.real_noise.experiment import BRIGHTEST_DN, measure_pairs, measure_raw, real_noise_metrics
from pipeline.experiments.real_noise.sensor_constants import sensor_constants
from pipeline.experiments.real_noise.tables import REAL_NOISE_PATCHES, REAL_NOISE_SUMMARY, TRANSFER
from pipeline.noise.real_noise import summarise
from pipeline.recording.sensor import record as sensor_record
from pipeline.stages.real_noise import run as stage
from pipeline.store import read_json, read_table
from pipeline.streams import stream

KINDS = {"pca": ("pca", {}), "wavelet": ("wavelet", {})}
GAIN, DARK_E, BLACK_DN, WHITE_DN = 0.05, 10.0, 16.0, 255.0
EXECUTOR = partial(run_map, workers=1)


def write_raw(folder, name, exposure_ms, level_dn, bits=8):
    """A raw frame: shot noise at a gain of 0.05 DN per electron, 10 electrons of dark noise, and a black level.

    Deeper ones are the same in more grey values.
    """
    generator, scale = stream(1, "raw", name, exposure_ms), 2 ** (bits - 8)
    electrons = generator.poisson(level_dn / GAIN) + generator.normal(0, DARK_E, level_dn.shape)
    folder.mkdir(exist_ok=True, parents=True)
    levels = np.clip(np.rint(scale * (BLACK_DN + GAIN * electrons)), 0, 2**bits - 1)
    picture = levels.astype(np.uint8 if bits == 8 else np.uint16)
    assert cv2.imwrite(str(folder / f"{name}_{exposure_ms}ms_1.tif"), picture)


def write_sensor(root, bits=8):
    """Three exposures of a ramp, the last too bright for the check of estimators, and dark frames."""
    ramp = np.tile(np.linspace(8, 120, 320), (300, 1))
    for exposure in (100, 200, 800):
        write_raw(root / "light", "scene", exposure, ramp * exposure / 400, bits)
        write_raw(root / "dark", "dark", exposure, np.full((64, 64), 0.01 * exposure), bits)
    return root


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    return write_sensor(tmp_path_factory.mktemp("raw"))


@pytest.fixture(scope="module")
def sensor(raw):
    return sensor_constants(raw_frames(raw / "light"), raw_frames(raw / "dark"), WHITE_DN)


def test_constants_are_those_of_the_simulated_sensor(sensor):
    assert list(sensor.transfer["plane"]) == list(PLANES)
    assert sensor.transfer["gain_dn_per_e"].mean() == pytest.approx(GAIN, rel=0.05)
    assert sensor.dark["slope_dn_per_s"].mean() == pytest.approx(10, rel=0.05)
    assert (sensor.points.groupby("plane")["mean_dn"].apply(lambda column: column.is_monotonic_increasing)).all()
    assert len(sensor.dark_means) == len(PLANES) * 3


def test_noise_of_raw_frames_is_measured_against_photon_transfer(raw, sensor):
    table = measure_raw(raw_frames(raw / "light"), sensor.fits, WHITE_DN, KINDS, EXECUTOR)
    REAL_NOISE_PATCHES.conform(table)
    selected = table[table["estimator"] == "pca"]
    assert set(selected["picture"]) == {"scene_100ms_1", "scene_200ms_1"}  # the third is brighter than the check allows
    assert len(selected) == 2 * len(PLANES)
    mean_dn = (selected["cleaned_sigma_dn"] ** 2 - GAIN**2 * DARK_E**2) / GAIN
    assert (mean_dn < BRIGHTEST_DN * 1.1).all()
    np.testing.assert_allclose(selected["true_sigma_dn"], selected["cleaned_sigma_dn"], rtol=0.03)  # no fixed pattern
    assert (selected["true_white_sigma_dn"] == selected["cleaned_sigma_dn"]).all()  # raw noise is white
    worn = {name: replace(fit, pattern_fraction=0.05) for name, fit in sensor.fits.items()}
    with_pattern = measure_raw(raw_frames(raw / "light"), worn, WHITE_DN, {"pca": KINDS["pca"]}, EXECUTOR)
    of_pattern = np.sqrt(with_pattern["true_sigma_dn"] ** 2 - with_pattern["cleaned_sigma_dn"] ** 2)
    offset, gain = np.tile([(fit.dark_variance_dn2, fit.gain_dn_per_e) for fit in sensor.fits.values()], (2, 1)).T
    above_dn = (with_pattern["cleaned_sigma_dn"] ** 2 - offset) / gain
    np.testing.assert_allclose(of_pattern, 0.05 * above_dn, rtol=1e-6)
    assert (selected["sigma_dn"] - selected["true_sigma_dn"]).abs().mean() < 0.15
    assert real_noise_metrics(summarise(table, draws=20))["pca"]["true_mae_dn"] < 0.15


def test_noise_of_twelve_bits_is_that_of_eight_in_finer_grey_values(raw, sensor, tmp_path):
    write_sensor(tmp_path, bits=12)
    white_dn = 4095.0
    frames = raw_frames(tmp_path / "light")
    fits = sensor_constants(frames, raw_frames(tmp_path / "dark"), white_dn).fits
    fine = measure_raw(frames, fits, white_dn, KINDS, EXECUTOR)
    coarse = measure_raw(raw_frames(raw / "light"), sensor.fits, WHITE_DN, KINDS, EXECUTOR)
    assert list(fine["picture"]) == list(coarse["picture"])
    for column in ("sigma_dn", "cleaned_sigma_dn"):
        assert fine[column].mean() / 16 == pytest.approx(coarse[column].mean(), rel=0.1)


def test_a_sensor_without_a_dark_patch_is_recorded_all_the_same(tmp_path):
    level = np.tile(np.linspace(60, 120, 320), (64, 1))
    for exposure in (100, 200, 400):
        write_raw(tmp_path / "light", "scene", exposure, level * exposure / 400 + 60)
        write_raw(tmp_path / "dark", "dark", exposure, np.full((64, 64), 0.01 * exposure))
    out = tmp_path / real_noise_records.SENSOR_FOLDER
    sensor_record(tmp_path / "light", tmp_path / "dark", WHITE_DN, KINDS, out, "made", EXECUTOR)
    for file, schema in (("patches", REAL_NOISE_PATCHES), ("summary", REAL_NOISE_SUMMARY)):
        table = pd.read_csv(out / f"sensor_{file}.csv")
        assert table.empty and list(table.columns) == list(schema.columns)
    assert len(real_noise_records.sensor({}, tmp_path).transfer) == len(PLANES)
    assert real_noise_records.recordings({}, tmp_path) == []


def test_pairs_are_measured_by_their_difference(tmp_path):
    mean = np.tile(np.linspace(60, 180, 256), (128, 1))
    noisy = mean + stream(1, "pair").normal(0, 5, mean.shape)
    for name, picture in (("a_mean", mean), ("a_real", noisy)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.rint(picture).astype(np.uint8))
    table = REAL_NOISE_PATCHES.conform(measure_pairs(tmp_path, KINDS, EXECUTOR))
    assert len(table) == 2 * len(KINDS) and table["true_sigma_dn"].mean() == pytest.approx(5, rel=0.05)
    assert (table["sigma_dn"] - 5).abs().mean() < 0.6


def configuration(*overrides):
    return composed.config("executor.workers=1", "real_noise.bootstrap_draws=20", *overrides)


def test_the_stage_writes_that_it_has_not_run_without_data(tmp_path):
    stage.run(configuration(), {"recording": "cc"}, tmp_path, tmp_path)
    assert read_json(tmp_path / "data/real_noise/cc/recording.json")["ran"] is False
    assert [path.name for path in (tmp_path / "data/real_noise/cc").iterdir()] == ["recording.json"]
    assert read_json(tmp_path / "reports/metrics/real_noise/cc.json") == {"ran": False}


def test_the_stage_measures_raw_frames_of_a_given_folder(tmp_path, raw):
    key = "real_noise.recordings.flea3"
    config = configuration(f"{key}.folder={raw}", f"{key}.light=light", f"{key}.dark=dark")
    assert config.real_noise.recordings["flea3"].dvc_dependency == str(raw)
    stage.run(config, {"recording": "flea3"}, tmp_path, tmp_path)
    folder = tmp_path / "data/real_noise/flea3"
    assert read_table(folder / "transfer.parquet", TRANSFER)["gain_dn_per_e"].mean() == pytest.approx(GAIN, rel=0.05)
    summary = read_table(folder / "summary.parquet", REAL_NOISE_SUMMARY).set_index("estimator")
    assert {"adaptive", "pca_stride_2"} <= set(summary.index)
    assert read_json(tmp_path / "reports/metrics/real_noise/flea3.json")["adaptive"]["true_mae_dn"] < 0.2
    patches = read_table(folder / "patches.parquet", REAL_NOISE_PATCHES)
    assert isinstance(patches, pd.DataFrame) and len(patches) == 2 * len(PLANES) * len(summary)


@pytest.mark.parametrize(
    ("override", "word"),
    [
        ("real_noise.recordings.cc.folder=/nowhere", "real_noise.recordings.cc.folder"),
        ("+real_noise.recordings.cc.light=x", "light and dark"),
        ("real_noise.recordings.cc.kind=films", "real_noise.recordings.cc.kind"),
    ],
)
def test_mistakes_in_a_recording_name_the_key(override, word):
    from pipeline.config.references import check_references

    with pytest.raises(InputError, match=word):
        check_references(composed.config(override))


def test_pictures_without_an_estimate_have_the_bound_of_a_frame():
    """Two coded pictures, one of which holds more than its bound, one with an estimate, one too flat for a bound."""
    names = np.repeat(["held", "missed", "known", "flat"], 5)
    coded, answered = ["compressed"] * 4 + [""], [""] * 5
    bound = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    table = pd.DataFrame(
        {
            "picture": names,
            "sigma_dn": [*[np.nan] * 4, 1.0, *[np.nan] * 4, 1.0, *[2.0] * 5, *[np.nan] * 5],
            "reason": [*coded, *coded, *answered, *["flat"] * 5],
            "at_most_dn": np.concatenate([bound, bound, bound, np.full(5, np.nan)]),
            "cleaned_sigma_dn": np.repeat([2.0, 4.0, 2.0, 0.0], 5),
            "mean_picture_sigma_dn": np.nan,
            "mean_picture_reason": "compressed",
            "mean_picture_at_most_dn": np.tile(bound, 4),
        }
    )
    photographs, means = picture_bounds(table).to_dict("records")
    assert (photographs["of"], photographs["pictures"], photographs["bounded"]) == ("photographs", 4, 2)
    assert photographs["bound_dn"] == pytest.approx(np.quantile(bound, 0.4)) and photographs["true_dn"] == 3.0
    assert photographs["held_fraction"] == 0.5
    assert (means["bounded"], means["true_dn"], means["held_fraction"]) == (4, 0.0, 1.0)
    _, none = picture_bounds(table.assign(mean_picture_at_most_dn=0.0)).to_dict("records")
    assert (none["bound_dn"], none["held_fraction"]) == (0.0, 1.0)  # of means, which have no noise
    nothing = picture_bounds(table[table["picture"] == "known"]).iloc[0]
    assert nothing["bounded"] == 0 and np.isnan(nothing["bound_dn"]) and np.isnan(nothing["held_fraction"])
