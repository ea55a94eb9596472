"""Training of the gate: samples under one blur, rows, cross-validation, weight file, stage."""

from pathlib import Path

import composed
import numpy as np
import pytest

from pipeline import blur, store
from pipeline.blur import spectral
from pipeline.blur.fusion import samples as fusion_samples
from pipeline.blur.fusion import training as fusion_training
from pipeline.blur.fusion.rows import Rows
from pipeline.blur.settings import FusionRecipe, FusionTraining
from pipeline.learning import weights
from pipeline.stages.train_fusion import run as stage
from pipeline.streams import stream

ROOT = Path(__file__).resolve().parents[3]
RECIPE = FusionRecipe(samples=4)


def test_a_sample_is_a_pure_function_of_recipe_and_number():
    one, same = fusion_samples.blurred(RECIPE, 1), fusion_samples.blurred(RECIPE, 1)
    assert one.patch.shape == (192, 192) and one.patch.dtype == np.uint8
    assert np.array_equal(one.patch, same.patch) and np.array_equal(one.mtf, same.mtf)
    assert not np.array_equal(one.patch, fusion_samples.blurred(RECIPE, 2).patch)


def test_samples_are_blurred_and_some_are_noisy():
    samples = [fusion_samples.blurred(RECIPE, index) for index in range(8)]
    assert all(0 < sample.mtf.mean() < 0.65 for sample in samples)
    sigmas = np.array([sample.sigma_dn for sample in samples])
    assert (sigmas == 0).any() and (sigmas > 0).any() and sigmas.max() <= 25


def synthetic(count):
    """Rows where GBB errs by a hundredth, the spectral network and PMP by a tenth."""
    generator = stream(1, "test fusion rows")
    truth = generator.uniform(0.15, 0.85, (count, 2, 8))
    errors = generator.laplace(0, 1, (count, 3, 2, 8)) * np.array([0.1, 0.01, 0.1])[:, None, None]
    members = np.clip(truth[:, None] + errors, 0, 1)
    arrays = (members, np.full_like(truth, 0.1), np.zeros(count), truth, np.zeros(count))
    return Rows(*(part.astype(np.float32) for part in arrays))


def test_it_learns_which_member_is_right():
    data = synthetic(120)
    trained = fusion_training.train(data, FusionTraining(steps=120, folds=2))
    measures = trained.measures
    assert measures["gbb_error_percent"] < 1.5 and measures["spectral_error_percent"] > 6
    assert measures["fused_error_percent"] < 0.5 * measures["spectral_error_percent"]
    assert measures["rows"] == 120 and "fused_error_high_noise_percent" not in measures
    again = fusion_training.train(data, FusionTraining(steps=120, folds=2))
    for name, tensor in trained.gate.state_dict().items():
        assert np.array_equal(tensor.numpy(), again.gate.state_dict()[name].numpy()), name


def test_rows_are_selected_together():
    data = synthetic(6)
    part = data.part(np.arange(6) >= 4)
    assert np.array_equal(part.members, data.members[4:]) and np.array_equal(part.mtf, data.mtf[4:])


@pytest.mark.skipif(not spectral.RELEASED.is_file(), reason="weights absent: run dvc repro train_mtf")
def test_the_stage_writes_weights_that_the_estimator_takes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # of the cache
    recipe = "{samples: 4}"
    overrides = [f"train.fusion={{recipe: {recipe}, steps: 5, folds: 2}}", "executor.workers=1"]
    config = composed.config(*overrides)
    stage.run(config, {}, ROOT, tmp_path / "first")
    assert len(list((tmp_path / ".cache/training").glob("fusion-*/*.npz"))) == 4
    stage.run(config, {}, ROOT, tmp_path / "second")  # from the cache
    path = "data/weights/mtf_fusion.safetensors"
    assert (tmp_path / "first" / path).read_bytes() == (tmp_path / "second" / path).read_bytes()
    measures = store.read_json(tmp_path / "first/reports/metrics/train/mtf_fusion.json")
    header = weights.details(tmp_path / "first" / path)
    assert measures["rows"] == 4 and header["interval"] == pytest.approx(measures["interval"], rel=1e-5)
    assert blur.create("fused", weights=tmp_path / "first" / path).interval == header["interval"]
