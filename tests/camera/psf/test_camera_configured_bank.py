"""The section psf chooses: the paper's pictures from a folder, or a bank; the stage writes what was chosen."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline import store
from pipeline.camera.psf import configured_bank as kernel_bank
from pipeline.camera.psf import stored
from pipeline.camera.psf.bank import bank
from pipeline.camera.settings import PsfSettings
from pipeline.errors import InputError
from pipeline.stages.psf_bank import run as stage


def section(**changes):
    chosen = {
        "source": "generated",
        "folder": None,
        "match": "nominal",
        "kinds": ["defocus", "linear_motion"],
        "sizes_px": [3, 7],
        "angles_deg": [0, 90],
    }
    return PsfSettings(**{**chosen, **changes})


@pytest.fixture
def pictures(tmp_path):
    """A folder in the paper's layout: discs of 3 and 5, horizontal lines of 3 in two rotations."""
    for index, shape in (
        ("defocusBlur/3/3.png", np.ones((3, 3))),
        ("defocusBlur/5/5.png", np.ones((5, 5))),
        ("motionBlur/linear/0.0+3_0/3.png", np.eye(3)[[1]] + np.zeros((3, 3)) + np.roll(np.eye(3), 1, 1)),
        ("motionBlur/linear/0.0+3_90/3.png", np.ones((3, 1)) * np.array([0, 1, 0])),
    ):
        (tmp_path / index).parent.mkdir(parents=True)
        store.write_image(tmp_path / index, (shape / shape.max() * 255).astype(np.uint8))
    return tmp_path


def test_a_generated_bank_is_that_of_the_section():
    result = kernel_bank.configured(section(), "physical", 3)
    assert [kernel.name for kernel in result] == [
        "defocus_3", "defocus_7", "linear_motion_3_0", "linear_motion_3_90", "linear_motion_7_0", "linear_motion_7_90"
    ]  # fmt: skip
    for one, other in zip(result, bank(["defocus", "linear_motion"], [3, 7], [0, 90], 3), strict=True):
        assert one == other and np.array_equal(one.psf, other.psf)


def test_random_motions_follow_the_seed_and_discs_the_camera():
    def of(seed, camera, kind):
        return kernel_bank.configured(section(kinds=[kind]), camera, seed)[1].psf

    assert not np.array_equal(of(1, "physical", "nonlinear_motion"), of(2, "physical", "nonlinear_motion"))
    assert np.array_equal(of(1, "physical", "nonlinear_motion"), of(1, "physical", "nonlinear_motion"))
    assert not np.array_equal(of(1, "physical", "defocus"), of(1, "authors", "defocus"))


def test_of_the_papers_pictures_those_of_the_kinds_and_sizes_are_read(pictures):
    requested = section(source="paper", folder=str(pictures), sizes_px=[3])
    result = kernel_bank.configured(requested, "physical", 1)
    assert [kernel.name for kernel in result] == ["defocus_3", "linear_motion_3_0", "linear_motion_3_90"]
    assert result[0].psf == pytest.approx(np.full((3, 3), 1 / 9))
    assert result[2].psf == pytest.approx(np.array([[0, 1, 0]] * 3) / 3)


def test_a_folder_without_kernels_is_named(pictures):
    absent = section(source="paper", folder=str(pictures / "nowhere"))
    with pytest.raises(InputError, match=r"no kernels of the paper in '.*nowhere'"):
        kernel_bank.configured(absent, "physical", 1)
    with pytest.raises(InputError, match="no kernel in .* sizes 21"):
        kernel_bank.configured(section(source="paper", folder=str(pictures), sizes_px=[21]), "physical", 1)


@pytest.mark.parametrize("source", ["generated", "paper"])
def test_the_stage_writes_what_was_chosen(pictures, tmp_path, source):
    psf = section(source=source, folder=str(pictures), sizes_px=[3])
    params = SimpleNamespace(psf=psf, seed=1, camera=SimpleNamespace(kind="physical"), executor=None)
    stage.run(params, {}, tmp_path, tmp_path / "out")
    result = stored.read(Path(tmp_path / "out/data/psf"))
    for one, other in zip(result, kernel_bank.configured(psf, "physical", 1), strict=True):
        assert one.name == other.name and np.array_equal(one.psf, other.psf.astype(np.float32))
    assert store.read_json(tmp_path / "out/reports/metrics/psf.json")["kernels"] == 3
