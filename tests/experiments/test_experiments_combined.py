"""Blur and noise at once: the order of image formation, the same numbers as the single experiments, filters undone."""

import numpy as np
import pandas as pd
import pytest
from combined_cases import KERNELS, PAIRS, Contrast, measured, with_estimates
from data_makers import make_kitti

from pipeline import datasets, noise
from pipeline.blur.denoise import Denoised
from pipeline.camera import mtf
from pipeline.camera.psf.defocus import create as disc
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.decoding.pictures import read_grey
from pipeline.datasets.patches import cut, object_patches, tiles
from pipeline.experiments.calibrate import divide_out_filter, divided_by_sharp
from pipeline.experiments.combined import DISC, blur_cells, sigma_cells, with_expected
from pipeline.experiments.condition import Condition, Subset, grid
from pipeline.experiments.corrupt import SharpFrame
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.intervals import robust_median
from pipeline.experiments.metrics import combined_metrics
from pipeline.experiments.pictures.combined_example import (
    change_interval,
    example_curves,
    highest_contrast_patch,
    steps,
)
from pipeline.experiments.run import Method, PreFilter, Registered, run
from pipeline.experiments.summarise import MTF_CELL, mtf_cells
from pipeline.experiments.tables import CHANGES, NOISE_READ, rounded, written
from pipeline.noise.base import NoiseEstimate
from pipeline.streams import stream


def test_each_pair_is_the_single_experiment_of_its_kernel_and_noise(measurements, frame, patches):
    for pair in PAIRS:
        kernels = [kernel for kernel in KERNELS if kernel.kind == pair.blur_kind]
        conditions = grid(kernels, [pair.noise_source], [15.0])
        conditions = [Condition(c.kernel, c.noise_source, 15.0, pair.name) for c in conditions]
        single = run(
            [TestFrame(frame, {"mtf": patches})], conditions, [Method("contrast", "mtf", Contrast())], paired=False
        )
        part = measurements[(measurements["experiment"] == pair.name) & (measurements["target_sigma_dn"] == 15)]
        assert len(part) == len(single) == len(kernels) * len(patches) * 16
        assert part["estimate"].tolist() == rounded(single)["estimate"].tolist()


def test_level_zero_is_one_image_for_all_pairs(measurements):
    zero = measurements[(measurements["target_sigma_dn"] == 0) & (measurements["kernel"] == "defocus_7")]
    one, other = (zero[zero["experiment"] == name]["estimate"].tolist() for name in ("defocus_dcsn", "photon_defocus"))
    assert one == other and len(one) > 0


def answer_of(sigma_dn):
    """An answer without intervals."""
    count, unknown = len(sigma_dn), np.full(len(sigma_dn), np.nan)
    return NoiseEstimate(sigma_dn, unknown, unknown, np.zeros(count, bool), np.full(count, "", object))


class Ramp:
    """Estimates noise by a patch's number: the first is quiet, the others are noisy."""

    def estimate(self, patches):
        return answer_of(np.arange(len(patches)) * 10.0)


def test_the_prefilter_is_that_of_the_denoised_estimator(frame, patches):
    method = Method("contrast", "mtf", Contrast(), prefilter=PreFilter((5.0,), 10.0, Ramp()))
    rows = measured(frame, patches, methods=[method])
    alone = divide_out_filter(rows)
    part = alone[(alone["experiment"] == "defocus_dcsn") & (alone["filter_px"] == 5)]
    assert part["smoothed"].tolist() == (part["patch"] > 0).tolist() and (part["target_sigma_dn"] == 15).all()
    kernel = next(kernel for kernel in KERNELS if kernel.kind == "defocus")
    condition = Condition(kernel, "dcsn", 15.0, "defocus_dcsn")
    image = SharpFrame(frame, CameraSettings(), 1, paired=False).under(condition).image
    peer = Denoised(Contrast(), lambda batch: Ramp().estimate(batch).sigma_dn, filter_px=5.0).estimate(
        cut(image, patches)
    )
    assert part["estimate"].to_numpy().reshape(peer.mtf.shape) == pytest.approx(peer.mtf, nan_ok=True, abs=2e-4)
    assert part["low"].to_numpy().reshape(peer.mtf.shape) == pytest.approx(peer.low, nan_ok=True, abs=2e-4)
    noisy = (rows["experiment"] == "defocus_dcsn") & (rows["filter_px"] == 0) & (rows["target_sigma_dn"] == 15)
    assert part[part["patch"] == 0]["estimate"].tolist() == rows[noisy & (rows["patch"] == 0)]["estimate"].tolist()


