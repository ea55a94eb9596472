"""Blur and noise at once: the order of the physics, the same numbers as the single experiments, smoothing undone."""

import numpy as np
import pandas as pd
import pytest
from data_makers import make_folder, make_kitti

from pipeline import datasets
from pipeline.blur import evaluation
from pipeline.blur.base import BlurEstimate
from pipeline.blur.denoise import Denoised
from pipeline.camera import mtf
from pipeline.camera.psf.bank import bank
from pipeline.camera.psf.defocus import create as disc
from pipeline.condition import combined_summary, combined_tables
from pipeline.condition.combined import Bench
from pipeline.condition.combined_design import Experiment, Smoothing, Subset, chosen_kernels, spread
from pipeline.condition.combined_example import liveliest
from pipeline.datasets.corrupted import CameraSettings, corrupted
from pipeline.datasets.patches import Patch, cut, object_patches, tiles
from pipeline.errors import InputError
from pipeline.noise import create as noise_estimator

KERNELS = bank(["defocus", "linear_motion"], [7], [0, 90], 1)
EXPERIMENTS = [Experiment("defocus_dcsn", "defocus", "dcsn"), Experiment("photon_defocus", "defocus", "photon"),
               Experiment("linear_dcsn", "linear_motion", "dcsn")]  # fmt: skip
LEVELS = [0.0, 15.0]


class Contrast:
    """Answers from a patch's own pixels, so that other pixels give another answer."""

    def estimate(self, patches):
        steps = [np.abs(np.diff(patches, axis=axis)).mean(axis=(1, 2, 3)) for axis in (-1, -2)]
        fall = (np.stack(steps, axis=1) / patches.mean(axis=(1, 2, 3))[:, None])[:, :, None]
        value = np.exp(-mtf.FREQUENCIES / (20 * fall))
        return BlurEstimate(value, np.zeros(len(patches), bool), np.full(len(patches), ""), low=value / 2, high=value)


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    root = make_folder(tmp_path_factory.mktemp("frames"), 1)
    return datasets.open_dataset("folder", "mine", root).frames()[0]


@pytest.fixture(scope="module")
def patches():
    return [Patch(40, 128, 192), Patch(200, 60, 192), Patch(10, 10, 192)]


def table(rows):
    return combined_tables.BLUR_READ.conform(pd.DataFrame(rows))


def bench(**changes):
    options = {"experiments": EXPERIMENTS, "kernels": KERNELS, "levels_dn": LEVELS,
               "blur": {"contrast": (Contrast(), Subset())}}  # fmt: skip
    return Bench(**{**options, **changes})


@pytest.fixture(scope="module")
def read(frame, patches):
    return table(bench().evaluate(frame, patches, [])[0])


def test_each_experiment_is_the_single_evaluation_of_its_kernel_and_noise(read, frame, patches):
    for experiment in EXPERIMENTS:
        kernels = [kernel for kernel in KERNELS if kernel.kind == experiment.kind]
        rows = evaluation.evaluate_frame(
            frame, patches, kernels, Contrast(), CameraSettings(), 1, effect=experiment.effect, level_dn=15.0
        )
        own = read[(read["experiment"] == experiment.name) & (read["level_dn"] == 15)]
        assert len(own) == len(rows) == len(kernels) * len(patches) * 16
        assert own["mtf"].tolist() == [row["mtf"] for row in rows]


def test_statistics_are_those_of_table_one_where_nothing_is_smoothed(read):
    cells = combined_summary.blur_cells(read, 1, 5)
    single = read[read["experiment"] == "linear_dcsn"]
    sharp = read[read["kernel"] == "sharp"]
    for way in (False, True):
        rows = pd.concat([single, sharp]).drop(columns=["experiment", "filter_px", "smoothed"])
        rows = evaluation.calibrated(rows) if way else rows
        theirs = evaluation.summarise(rows, 1, 0).set_index(["kind", "level_dn"])
        ours = cells[(cells["experiment"] == "linear_dcsn") & (cells["calibrated"] == way)]
        assert len(ours) == 2 and (ours["angles"] == 2).all()
        for row in ours.to_dict("records"):
            beside = theirs.loc[("linear_motion", row["level_dn"])]
            for name in ("amae_percent", "patch_error_percent", "coverage", "count"):
                assert row[name] == pytest.approx(beside[name]), name
            assert row["amae_percent"] == pytest.approx((row["mae_h_percent"] + row["mae_v_percent"]) / 2)


