"""Blur and noise at once: the paper's order, the same numbers as the single experiments, smoothing undone."""

import numpy as np
import pytest
from bench_makers import EXPERIMENTS, KERNELS, Contrast, bench, table
from data_makers import make_kitti

from pipeline import datasets
from pipeline.blur import evaluation
from pipeline.blur.denoise import Denoised
from pipeline.condition.combined_answers import cleared
from pipeline.condition.combined_design import Smoothing, Subset, chosen_kernels, spread
from pipeline.condition.combined_example import liveliest
from pipeline.datasets.corrupted import CameraSettings, corrupted
from pipeline.datasets.patches import cut, object_patches
from pipeline.errors import InputError


def test_each_experiment_is_the_single_evaluation_of_its_kernel_and_noise(read, frame, patches):
    for experiment in EXPERIMENTS:
        kernels = [kernel for kernel in KERNELS if kernel.kind == experiment.kind]
        rows = evaluation.evaluate_frame(
            frame, patches, kernels, Contrast(), CameraSettings(), 1, effect=experiment.effect, level_dn=15.0
        )
        own = read[(read["experiment"] == experiment.name) & (read["level_dn"] == 15)]
        assert len(own) == len(rows) == len(kernels) * len(patches) * 16
        assert own["mtf"].tolist() == [row["mtf"] for row in rows]


def test_level_zero_is_one_picture_for_all_experiments(read):
    zero = read[(read["level_dn"] == 0) & (read["kernel"] == "defocus_7")]
    one, other = (zero[zero["experiment"] == name]["mtf"].tolist() for name in ("defocus_dcsn", "photon_defocus"))
    assert one == other and len(one) > 0


def test_smoothing_is_that_of_the_denoised_estimator(frame, patches):
    def sigma(seen):
        return np.arange(len(seen)) * 10.0  # the first patch is quiet, the others are noisy

    smoothing = Smoothing((5.0,), 10.0, sigma)
    made = table(bench(smoothing=smoothing).evaluate(frame, patches, [])[0])
    clear = cleared(made)
    own = clear[(clear["experiment"] == "defocus_dcsn") & (clear["filter_px"] == 5)]
    assert own["smoothed"].tolist() == (own["patch"] > 0).tolist() and (own["level_dn"] == 15).all()
    kernel = next(kernel for kernel in KERNELS if kernel.kind == "defocus")
    image = corrupted(frame.image(), frame, "dcsn", 15.0, CameraSettings(), 1, kernel.psf, kernel.name).image
    peer = Denoised(Contrast(), sigma, filter_px=5.0).estimate(cut(image, patches))
    assert own["mtf"].to_numpy().reshape(peer.mtf.shape) == pytest.approx(peer.mtf, nan_ok=True)
    assert own["low"].to_numpy().reshape(peer.mtf.shape) == pytest.approx(peer.low, nan_ok=True)
    plain = made[(made["experiment"] == "defocus_dcsn") & (made["filter_px"] == 0) & (made["level_dn"] == 15)]
    assert own[own["patch"] == 0]["mtf"].tolist() == plain[plain["patch"] == 0]["mtf"].tolist()


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