def test_the_patch_shown_has_the_highest_contrast(frame, patches):
    image = frame.image()
    spreads = [float(image[p.y_px + 48 : p.y_px + 144, p.x_px + 48 : p.x_px + 144].std()) for p in patches]
    assert highest_contrast_patch([TestFrame(frame, {"mtf": patches})]) == (frame, patches[int(np.argmax(spreads))])


def test_a_slow_estimator_takes_its_part_only(frame, patches):
    part = Subset(sizes_px=[7], angles_deg=[90], target_sigmas_dn=[15], experiments=["linear_dcsn", "defocus_dcsn"])
    rows = measured(frame, patches, methods=[Method("slow", "mtf", Contrast(), part)])
    blurred = rows[rows["kernel"] != "sharp"]
    assert set(blurred["kernel"]) == {"defocus_7", "linear_motion_7_90"}  # a disc has no rotation
    assert set(blurred["target_sigma_dn"]) == {15} and "photon_defocus" not in set(blurred["experiment"])
    assert (rows["kernel"] == "sharp").any()


def test_earlier_frames_are_corrupted_alike_and_given_along(tmp_path):
    shapes, given = [], []

    class Together(Contrast):
        def estimate_sequences(self, sequences):
            shapes.append(sequences.shape)
            given.append(sequences)
            return self.estimate(sequences.mean(axis=1))

    frame = datasets.open_dataset("kitti", "kitti", make_kitti(tmp_path, frames=1)).frames()[0]
    patches = object_patches(frame.image().shape, frame.boxes)
    method = Method("four", "mtf", Together(), prefilter=PreFilter((5.0,)))
    measured(frame, patches, methods=[method], pairs=PAIRS[:1], kernels=KERNELS[:1])
    # The reference, level 0, noisy, and filtered.
    assert len(shapes) == 4 and set(shapes) == {(len(patches), 4, 1, 192, 192)}
    moments = [cut(read_grey(path), patches) for path in (*frame.previous, frame.path)]
    assert np.array_equal(given[0], np.stack(moments, axis=1))  # in the order that they were taken in


def test_the_disc_is_divided_out_where_enough_is_left(measurements):
    exact = mtf.sample(disc(3.0))

    def both(rows):
        known = [exact["HV".index(axis), np.abs(mtf.FREQUENCIES - f).argmin()]
                 for axis, f in zip(rows["axis"], rows["frequency"], strict=True)]  # fmt: skip
        return rows["truth"] * np.array(known)

    filtered = with_estimates(measurements, both, 3.0)
    alone = divide_out_filter(filtered)
    answered = alone["estimate"].notna()
    assert alone.loc[answered, "estimate"].to_numpy() == pytest.approx(alone.loc[answered, "truth"].to_numpy())
    assert answered.tolist() == (both(filtered) > 0.05).tolist() and 0.2 < answered.mean() < 1
    cells = blur_cells(pd.concat([measurements, filtered]), 1, 5)
    row = cells[(cells["filter_px"] == 3) & ~cells["calibrated"]].iloc[0]
    assert row["amae_percent"] == pytest.approx(0, abs=1e-9) and row["smoothed_fraction"] == 1
    assert row["frequencies_fraction"] == pytest.approx(answered.mean()) and row["abstained"] == 0


def test_a_patch_of_which_nothing_is_left_abstains(measurements):
    filtered = with_estimates(measurements, lambda rows: 0.0, 7.0)
    alone = divide_out_filter(filtered)
    assert alone["abstained"].all() and set(alone["reason"]) == {"noise"}
    cells = blur_cells(pd.concat([measurements, filtered]), 1, 5)
    row = cells[(cells["filter_px"] == 7) & ~cells["calibrated"]].iloc[0]
    assert np.isnan(row["amae_percent"]) and row["count"] == 0 and row["abstained"] > 0


def test_statistics_are_those_of_table_one_where_nothing_is_filtered(measurements):
    cells = blur_cells(measurements, 1, 5)
    chosen = measurements[(measurements["experiment"] == "linear_dcsn") | (measurements["kernel"] == "sharp")]
    for calibrated in (False, True):
        rows = divided_by_sharp(chosen) if calibrated else chosen
        theirs = mtf_cells(rows, MTF_CELL, "blur", 1, 0).set_index(["blur_kind", "target_sigma_dn"])
        ours = cells[(cells["experiment"] == "linear_dcsn") & (cells["calibrated"] == calibrated)]
        assert len(ours) == 2 and (ours["angles"] == 2).all()
        for row in ours.to_dict("records"):
            beside = theirs.loc[("linear_motion", row["target_sigma_dn"])]
            for name in ("amae_percent", "patch_error_percent", "coverage", "count"):
                assert row[name] == pytest.approx(beside[name]), name
            assert row["amae_percent"] == pytest.approx((row["mae_h_percent"] + row["mae_v_percent"]) / 2)