def test_noise_behind_the_optics_keeps_its_level_and_noise_before_them_is_blurred(frame, patches):
    places = tiles(frame.image().shape)
    made = bench(blur={}, noise={"pca": noise_estimator("pca")}).evaluate(frame, patches, places)[1]
    noise = combined_tables.NOISE_READ.conform(pd.DataFrame(made))
    cells = combined_summary.noise_cells(noise, 1, 5).set_index(["experiment", "size_px", "level_dn"])
    assert noise["kind"].isin(["defocus", "linear_motion"]).all()
    behind, before = (cells.loc[(name, 7.0, 15.0)] for name in ("defocus_dcsn", "photon_defocus"))
    assert behind["added_median_dn"] == pytest.approx(15, rel=0.02)
    assert behind["median_dn"] == pytest.approx(behind["true_median_dn"], rel=0.1)
    # White noise through a disc keeps the root of the sum of squares of its weights.
    kernel = next(kernel for kernel in KERNELS if kernel.kind == "defocus")
    left = np.sqrt((kernel.psf.astype(float) ** 2).sum())
    unblurred = cells.loc[("photon_defocus", 0.0, 15.0)]
    assert unblurred["added_median_dn"] > 10
    assert before["added_median_dn"] == pytest.approx(left * unblurred["added_median_dn"], rel=0.15)
    assert before["median_dn"] < 0.2 * behind["median_dn"]
    assert cells.loc[("defocus_dcsn", 7.0, 0.0)]["added_median_dn"] == 0


def test_level_zero_is_one_picture_for_all_experiments(read):
    zero = read[(read["level_dn"] == 0) & (read["kernel"] == "defocus_7")]
    one, other = (zero[zero["experiment"] == name]["mtf"].tolist() for name in ("defocus_dcsn", "photon_defocus"))
    assert one == other and len(one) > 0


def test_smoothing_is_that_of_the_denoised_estimator(frame, patches):
    def sigma(seen):
        return np.arange(len(seen)) * 10.0  # the first patch is quiet, the others are noisy

    smoothing = Smoothing((5.0,), 10.0, sigma)
    made = table(bench(smoothing=smoothing).evaluate(frame, patches, [])[0])
    clear = combined_summary.cleared(made)
    own = clear[(clear["experiment"] == "defocus_dcsn") & (clear["filter_px"] == 5)]
    assert own["smoothed"].tolist() == (own["patch"] > 0).tolist() and (own["level_dn"] == 15).all()
    kernel = next(kernel for kernel in KERNELS if kernel.kind == "defocus")
    image = corrupted(frame.image(), frame, "dcsn", 15.0, CameraSettings(), 1, kernel.psf, kernel.name).image
    peer = Denoised(Contrast(), sigma, filter_px=5.0).estimate(cut(image, patches))
    assert own["mtf"].to_numpy().reshape(peer.mtf.shape) == pytest.approx(peer.mtf, nan_ok=True)
    assert own["low"].to_numpy().reshape(peer.mtf.shape) == pytest.approx(peer.low, nan_ok=True)
    plain = made[(made["experiment"] == "defocus_dcsn") & (made["filter_px"] == 0) & (made["level_dn"] == 15)]
    assert own[own["patch"] == 0]["mtf"].tolist() == plain[plain["patch"] == 0]["mtf"].tolist()


def readings(read, answer, filter_px):
    """Rows of one kernel as if smoothed, with `answer` as the MTF read."""
    rows = read[(read["experiment"] == "defocus_dcsn") & (read["level_dn"] == 15)].copy()
    return rows.assign(filter_px=filter_px, smoothed=True, mtf=answer(rows), low=np.nan, high=np.nan)


def test_the_disc_is_divided_out_where_enough_is_left(read):
    exact = mtf.sample(disc(3.0))

    def both(rows):
        known = [exact["HV".index(axis), np.abs(mtf.FREQUENCIES - f).argmin()]
                 for axis, f in zip(rows["axis"], rows["frequency"], strict=True)]  # fmt: skip
        return rows["true_mtf"] * np.array(known)

    clear = combined_summary.cleared(readings(read, both, 3.0))
    answered = clear["mtf"].notna()
    assert clear.loc[answered, "mtf"].to_numpy() == pytest.approx(clear.loc[answered, "true_mtf"].to_numpy())
    product = both(readings(read, both, 3.0))
    assert answered.tolist() == (product > 0.05).tolist() and 0.2 < answered.mean() < 1
    cells = combined_summary.blur_cells(pd.concat([read, readings(read, both, 3.0)]), 1, 5)
    row = cells[(cells["filter_px"] == 3) & ~cells["calibrated"]].iloc[0]
    assert row["amae_percent"] == pytest.approx(0, abs=1e-9) and row["smoothed_share"] == 1
    assert row["frequencies_share"] == pytest.approx(answered.mean())
    assert row["abstained"] == 0


def test_a_patch_of_which_nothing_is_left_abstains(read):
    clear = combined_summary.cleared(readings(read, lambda rows: 0.0, 7.0))
    assert clear["abstained"].all() and set(clear["reason"]) == {"noise"}
    cells = combined_summary.blur_cells(pd.concat([read, readings(read, lambda rows: 0.0, 7.0)]), 1, 5)
    row = cells[(cells["filter_px"] == 7) & ~cells["calibrated"]].iloc[0]
    assert np.isnan(row["amae_percent"]) and row["count"] == 0 and row["abstained"] > 0


