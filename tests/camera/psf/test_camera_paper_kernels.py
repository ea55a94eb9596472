"""The paper's kernels: read from its tree, and their published MTF reproduced."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.camera import mtf
from pipeline.camera.psf import centroid_px, defocus, paper_kernels
from pipeline.errors import InputError

AXES = ("MTF-H", "MTF-Rad"), ("MTF-V", "MTF-Tang")  # file names of the horizontal and the vertical MTF


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A small tree in the authors' layout, with one motion kernel two pixels off centre."""
    for name, size in (("defocusBlur/3/3.png", 5), ("motionBlur/linear/0.0+7_45/7.png", 7)):
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        picture = np.zeros((size, size), np.uint8)
        picture[1, 1] = 100
        picture[1, 2] = 50
        cv2.imwrite(str(path), picture)
    return tmp_path


def published_mtf(kernel: paper_kernels.PaperKernel) -> np.ndarray:
    """(2, 8) curves that the authors store beside a kernel's picture, horizontal and vertical."""
    folder = kernel.path.parent / "MTF"
    paths = [next(path for name in names for path in folder.glob(f"{name}*.npz")) for names in AXES]
    return np.stack([np.load(path)["arr_0"].reshape(8) for path in paths])


def test_tree_is_read(tree: Path) -> None:
    disc, motion = paper_kernels.load(tree)
    assert (disc.name, disc.kind, disc.size_px, disc.angle_deg) == ("defocus_3", "defocus", 3, 0)
    assert (motion.name, motion.kind) == ("linear_motion_7_45", "linear_motion")
    assert (motion.size_px, motion.angle_deg) == (7, 45)
    assert motion.psf.dtype == np.float32 and motion.psf.sum() == pytest.approx(1)
    assert motion.psf[1, 1] == pytest.approx(2 / 3)


def test_kernels_can_be_chosen(tree: Path) -> None:
    assert [k.name for k in paper_kernels.load(tree, kinds=["defocus"])] == ["defocus_3"]
    assert [k.name for k in paper_kernels.load(tree, sizes_px=[7])] == ["linear_motion_7_45"]
    assert [k.name for k in paper_kernels.load(tree, angles_deg=[90])] == ["defocus_3"]
    with pytest.raises(InputError, match="sizes 21"):
        paper_kernels.load(tree, sizes_px=[21])


def test_kernels_that_are_absent_or_share_a_name_are_refused(tree: Path) -> None:
    with pytest.raises(InputError, match=r"kind nonlinear_motion"):
        paper_kernels.load(tree, kinds=["defocus", "nonlinear_motion"])
    with pytest.raises(InputError, match=r"size 5, 9 px"):
        paper_kernels.load(tree, sizes_px=[3, 5, 9])
    shutil.copytree(tree / "motionBlur/linear/0.0+7_45", tree / "motionBlur/linear/0.5+7_45")
    with pytest.raises(InputError, match=r"linear_motion_7_45: 0\.0\+7_45 and 0\.5\+7_45"):
        paper_kernels.load(tree)


def test_centred_kernels_keep_their_mtf(tree: Path) -> None:
    for loose, centred in zip(paper_kernels.load(tree), paper_kernels.load(tree, centred=True), strict=True):
        assert max(map(abs, centroid_px(loose.psf))) > 0.6
        assert max(map(abs, centroid_px(centred.psf))) <= 0.5
        assert np.allclose(mtf.sample(loose.psf), mtf.sample(centred.psf), atol=1e-7)


def test_bad_input_is_named(tree: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no kernels of the paper in"):
        paper_kernels.load(tmp_path / "nowhere")
    with pytest.raises(InputError, match="cannot read the kernel"):
        paper_kernels.read_psf(tmp_path / "absent.png")
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(InputError, match="not a readable picture"):
        paper_kernels.read_psf(tmp_path / "text.png")
    cv2.imwrite(str(tmp_path / "black.png"), np.zeros((3, 3), np.uint8))
    with pytest.raises(InputError, match="all black"):
        paper_kernels.read_psf(tmp_path / "black.png")
    cv2.imwrite(str(tmp_path / "even.png"), np.ones((4, 3), np.uint8))
    with pytest.raises(InputError, match="odd sides"):
        paper_kernels.read_psf(tmp_path / "even.png")
    cv2.imwrite(str(tmp_path / "large.png"), np.ones((3, 1001), np.uint8))
    with pytest.raises(InputError, match="3 x 1001 pixels; expected a kernel with sides up to 999"):
        paper_kernels.read_psf(tmp_path / "large.png")


@pytest.mark.shared
def test_all_published_mtf_are_reproduced(shared: Path) -> None:
    kernels = paper_kernels.load(shared / "vectors/kernels")
    assert len(kernels) == 50
    assert {k.kind: sum(one.kind == k.kind for one in kernels) for k in kernels} == {
        "defocus": 6,
        "linear_motion": 24,
        "nonlinear_motion": 20,
    }
    for one in kernels:
        assert np.abs(mtf.sample(one.psf) - published_mtf(one)).max() < 1e-5, one.name


@pytest.mark.shared
def test_rotations_of_the_paper_are_counter_clockwise(shared: Path) -> None:
    kernels = {k.name: k.psf for k in paper_kernels.load(shared / "vectors/kernels")}
    for name, psf in kernels.items():
        if name.endswith("_0"):
            assert np.array_equal(kernels[name.removesuffix("_0") + "_90"], np.rot90(psf)), name


@pytest.mark.shared
@pytest.mark.parametrize(("size_px", "levels"), [(3, 1), (5, 0), (7, 0), (11, 0), (15, 1), (21, 1)])
def test_authors_discs_are_redrawn(shared: Path, size_px: int, levels: int) -> None:
    path = shared / f"vectors/kernels/defocusBlur/{size_px}/{size_px}.png"
    published = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).astype(int)
    assert np.abs(defocus.authors_disc_grey(size_px).astype(int) - published).max() <= levels