def test_the_error_expected_is_that_of_both_blurs(measurements):
    cells = blur_cells(measurements, 1, 5)
    errors = {("defocus_dcsn", 0.0, 0.0, 7.0): 3.0, (DISC, 0.0, 0.0, 5.0): 4.0,
              ("defocus_dcsn", 15.0, 5.0, 7.0): 9.0}  # fmt: skip
    rows = [
        {**cells.iloc[0].to_dict(), "experiment": name, "target_sigma_dn": level, "filter_px": filter_px,
        "kernel_size_px": size,
         "amae_percent": value, "calibrated": False}
        for (name, level, filter_px, size), value in errors.items()
    ]  # fmt: skip
    result = with_expected(pd.DataFrame(rows))
    assert set(result["experiment"]) == {"defocus_dcsn"}
    assert result[result["filter_px"] == 5]["expected_amae_percent"].tolist() == [5.0]
    assert result[result["filter_px"] == 0]["expected_amae_percent"].isna().all()


def test_noise_behind_the_optics_keeps_its_level_and_noise_before_them_is_blurred(frame):
    rows = measured(frame, [], tiles(frame.image().shape), [Method("pca", "sigma_dn", Registered(noise.create, "pca"))])
    assert written(rows, "sigma_dn", NOISE_READ)["blur_kind"].isin(["defocus", "linear_motion"]).all()
    cells = sigma_cells(rows, 1, 5).set_index(["experiment", "kernel_size_px", "target_sigma_dn"])
    behind, before = (cells.loc[(name, 7.0, 15.0)] for name in ("defocus_dcsn", "photon_defocus"))
    assert behind["unclipped_median_dn"] == pytest.approx(15, rel=0.02)
    assert behind["median_dn"] == pytest.approx(behind["clipped_median_dn"], rel=0.1)
    # White noise through a disc keeps the root of the sum of squares of its weights.
    kernel = next(kernel for kernel in KERNELS if kernel.kind == "defocus")
    left = np.sqrt((kernel.psf.astype(float) ** 2).sum())
    unblurred = cells.loc[("photon_defocus", 0.0, 15.0)]
    assert unblurred["unclipped_median_dn"] > 10
    assert before["unclipped_median_dn"] == pytest.approx(left * unblurred["unclipped_median_dn"], rel=0.15)
    assert before["median_dn"] < 0.2 * behind["median_dn"]
    assert cells.loc[("defocus_dcsn", 7.0, 0.0)]["unclipped_median_dn"] == 0


def test_example_curves_are_medians_of_the_rotation_nearest_to_the_diagonal(measurements):
    curves = example_curves(measurements, 7.0)
    part = curves[(curves["experiment"] == "linear_dcsn") & (curves["target_sigma_dn"] == 15) & ~curves["calibrated"]]
    assert set(part["angle_deg"]) == {0.0} and set(part["axis"]) == {"H", "V", "HV"}  # 0 and 90 are as near
    rows = (measurements["experiment"] == "linear_dcsn") & (measurements["target_sigma_dn"] == 15)
    rows &= (measurements["angle_deg"] == 0) & (measurements["axis"] == "H")
    lowest = measurements[rows & np.isclose(measurements["frequency"], mtf.FREQUENCIES[0])]["estimate"]
    first = part[(part["axis"] == "H") & (part["frequency_index"] == 0)].iloc[0]
    assert first["median"] == pytest.approx(robust_median(lowest.to_numpy()))
    kernel = next(kernel for kernel in KERNELS if kernel.name == "linear_motion_7_0")
    both = part[part["axis"] == "HV"].sort_values("frequency_index")["true_mtf"].to_numpy()
    assert both == pytest.approx(mtf.sample(kernel.psf).mean(axis=0))


def test_the_change_of_a_curve_is_that_of_the_same_frames():
    """Every frame rises by about 0.05, its MTF lies from 0.2 to 0.8: ranges of patches overlap, the change is clear."""
    generator = stream(0, "change of a curve")
    frames = np.repeat([f"f{number}" for number in range(8)], 2)
    before = np.repeat(np.linspace(0.2, 0.8, 8), 2) + generator.normal(scale=0.005, size=16)
    after = before + 0.05 + generator.normal(scale=0.005, size=16)
    low, high = change_interval(before, after, frames, stream(0, "a"), 500)
    assert 0 < low < 0.05 < high < 0.15 and after.min() < before.max()
    flipped = change_interval(after, before, frames, stream(0, "a"), 500)
    np.testing.assert_allclose(flipped, (-high, -low))
    after[:2] = np.nan  # a frame without an estimate counts for neither
    without = change_interval(before[2:], after[2:], frames[2:], stream(0, "a"), 500)
    np.testing.assert_allclose(change_interval(before, after, frames, stream(0, "a"), 500), without)
    assert np.isnan(change_interval(before[:2], before[:2], frames[:2], stream(0, "a"), 500)).all()  # a single frame
    nothing = np.full_like(before, np.nan)
    assert np.isnan(change_interval(nothing, after, frames, stream(0, "a"), 500)).all()


