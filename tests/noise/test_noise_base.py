"""The contract all noise estimators share: input checks, abstentions, invariances, recovery of a known level."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import noise
from pipeline.camera.saturation import SATURATED
from pipeline.errors import InputError
from pipeline.noise.base import COMPRESSED, FLAT, UNCERTAIN, Estimator, Measured, as_stack, assemble, screen
from pipeline.streams import stream

NAMES = ["bf", "immerkaer", "pca", "wavelet"]


def smooth_textures(count: int, amplitude_dn: float, *key: str) -> np.ndarray:
    """Noise-free patches of slow waves around mid grey, (count, 1, 128, 128), DN."""
    draw = stream(7, "smooth", *key)
    rows, columns = np.mgrid[:128, :128] / 128.0
    patches = np.zeros((count, 1, 128, 128))
    for patch in patches:
        for _ in range(4):
            fx, fy = draw.uniform(-1.5, 1.5, 2)
            patch[0] += np.sin(2 * np.pi * (fx * columns + fy * rows) + draw.uniform(0, 6.28))
        patch *= amplitude_dn / np.abs(patch).max()
    return patches + 128.0


def noisy(patches_dn: np.ndarray, sigma_dn: float, *key: str) -> np.ndarray:
    """White Gaussian noise added, as float32 in [0, 1]."""
    noise_dn = stream(7, "noise", sigma_dn, *key).normal(0.0, sigma_dn, patches_dn.shape)
    return (np.clip(patches_dn + noise_dn, 0, 255) / 255).astype(np.float32)


# Ratios estimate / truth measured on 24 such patches, medians: PCA .97 .. .99, wavelet .99 .. 1.00, Immerkaer 1.00;
# B+F .90 .. 1.03 (its filter keeps part of the noise when it is wide: .90 at 20 DN).
BANDS = {"pca": (0.95, 1.01), "bf": (0.88, 1.06), "wavelet": (0.97, 1.02), "immerkaer": (0.985, 1.015)}


@pytest.mark.parametrize("sigma_dn", [2.0, 5.0, 10.0, 20.0])
@pytest.mark.parametrize("name", NAMES)
def test_recovers_a_known_level_on_smooth_textures(name: str, sigma_dn: float) -> None:
    estimate = noise.create(name).estimate(noisy(smooth_textures(12, 40.0), sigma_dn))
    assert not estimate.abstained.any()
    low, high = BANDS[name]
    assert low < np.median(estimate.sigma_dn) / sigma_dn < high


@pytest.mark.parametrize("name", NAMES)
def test_grows_with_the_level(name: str) -> None:
    texture = smooth_textures(3, 30.0)
    medians = [np.median(noise.create(name).estimate(noisy(texture, s)).sigma_dn) for s in (1, 2, 4, 8, 16, 25)]
    assert np.all(np.diff(medians) > 0)


@pytest.mark.parametrize("name", ["immerkaer", "pca", "wavelet"])
def test_scales_with_the_contrast(name: str) -> None:
    """Not B+F: the width of its filter in pixels is its first guess of the noise in DN."""
    patches = noisy(smooth_textures(3, 30.0), 10.0).astype(np.float64)
    estimator = noise.create(name)
    full, half = estimator.estimate(patches).sigma_dn, estimator.estimate(patches * 0.5).sigma_dn
    np.testing.assert_allclose(half, 0.5 * full, rtol=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_does_not_feel_an_added_constant(name: str) -> None:
    patches = noisy(smooth_textures(3, 30.0), 5.0).astype(np.float64)
    estimator = noise.create(name)
    before, after = estimator.estimate(patches).sigma_dn, estimator.estimate(patches + 20.0 / 255.0).sigma_dn
    np.testing.assert_allclose(after, before, rtol=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_each_patch_stands_alone(name: str) -> None:
    """A batch, its permutation and its members one by one give the same answers, whatever shares the batch."""
    patches = np.concatenate([noisy(smooth_textures(10, 30.0), s, "alone") for s in (0.2, 3.0, 25.0)])
    patches[4] = 0.5
    patches[11] = np.round(patches[11] * 255) / 255
    estimator = noise.create(name)
    together = estimator.estimate(patches)
    order = stream(1, "order").permutation(len(patches))
    shuffled = estimator.estimate(patches[order])
    np.testing.assert_allclose(shuffled.sigma_dn, together.sigma_dn[order], rtol=1e-6)
    assert list(shuffled.reason) == list(together.reason[order])
    single = np.array([estimator.estimate(patch[None]).sigma_dn[0] for patch in patches])
    np.testing.assert_allclose(single, together.sigma_dn, rtol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_flat_and_saturated_patches_abstain_with_a_reason(name: str) -> None:
    patches = noisy(smooth_textures(5, 30.0), 5.0)
    patches[0] = 0.5
    patches[1] = 1.0
    patches[2, :, :, :80] = 1.0
    patches[3, :, :90] = 0.0
    estimate = noise.create(name).estimate(patches)
    assert list(estimate.reason) == [FLAT, SATURATED, SATURATED, SATURATED, ""]
    assert list(estimate.abstained) == [True, True, True, True, False]
    for numbers in (estimate.sigma_dn, estimate.low_dn, estimate.high_dn):
        assert np.isnan(numbers[:4]).all()
    assert np.isfinite(estimate.sigma_dn[4])


@pytest.mark.parametrize("name", NAMES)
def test_takes_torch_float64_odd_sizes_and_an_empty_batch(name: str) -> None:
    import torch

    patches = noisy(smooth_textures(2, 30.0), 5.0)
    estimator = noise.create(name)
    expected = estimator.estimate(patches).sigma_dn
    np.testing.assert_array_equal(estimator.estimate(torch.from_numpy(patches)).sigma_dn, expected)
    np.testing.assert_allclose(estimator.estimate(patches.astype(np.float64)).sigma_dn, expected, rtol=1e-5)
    odd = estimator.estimate(patches[:, :, :101, :77]).sigma_dn
    np.testing.assert_allclose(odd, expected, rtol=0.25)
    assert len(estimator.estimate(patches[:0])) == 0


@pytest.mark.parametrize("name", NAMES)
def test_input_is_not_changed(name: str) -> None:
    patches = noisy(smooth_textures(2, 30.0), 5.0)
    before = patches.copy()
    noise.create(name).estimate(patches)
    np.testing.assert_array_equal(patches, before)


@pytest.mark.parametrize(
    ("patches", "words"),
    [
        (np.zeros((128, 128), np.float32), "shape"),
        (np.zeros((1, 3, 128, 128), np.float32), "shape"),
        (np.zeros((1, 1, 128, 128), np.uint8), "255"),
        (np.full((1, 1, 128, 128), 128.0, np.float32), "patch 0 spans 128"),
        (np.full((1, 1, 128, 128), -0.1, np.float32), "patch 0"),
        (np.full((1, 1, 128, 128), np.nan, np.float32), "nan"),
        (np.zeros((1, 1, 7, 128), np.float32), "at least"),
        ("picture.png", "str"),
    ],
)
@pytest.mark.parametrize("name", NAMES)
def test_wrong_input_is_named(name: str, patches: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        noise.create(name).estimate(patches)  # type: ignore[arg-type]


def test_the_offending_patch_is_named() -> None:
    patches = np.zeros((4, 1, 64, 64), np.float32)
    patches[2, 0, 5, 5] = np.nan
    with pytest.raises(InputError, match="patch 2"):
        as_stack(patches, 8)


def test_unknown_names_and_options_are_named() -> None:
    assert set(NAMES) <= set(noise.REGISTRY.names())
    with pytest.raises(InputError, match="did you mean 'pca'"):
        noise.create("pcaa")
    with pytest.raises(InputError, match="saturated_fraction"):
        noise.create("pca", saturated_fraction=0.0)
    with pytest.raises(InputError, match="rule"):
        noise.create("pca", rule="shin")
    with pytest.raises(InputError, match="windows"):
        noise.create("pca", windows=3)


@given(share=st.floats(0.0, 1.0), limit=st.floats(0.05, 1.0), white=st.booleans())
def test_saturation_is_a_share_of_pixels(share: float, limit: float, white: bool) -> None:
    stack = np.linspace(0.3, 0.7, 32 * 32, dtype=np.float32).reshape(1, 32, 32).copy()
    clipped = round(share * 32 * 32)
    stack.reshape(-1)[:clipped] = 1.0 if white else 0.0
    expected = clipped > 0 and clipped >= limit * 32 * 32
    assert (screen(stack, limit)[0] == SATURATED) == expected


def test_numbers_below_the_rounding_of_a_picture_are_no_estimates() -> None:
    estimate = assemble(Measured(np.array([np.nan, 0.0, 1e-4, 0.5])), np.full(4, "", dtype=object))
    assert list(estimate.reason) == [FLAT, FLAT, FLAT, ""]


class Deviation(Estimator):
    """The standard deviation of the pixels: all that a third party writes."""

    min_size_px = 4

    def measure(self, stack, reason):
        reason[stack[:, 0, 0] == 0.25] = "marked"
        return Measured(255 * stack.std(axis=(1, 2), dtype=np.float64))


def test_a_subclass_only_measures():
    patches = (0.3 + 0.1 * stream(1, "subclass").standard_normal((4, 1, 32, 32))).clip(0.01, 0.99)
    patches[1], patches[2, 0, 16:], patches[3, 0, 0, 0] = 0.5, 1.0, 0.25
    answer = Deviation().estimate(patches)
    assert list(answer.reason) == ["", FLAT, SATURATED, "marked"]
    assert answer.sigma_dn[0] == pytest.approx(25.5, rel=0.1)
    assert np.isnan(answer.sigma_dn[1:]).all() and np.isnan(answer.low_dn).all()
    assert Deviation(saturated_fraction=0.6).estimate(patches).reason[2] == ""
    whole = Deviation(quantise_like_paper=True).estimate(patches)
    assert not whole.abstained.any() and whole.sigma_dn[1] == 0 and whole.sigma_dn[0] % 1 == 0
    with pytest.raises(InputError, match="at least 4 x 4 px"):
        Deviation().estimate(patches[..., :3])
    with pytest.raises(InputError, match="saturated_fraction"):
        Deviation(saturated_fraction=0.0)


def test_a_subclass_that_states_no_least_size_takes_patches_of_16_px():
    class Unstated(Estimator):
        def measure(self, stack, reason):
            return Measured(np.full(len(stack), 5.0))

    patches = noisy(smooth_textures(2, 30.0), 5.0)
    assert not Unstated().estimate(patches[..., :16, :16]).abstained.any()
    with pytest.raises(InputError, match="at least 16 x 16 px"):
        Unstated().estimate(patches[..., :15])


def test_the_bound_is_known_where_a_codec_hides_the_noise_and_nowhere_else_without_an_estimate() -> None:
    four = np.full(4, 4.0)
    reason = np.array(["", COMPRESSED, UNCERTAIN, FLAT], dtype=object)
    estimate = assemble(Measured(four, four - 1, four + 1), reason)
    np.testing.assert_array_equal(estimate.at_most_dn, [5.0, 5.0, np.nan, np.nan])
    np.testing.assert_array_equal(estimate.high_dn, [5.0, np.nan, np.nan, np.nan])
    assert assemble(Measured(four), reason).at_most_dn is None


def test_what_is_no_number_is_an_abstention_whatever_its_interval():
    level = np.array([np.nan, np.inf, -3.0, 0.0, 2.0])
    estimate = assemble(Measured(level, np.zeros(5), np.full(5, 5.0)), np.full(5, "", dtype=object))
    assert estimate.abstained.tolist() == [True, True, True, False, False]
    assert estimate.reason[:3].tolist() == [FLAT] * 3
    assert np.isnan(estimate.sigma_dn[:3]).all() and np.isnan(estimate.high_dn[:3]).all()


class OneForAll(Estimator):
    """Answers with a given field of the wrong shape."""

    min_size_px = 8

    def __init__(self, name: str, **options: bool) -> None:
        super().__init__(**options)
        self.name = name

    def measure(self, stack, reason):  # type: ignore[no-untyped-def]
        if self.name == "array":
            return np.full(len(stack), 5.0)
        if self.name == "text":
            return Measured(np.full(len(stack), "a"))
        fields = dict.fromkeys(("sigma_dn", "low_dn", "high_dn"), np.full(len(stack), 5.0))
        return Measured(**{**fields, self.name: np.array([5.0])})


@pytest.mark.parametrize("as_published", [False, True])
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("sigma_dn", r"sigma_dn has shape \(1,\), expected \(4,\)"),
        ("low_dn", r"low_dn has shape \(1,\), expected \(4,\)"),
        ("white_sigma_dn", r"white_sigma_dn has shape \(1,\), expected \(4,\)"),
        ("text", "sigma_dn has the data type <U1, expected numbers"),
        ("array", "returned ndarray, expected pipeline.noise.base.Measured"),
    ],
)
def test_an_estimator_has_one_number_for_each_patch(name: str, words: str, as_published: bool) -> None:
    patches = noisy(smooth_textures(4, 30.0), 5.0)
    with pytest.raises(InputError, match=words):
        OneForAll(name, quantise_like_paper=as_published).estimate(patches)


@pytest.mark.parametrize("name", [*NAMES, "cellwise", "adaptive"])
def test_masked_arrays_are_refused(name: str) -> None:
    patches = np.ma.masked_greater(noisy(smooth_textures(2, 30.0), 5.0), 0.55)
    with pytest.raises(InputError, match="masked arrays"):
        noise.create(name).estimate(patches)
