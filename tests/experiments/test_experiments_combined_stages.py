"""The stages `combined` and `denoised_blur`: same bytes for any number of workers, mistakes named, real frames."""

import hashlib
from pathlib import Path

import composed
import pytest
from data_makers import make_kitti

from pipeline import store
from pipeline.config.schema import validate
from pipeline.errors import InputError
from pipeline.experiments.tables import BLUR_CELLS, CURVES, NOISE_CELLS
from pipeline.stages import combined, denoised_blur, index, psf_bank

ROOT = Path(__file__).resolve().parents[2]
TINY = (
    *(f"~combined.blur_estimators.{name}" for name in ("cnn", "pmp", "gbb")), "combined.target_sigmas_dn=[0,15]",
    "combined.sizes_px=[11]", "denoised_blur.sizes_px=[11]", "denoised_blur.filters_px=[7]",
    "~combined.experiments.photon_linear", "psf.sizes_px=[11]", "psf.kinds=[defocus,linear_motion]",
)  # fmt: skip


def settings(root, *overrides, workers=1):
    content = composed.content(
        "profile=smoke",
        "+dataset@datasets.kitti=kitti",
        f"datasets.kitti.root={root}",
        f"executor.workers={workers}",
        *overrides,
    )
    content["datasets"] = {"kitti": content["datasets"]["kitti"]}
    content["matrix"]["datasets"] = ["kitti"]
    return validate(content)


def before(config, out):
    psf_bank.run.run(config, {}, out, out)
    index.run.run(config, {"dataset": "kitti"}, out, out)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    return make_kitti(folder, frames=2)


@pytest.fixture(scope="module")
def once(root, tmp_path_factory):
    out = tmp_path_factory.mktemp("once")
    config = settings(root, *TINY)
    before(config, out)
    for module in (combined, denoised_blur):
        module.run.run(config, {"dataset": "kitti"}, out, out)
    return out


def digests(folder):
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.rglob("*")) if path.is_file()}  # fmt: skip


@pytest.mark.full("measuring again takes 10 s")
def test_two_workers_write_the_same_bytes(root, once, tmp_path):
    config = settings(root, *TINY, workers=2)
    before(config, tmp_path)
    combined.run.run(config, {"dataset": "kitti"}, tmp_path, tmp_path)
    of_one = {name: digest for name, digest in digests(once).items() if "denoised_blur" not in name}
    assert of_one == digests(tmp_path)
    assert "data/combined/kitti/blur_read.parquet" in of_one


def test_every_cell_is_there(once):
    folder = once / "data/combined/kitti"
    cells = store.read_table(folder / "blur.parquet", BLUR_CELLS)
    assert set(cells["experiment"]) == {"defocus_dcsn", "photon_defocus", "linear_dcsn"}
    assert len(cells) == 3 * 2 * (2 + 1)  # experiments x raw, calibrated x (two levels, the noisy one smoothed as well)
    assert (cells[cells["experiment"] == "linear_dcsn"]["angles"] == 2).all()
    noise = store.read_table(folder / "noise.parquet", NOISE_CELLS)
    assert set(noise["estimator"]) == {"cellwise", "pca"} and set(noise["kernel_size_px"]) == {0.0, 11.0}
    curves = store.read_table(folder / "curves.parquet", CURVES)
    assert (curves.groupby(["experiment", "target_sigma_dn", "filter_px", "calibrated", "axis"]).size() == 8).all()
    arrays, content = store.read_arrays(folder / "example.npz"), store.read_json(folder / "example.json")
    by_name = {entry["experiment"]: entry for entry in content["experiments"]}
    assert by_name["photon_defocus"]["steps"] == ["scene", "photon", "optics", "frame"]
    assert by_name["defocus_dcsn"]["steps"] == ["scene", "optics", "dark", "frame"]
    assert (arrays["step_defocus_dcsn_scene"] == arrays["step_photon_defocus_scene"]).all()
    # The frame without noise is the picture behind the optics, but for rounding.
    quiet, lens = arrays["level_defocus_dcsn_0"].astype(float), arrays["step_defocus_dcsn_optics"].astype(float)
    assert abs(quiet - lens).max() <= 1
    metrics = store.read_json(once / "reports/metrics/combined/kitti.json")
    assert set(metrics["blur"]["linear_dcsn"]["spectral"]) == {"raw", "calibrated", "raw, smoothed by 7 px",
                                                               "calibrated, smoothed by 7 px"}  # fmt: skip


def test_the_supplement_smooths_every_patch_and_says_what_to_expect(once):
    cells = store.read_table(once / "data/denoised_blur/kitti/blur.parquet", BLUR_CELLS)
    assert set(cells["experiment"]) == {"linear_motion_dcsn"}
    smoothed = cells[cells["filter_px"] == 7]
    assert (smoothed["smoothed_fraction"] == 1).all() and (smoothed["expected_amae_percent"] > 0).all()
    plain = cells[(cells["filter_px"] == 0) & (cells["target_sigma_dn"] == 0)].set_index("calibrated")["amae_percent"]
    for row in smoothed.to_dict("records"):
        assert row["expected_amae_percent"] > plain[row["calibrated"]]


def test_a_name_that_is_not_configured_is_named(root, once):
    config = settings(root, *TINY, "+combined.blur_estimators.spectrl={}")
    with pytest.raises(InputError, match=r"combined.blur_estimators: 'spectrl' is not among blur.estimators.*spectral"):
        combined.run.run(config, {"dataset": "kitti"}, once, once)
    with pytest.raises(InputError, match="combined.blur_estimators.spectral.frames"):
        settings(root, "+combined.blur_estimators.spectral.frames=0")


@pytest.mark.shared
@pytest.mark.slow
def test_noise_of_ten_dn_leaves_defocus_readable_on_recorded_frames(shared, tmp_path):
    """The paper gives up from 10 DN on; a network trained with noise does not, and its noise is read at its level."""
    overrides = (*TINY, "combined.target_sigmas_dn=[0,10,25]", "~combined.experiments.linear_dcsn", "combined.frames=4",
                 "combined.patches_per_frame=null", "combined.denoise.filter_px=null")  # fmt: skip
    config = settings(shared / "realdata/kitti", *overrides)
    before(config, tmp_path)
    combined.run.run(config, {"dataset": "kitti"}, tmp_path, tmp_path)
    cells = store.read_table(tmp_path / "data/combined/kitti/blur.parquet", BLUR_CELLS)
    assert (cells["filter_px"] == 0).all()
    raw = cells[~cells["calibrated"]].set_index(["experiment", "target_sigma_dn"])["amae_percent"]
    assert raw["defocus_dcsn", 10] < 4 and raw["defocus_dcsn", 25] < 8
    assert raw["photon_defocus", 25] < 2  # noise that the lens has blurred helps rather than hurts
    noise = store.read_table(tmp_path / "data/combined/kitti/noise.parquet", NOISE_CELLS)
    selected = noise[
        (noise["estimator"] == "cellwise") & (noise["experiment"] == "defocus_dcsn") & (noise["target_sigma_dn"] == 25)
    ]
    assert (abs(selected["median_dn"] - 25) < 2).all()