def test_curves_state_their_change_from_the_least_noise(measurements):
    """Of a single frame there is no interval; of two there is, where there is noise."""
    assert example_curves(measurements, 7.0)[list(CHANGES)].isna().all(axis=None)
    twice = pd.concat([measurements, measurements.assign(frame="another", estimate=measurements["estimate"] * 0.9)])
    curves = example_curves(twice, 7.0)
    is_quiet = curves["target_sigma_dn"] == 0
    assert curves.loc[is_quiet, list(CHANGES)].isna().all(axis=None)
    known = curves[~is_quiet & curves["median"].notna()]
    assert len(known) and known["change_low"].notna().all() and (known["change_low"] <= known["change_high"]).all()


def test_a_cell_without_any_estimate_has_counts_but_no_mean():
    rows = {
        "experiment": "defocus_dcsn", "estimator": "mine", "calibrated": False, "filter_px": 0.0,
        "target_sigma_dn": [0.0, 15.0], "amae_percent": [2.0, float("nan")], "count": [3, 0], "abstained": [0, 3],
    }  # fmt: skip
    nested = combined_metrics(pd.DataFrame(rows))["blur"]["defocus_dcsn"]["mine"]["raw"]
    assert nested == {"0": {"amae_percent": 2.0, "count": 3, "abstained": 0}, "15": {"count": 0, "abstained": 3}}


def test_a_mean_over_sizes_needs_every_size():
    rows = {
        "experiment": "defocus_dcsn", "estimator": "mine", "calibrated": False, "filter_px": 0.0,
        "target_sigma_dn": [0.0, 0.0, 15.0, 15.0], "amae_percent": [50.0, 30.0, float("nan"), 31.0],
        "count": [3, 3, 0, 3], "abstained": [0, 0, 3, 0], "median_dn": [0.0, 0.1, 14.0, float("nan")],
        "patch_error_dn": 0.5,
    }  # fmt: skip
    nested = combined_metrics(pd.DataFrame(rows), pd.DataFrame(rows))
    blur_of = nested["blur"]["defocus_dcsn"]["mine"]["raw"]
    assert blur_of["0"]["amae_percent"] == 40.0
    assert blur_of["15"] == {"count": 3, "abstained": 3}  # not the mean of the size that is left
    assert nested["noise"]["defocus_dcsn"]["mine"]["15"] == {"patch_error_dn": 0.5, "abstained": 3}


def test_two_prefilters_of_one_estimator_are_told_apart(frame, patches):
    class Quiet(Ramp):
        """The other way round: the last patch is quiet."""

        def estimate(self, patches):
            return answer_of(np.arange(len(patches))[::-1] * 10.0)

    shared = Contrast()
    methods = [
        Method(name, "mtf", shared, prefilter=PreFilter((5.0,), 10.0, noise))
        for name, noise in (("ramp", Ramp()), ("quiet", Quiet()))
    ]
    together = measured(frame, patches, methods=methods)
    for method in methods:
        alone = measured(frame, patches, methods=[method])
        part = together[together["estimator"] == method.name]
        assert part["estimate"].tolist() == pytest.approx(alone["estimate"].tolist(), nan_ok=True)
        assert part["smoothed"].tolist() == alone["smoothed"].tolist()


@pytest.mark.parametrize(("order", "light"), [("paper", "encoded"), ("detector", "encoded"), ("paper", "linear")])
def test_the_steps_shown_follow_the_camera_and_end_at_the_frame(frame, patches, order, light):
    camera = CameraSettings(order=order, light=light)
    kernel = next(kernel for kernel in KERNELS if kernel.kind == "linear_motion")
    formation = SharpFrame(frame, camera, 1, paired=False).formation(Condition(kernel, "photon", 15.0, "photon_linear"))
    shown = steps(formation, patches[0])
    middle = ["photon", "optics"] if order == "paper" else ["optics", "photon"]
    assert list(shown) == ["scene", *middle, "frame"]
    change = np.abs(shown[middle[1]].astype(int) - shown["frame"])
    assert change.mean() < 0.3 and change.max() <= 6  # whole electrons, which count for more where linear light is dark
