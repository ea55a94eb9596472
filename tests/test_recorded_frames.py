"""Experiments on one's own frames: recorded as the stages measure them, with provenance, and read again."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import composed
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.experiments.recorded import frames as frame_records
from pipeline.experiments.recorded.frames import COMBINED_FILES, DENOISED_FILE, NOISE_FILE
from pipeline.recording.frames import Request, record_combined, record_denoised, record_noise
from pipeline.report.inputs import ReportInputs

OVERRIDES = (
    "datasets.photos.limit=2",
    "noise.noise_sources=[photon]",
    "noise.target_sigmas_dn=[0,10]",
    "noise.tiles_per_frame=3",
    "~noise.estimators.cnn",
    "~noise.estimators.adaptive",
    "~noise.estimators.cellwise",
    "+noise.estimators.bf.per_frame=2",
    "psf.angles_deg=[45]",
    "combined.frames=2",
    "combined.target_sigmas_dn=[0,10]",
    "combined.sizes_px=[3,11]",
    "~combined.experiments.linear_dcsn",
    "~combined.experiments.photon_linear",
    "~combined.experiments.defocus_dcsn",
    "~combined.blur_estimators.pmp",
    "~combined.blur_estimators.gbb",
    "~combined.blur_estimators.cnn",
    "combined.noise_estimators=[pca]",
    "combined.denoise.sigma_by=pca",
    "combined.bootstrap_draws=20",
    "denoised_blur.sizes_px=[3]",
    "denoised_blur.target_sigmas_dn=[10]",
    "denoised_blur.filters_px=[7]",
    "denoised_blur.bootstrap_draws=20",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recorded")


@pytest.fixture(scope="module")
def inputs(folder: Path) -> ReportInputs:
    """Records of photographs, which need no download."""
    config = composed.config(*OVERRIDES)
    for name, made in (("noise", record_noise), ("combined", record_combined), ("denoised", record_denoised)):
        out = folder / f"photos-{name}"
        made(Request(config, "photos", out, f"{name} (public domain)", partial(run_map, workers=1)))
    return ReportInputs(paper=Path("data/paper"), recorded=folder)


def test_noise_is_measured_as_the_stage_does(inputs: ReportInputs) -> None:
    table = frame_records.joined(inputs.recorded, NOISE_FILE)
    assert set(table["estimator"]) == {"pca", "bf"} and set(table["dataset"]) == {"photos"}
    clean, noisy = table[table["estimator"] == "pca"].sort_values("unclipped_median_dn").to_dict("records")
    assert clean["unclipped_median_dn"] == 0 and noisy["unclipped_median_dn"] == pytest.approx(10, abs=4)
    assert noisy["median_dn"] > clean["median_dn"]
    requested = (table["count"] + table["abstained"]).groupby(table["estimator"]).unique()
    assert requested["pca"].tolist() == [6] and requested["bf"].tolist() == [4]  # tiles of two frames


def test_blur_and_noise_and_their_curves(inputs: ReportInputs) -> None:
    blur, noise, curves = (frame_records.joined(inputs.recorded, name) for name in COMBINED_FILES)
    assert set(blur["estimator"]) == {"spectral"} and np.isfinite(blur["amae_percent"]).all()
    assert set(noise["estimator"]) == {"pca"} and len(curves)
    (record,) = frame_records.records_with(inputs.recorded, COMBINED_FILES[0])
    kernels = set(record.provenance["kernels"])
    assert kernels == {"defocus_3", "defocus_11"}  # those used, not the whole bank
    files = {name: set(of) for part in record.provenance["weights"].values() for name, of in part.items()}
    spectral = {"mtf_spectral.safetensors", "mtf_spectral_processed.safetensors"}
    assert files == {"spectral": spectral}


def test_denoised_blur_has_the_error_to_be_expected(inputs: ReportInputs) -> None:
    cells = frame_records.joined(inputs.recorded, DENOISED_FILE)
    smoothed = cells[(cells["filter_px"] == 7) & ~cells["calibrated"].astype(bool)]
    assert len(smoothed) == 1 and smoothed["expected_amae_percent"].notna().all()


def test_the_provenance_names_frames_and_settings_and_no_folder(inputs: ReportInputs, folder: Path) -> None:
    text = (folder / "photos-noise/provenance.json").read_text(encoding="utf-8")
    about = json.loads(text)
    assert about["source"] == "noise (public domain)" and about["weights"] == {}  # PCA and B+F
    assert len(about["frames"]) == 2 and all(len(value) == 64 for value in about["frames"].values())
    assert about["settings"]["noise"]["target_sigmas_dn"] == [0, 10]
    assert str(Path.home()) not in text and str(folder) not in text
    (record,) = frame_records.records_with(inputs.recorded, NOISE_FILE)
    assert record.frames["noise_tiles"].tolist() == [3, 3]


def test_two_records_of_one_dataset_are_refused(inputs: ReportInputs, folder: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        for file in (NOISE_FILE, "provenance.json", "frames.csv"):
            (tmp_path / name / file).write_bytes((folder / "photos-noise" / file).read_bytes())
    with pytest.raises(InputError, match="keep one"):
        frame_records.joined(tmp_path, NOISE_FILE)


def test_a_run_wins_over_a_record(inputs: ReportInputs) -> None:
    table = frame_records.joined(inputs.recorded, NOISE_FILE)
    assert frame_records.not_run(table, table).empty
    assert len(frame_records.not_run(table, table.assign(dataset="sim"))) == len(table)
