"""What is kept of noise on real cameras: complete, consistent, of the named pictures, and no picture among it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.experiments.real_noise import records as files
from pipeline.noise import real_noise
from pipeline.store import read_json

ROOT = Path(__file__).resolve().parents[1]
NOISE, SENSOR = ROOT / "reports/recorded/real-noise", ROOT / "reports/recorded/real-sensor"
EXAMPLES = ROOT / "reports/recorded/real-noise-examples"
PAIRS = {"cc": ("cc_noise", 8), "polyu": ("polyu", 50)}
TILES = 16  # 128 px patches of 512 x 512 px


@pytest.fixture(scope="module")
def summary() -> pd.DataFrame:
    return pd.read_csv(NOISE / files.SUMMARY_FILE).set_index(["dataset", "estimator"])


def test_every_estimator_is_measured_on_every_patch() -> None:
    patches = pd.read_csv(NOISE / files.PATCHES_FILE, keep_default_na=False, na_values=[""])
    assert list(patches.columns) == ["dataset", *real_noise.COLUMNS]
    counts = patches.groupby(["dataset", "estimator"]).size()
    for dataset, (_, pictures) in PAIRS.items():
        assert set(counts[dataset].index) == set(real_noise.ESTIMATORS) and (counts[dataset] == pictures * TILES).all()


def test_the_summary_is_that_of_the_patches(summary: pd.DataFrame) -> None:
    patches = pd.read_csv(NOISE / files.PATCHES_FILE)
    provenance = read_json(NOISE / files.PROVENANCE_FILE)
    for dataset in PAIRS:
        table = patches[patches["dataset"] == dataset]
        again = real_noise.summarise(table, provenance["seed"], provenance["bootstrap_draws"]).set_index("estimator")
        kept = summary.loc[dataset]
        pd.testing.assert_frame_equal(again, kept[list(again.columns)], rtol=1e-4, check_dtype=False)


@pytest.mark.parametrize(("dataset", "error_dn", "truth"), [("cc", 0.5, "true"), ("polyu", 0.85, "true")])
def test_the_default_estimator_stays_below_the_bar(
    summary: pd.DataFrame, dataset: str, error_dn: float, truth: str
) -> None:
    row = summary.loc[(dataset, "adaptive")]
    assert row[f"{truth}_mae_dn"] < error_dn
    assert row["cleaned_coverage_fraction"] > 0.85 and row["answered_fraction"] > 0.7


def test_pictures_are_named_by_hash_and_none_is_kept() -> None:
    for folder, file in ((NOISE, files.PROVENANCE_FILE), (SENSOR, files.RAW_PROVENANCE_FILE)):
        provenance = read_json(folder / file)
        assert "licence" in provenance["source"]
        assert {path.suffix for path in folder.iterdir()} == {".csv", ".json"}
        names = [name for files in provenance.get("datasets", provenance.get("frames")).values() for name in files]
        assert names and "/" not in "".join(names)


@pytest.mark.parametrize("dataset", PAIRS)
def test_hashes_are_those_of_the_pictures(dataset: str) -> None:
    folder = ROOT.parent / "shared/realdata" / PAIRS[dataset][0]
    if not folder.is_dir():
        pytest.skip(f"{folder.name}: the pictures are not part of the project")
    for name, digest in read_json(NOISE / files.PROVENANCE_FILE)["datasets"][dataset].items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest, name


def test_colour_planes_of_a_sensor_agree() -> None:
    """Gain and dark noise belong to the amplifier that all colours share."""
    transfer = pd.read_csv(SENSOR / files.TRANSFER_FILE)
    gain = transfer["gain_dn_per_e"]
    assert np.ptp(gain) < 4 * transfer["gain_error"].max() and gain.between(0.03, 0.06).all()
    assert transfer["dark_sigma_e"].between(5, 15).all()
    assert (pd.read_csv(SENSOR / files.DARK_FILE)["slope_dn_per_s"] > 0).all()


def test_noise_of_raw_frames_is_estimated_as_white() -> None:
    """Raw noise follows photon transfer; the default estimator treats it as white and is right on it.

    What pixels differ by in every frame shows like noise: the estimate lies between the noise from shot to shot and
    noise with this pattern. Planes with a pattern from pixel to pixel are abstained from.
    """
    row = pd.read_csv(SENSOR / files.RAW_SUMMARY_FILE).set_index("estimator").loc["adaptive"]
    assert row["cleaned_mae_dn"] < 0.2 and row["true_mae_dn"] < 0.12 and row["answered_fraction"] > 0.8
    assert row["cleaned_bias_dn"] > 0 > row["true_bias_dn"] and row["true_coverage_fraction"] > 0.88
    patches = pd.read_csv(SENSOR / files.RAW_PATCHES_FILE)
    assert patches["cleaned_sigma_dn"].between(0.6, 1.5).all()
    assert pd.read_csv(SENSOR / files.TRANSFER_FILE)["pattern_fraction"].between(0.035, 0.05).all()
    ours = patches[patches["estimator"] == "adaptive"]
    assert ours["correlation"].abs().median() < 0.1
    assert set(ours["reason"].dropna()) == {"alternating"}


def test_examples_were_read_too_low_and_are_now_right_or_abstained_from() -> None:
    """Canon at ISO 3200, a JPEG, a frame of a video: the estimator of white noise is sure of too little."""
    table = pd.read_csv(EXAMPLES / files.EXAMPLES_FILE, keep_default_na=False, na_values=["nan"])
    before, now = (table[table["estimator"] == name].reset_index() for name in ("cellwise", "adaptive"))
    assert len(now) == 3 and (before["high_dn"].astype(float) < 0.8 * before["true_sigma_dn"]).all()
    error = (now["sigma_dn"].astype(float) - now["true_sigma_dn"]).abs()
    compressed = now["reasons"].str.startswith("compressed") & (now["answered"] < 0.5 * now["patches"])
    assert ((error < 0.2 * now["true_sigma_dn"]) | compressed).all()


def test_examples_keep_small_crops_and_name_their_pictures() -> None:
    provenance = read_json(EXAMPLES / files.EXAMPLES_PROVENANCE_FILE)
    assert "licence" in provenance["source"] and len(provenance["files"]) == 6
    crops = sorted(EXAMPLES.glob("*.png"))
    assert [path.name for path in crops] == [files.example_crop(number) for number in range(3)]
    assert all(path.stat().st_size < 20_000 for path in crops)