def test_the_error_expected_is_that_of_both_blurs(read):
    cells = combined_summary.blur_cells(read, 1, 5)
    errors = {("defocus_dcsn", 0.0, 0.0, 7.0): 3.0, (combined_summary.DISC, 0.0, 0.0, 5.0): 4.0,
              ("defocus_dcsn", 15.0, 5.0, 7.0): 9.0}  # fmt: skip
    rows = [
        {**cells.iloc[0].to_dict(), "experiment": name, "level_dn": level, "filter_px": filter_px, "size_px": size,
         "amae_percent": value, "calibrated": False}
        for (name, level, filter_px, size), value in errors.items()
    ]  # fmt: skip
    found = combined_summary.with_expected(pd.DataFrame(rows))
    assert set(found["experiment"]) == {"defocus_dcsn"}
    assert found[found["filter_px"] == 5]["expected_amae_percent"].tolist() == [5.0]
    assert found[found["filter_px"] == 0]["expected_amae_percent"].isna().all()


def test_example_curves_are_medians_of_the_rotation_nearest_to_the_diagonal(read):
    curves = combined_summary.example_curves(read, 7.0)
    own = curves[(curves["experiment"] == "linear_dcsn") & (curves["level_dn"] == 15) & ~curves["calibrated"]]
    assert set(own["angle_deg"]) == {0.0} and set(own["axis"]) == {"H", "V", "HV"}  # 0 and 90 are as near
    here = (read["experiment"] == "linear_dcsn") & (read["level_dn"] == 15) & (read["angle_deg"] == 0)
    lowest = read[here & (read["axis"] == "H") & np.isclose(read["frequency"], mtf.FREQUENCIES[0])]["mtf"]
    first = own[(own["axis"] == "H") & (own["place"] == 0)].iloc[0]
    assert first["median"] == pytest.approx(evaluation.robust_median(lowest.to_numpy()))
    kernel = next(kernel for kernel in KERNELS if kernel.name == "linear_motion_7_0")
    both = own[own["axis"] == "HV"].sort_values("place")["true_mtf"].to_numpy()
    assert both == pytest.approx(mtf.sample(kernel.psf).mean(axis=0))


def test_the_patch_shown_is_the_one_with_most_contrast(frame, patches):
    shown = liveliest([(frame, patches)])
    image = frame.image()
    spreads = [float(image[p.y_px + 48 : p.y_px + 144, p.x_px + 48 : p.x_px + 144].std()) for p in patches]
    assert shown == (frame, patches[int(np.argmax(spreads))])


def test_a_slow_estimator_takes_its_part_only(frame, patches):
    part = Subset(sizes_px=[7], angles_deg=[90], levels_dn=[15], experiments=["linear_dcsn", "defocus_dcsn"])
    made = table(bench(blur={"slow": (Contrast(), part)}).evaluate(frame, patches, [])[0])
    blurred = made[made["kernel"] != "sharp"]
    assert set(blurred["kernel"]) == {"defocus_7", "linear_motion_7_90"}  # a disc has no rotation
    assert set(blurred["level_dn"]) == {15} and "photon_defocus" not in set(blurred["experiment"])
    assert (made["kernel"] == "sharp").any()


def test_earlier_frames_are_corrupted_alike_and_given_along(tmp_path):
    seen = []

    class Together(Contrast):
        def estimate_sequences(self, sequences):
            seen.append(sequences.shape)
            return self.estimate(sequences.mean(axis=1))

    root = make_kitti(tmp_path, frames=1)
    frame = datasets.open_dataset("kitti", "kitti", root).frames()[0]
    places = object_patches(frame.image().shape, frame.boxes)
    smoothing = Smoothing((5.0,))
    bench(
        experiments=EXPERIMENTS[:1], kernels=KERNELS[:1], blur={"four": (Together(), Subset())}, smoothing=smoothing
    ).evaluate(frame, places, [])
    assert len(seen) == 4 and set(seen) == {(len(places), 4, 1, 192, 192)}  # sharp, level 0, noisy, and smoothed


def test_a_kernel_the_bank_lacks_is_named():
    with pytest.raises(InputError, match=r"combined.sizes_px: the kernel bank has no defocus of 9 px, only \['7'\]"):
        chosen_kernels(KERNELS, ["defocus"], [7, 9], "combined.sizes_px")
    assert [kernel.name for kernel in chosen_kernels(KERNELS, ["defocus"], [7], "x")] == ["defocus_7"]


def test_frames_are_spread_evenly():
    assert spread(list(range(10)), 3) == [0, 3, 6] and spread([1, 2], 5) == [1, 2] and spread([1, 2], None) == [1, 2]


def test_a_cell_without_any_answer_has_counts_but_no_mean() -> None:
    import pandas as pd

    from pipeline.condition.combined_summary import metrics

    rows = {
        "experiment": "defocus_dcsn", "estimator": "mine", "calibrated": False, "filter_px": 0.0,
        "level_dn": [0.0, 15.0], "amae_percent": [2.0, float("nan")], "count": [3, 0], "abstained": [0, 3],
    }  # fmt: skip
    found = metrics(pd.DataFrame(rows))["blur"]["defocus_dcsn"]["mine"]["raw"]
    assert found == {"0": {"amae_percent": 2.0, "count": 3, "abstained": 0}, "15": {"count": 0, "abstained": 3}}
