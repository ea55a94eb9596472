"""Default noise estimator: white noise as by cellwise, processed noise as by correlated, abstentions where unsure."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from skimage import data
from test_noise_correlated import flat

from pipeline import noise
from pipeline.camera.processing import codec, presets, temporal_noise
from pipeline.camera.processing.develop import grey
from pipeline.condition import ConditionMonitor
from pipeline.datasets.decoding.pictures import read_grey8
from pipeline.errors import InputError
from pipeline.noise import adaptive
from pipeline.noise.abstentions import FORESHORTENED, WEAK_DN
from pipeline.noise.adaptive import (
    OFFSET,
    REAL_CAMERAS,
    SLOPE,
    WIDEST_COMPRESSED_REACH,
    WIDEST_QUANTISED_REACH,
    WIDEST_REACH,
    Adaptive,
    weights,
)
from pipeline.noise.base import COMPRESSED, UNCERTAIN
from pipeline.noise.networks.correlated_features import anisotropy
from pipeline.noise.traces.codec import codec_traces
from pipeline.streams import stream

ADAPTIVE = noise.create("adaptive")


def stack(*patches):
    return np.stack(patches)[:, None] / np.float32(255)


def test_plainly_white_noise_is_answered_by_cellwise():
    patches = stack(flat(4), flat(10), flat(15))
    estimate = ADAPTIVE.estimate(patches)
    assert estimate.sigma_dn == pytest.approx(noise.create("cellwise").estimate(patches).sigma_dn, rel=1e-6)
    assert estimate.white_sigma_dn == pytest.approx(estimate.sigma_dn)


def added_laplacian(field):
    return cv2.filter2D(field, -1, np.array([[0, -0.5, 0], [-0.5, 3, -0.5], [0, -0.5, 0]], np.float32))


def scaled(factor, interpolation):
    return lambda field: cv2.resize(field, None, fx=factor, fy=factor, interpolation=interpolation)


def processed_noise(process, sigma_dn):
    """Nine patches of grey with noise that was processed so and then has this deviation."""
    field = process(stream(7, "processed").standard_normal((800, 800), dtype=np.float32))
    field *= np.float32(sigma_dn / field.std())
    corners = [(y, x) for y in range(0, 257, 128) for x in range(0, 257, 128)]
    patches = stack(*(np.clip(np.rint(120 + field[y : y + 128, x : x + 128]), 0, 255) for y, x in corners))
    return patches.astype(np.float32)


SHARPENED = {
    "added Laplacian": added_laplacian,
    "Lanczos": scaled(0.7, cv2.INTER_LANCZOS4),
    "cubic": scaled(0.5, cv2.INTER_CUBIC),
}


@pytest.mark.parametrize("sharpen", SHARPENED.values(), ids=SHARPENED)
def test_sharpened_noise_is_read_where_cellwise_reads_a_sixth_too_much(sharpen):
    patches = processed_noise(sharpen, 8)
    estimate, white = ADAPTIVE.estimate(patches), noise.create("cellwise").estimate(patches)
    assert np.median(white.sigma_dn) > 7 / 6 * 8 and (white.low_dn > 8).all()
    assert not estimate.abstained.any() and np.median(estimate.sigma_dn) == pytest.approx(8, rel=0.1)
    assert ((estimate.low_dn <= 8) & (estimate.high_dn >= 8)).mean() >= 7 / 9


@pytest.mark.parametrize("sigma_dn", [5, 10])
def test_noise_of_a_frame_scaled_down_is_read_where_cellwise_reads_three_quarters_at_most(sigma_dn):
    patches = processed_noise(scaled(0.8, cv2.INTER_AREA), sigma_dn)
    estimate, white = ADAPTIVE.estimate(patches), noise.create("cellwise").estimate(patches)
    assert np.median(white.sigma_dn) < 0.75 * sigma_dn
    assert not estimate.abstained.any() and estimate.sigma_dn == pytest.approx(np.full(9, sigma_dn), rel=0.15)
    assert ((estimate.low_dn <= sigma_dn) & (estimate.high_dn >= sigma_dn)).all()


def test_smoothed_noise_has_a_wide_answer_where_both_networks_see_it_but_none_on_a_lawn_without_noise(monkeypatch):
    """To the second network the lawn looks like smoothed noise of 15 DN; `cellwise` sees next to none."""
    picture = data.camera()
    lawn = stack(picture[384:512, 384:512].astype(np.float32))
    generator = stream(3, "scaled photograph")
    noisy = [picture + 12 * generator.standard_normal(picture.shape) for _ in range(4)]
    shots = np.stack([scaled(0.7, cv2.INTER_AREA)(np.clip(np.rint(shot), 0, 255).astype(np.uint8)) for shot in noisy])
    squares = [shots[:, y : y + 128, x : x + 128] for y in (0, 64, 128) for x in (0, 64, 128, 192)]
    truth = np.array([temporal_noise.measure(square).sigma_dn for square in squares])
    patches = stack(*(square[0].astype(np.float32) for square in squares))
    estimate = ADAPTIVE.estimate(patches)
    answered = ~estimate.abstained
    assert answered.sum() > 6 and estimate.sigma_dn[answered] == pytest.approx(truth[answered], rel=0.25)
    assert ADAPTIVE.estimate(lawn).abstained and ADAPTIVE.correlated.predict(lawn[:, 0]).sigma_dn > 10
    with monkeypatch.context() as narrower:
        narrower.setattr(adaptive, "WIDEST_SMOOTHED_REACH", WIDEST_REACH)
        assert (~ADAPTIVE.estimate(patches).abstained).sum() < answered.sum()
    monkeypatch.setattr(adaptive, "SEEN_BY_BOTH", (0.0, 0.01))
    assert not ADAPTIVE.estimate(lawn).abstained


@pytest.mark.parametrize("side", [48, 64, 128])
def test_white_noise_hardly_ever_looks_sharpened_in_patches_of_any_size(side):
    patches = np.stack([flat(8, key=f"white {number}", side=side) for number in range(40)]) / np.float32(255)
    assert (adaptive._screened(patches).sharpened > 0).mean() <= 0.15


def test_noise_of_a_phone_is_read_where_cellwise_answers_zero():
    scene = np.full((160, 160, 3), 0.18, np.float32)
    camera = presets.named("phone").at_iso(1600)
    shots = np.stack([grey(camera.shoot(scene, stream(1, "phone", index)))[16:-16, 16:-16] for index in range(4)])
    truth = temporal_noise.measure(shots).sigma_dn
    estimate = ADAPTIVE.estimate(shots[:, None] / np.float32(255))
    assert not estimate.abstained.any()
    assert np.abs(estimate.sigma_dn - truth).max() < max(0.25 * truth, 0.5)
    assert ((estimate.low_dn <= truth) & (truth <= estimate.high_dn)).mean() >= 0.75
    assert (noise.create("cellwise").estimate(shots[:, None] / np.float32(255)).sigma_dn < 0.5 * truth).all()


def test_intervals_hold_their_estimate_and_nothing_is_negative():
    estimate = ADAPTIVE.estimate(stack(flat(0.5), flat(3), flat(3, 0.9), flat(15, 0.7), flat(25)))
    answered = ~estimate.abstained
    assert (estimate.low_dn[answered] <= estimate.sigma_dn[answered] + 1e-9).all()
    assert (estimate.sigma_dn[answered] <= estimate.high_dn[answered] + 1e-9).all()
    assert (estimate.low_dn[answered] >= 0).all()
    assert (estimate.white_sigma_dn[answered] <= estimate.sigma_dn[answered] + 1e-9).all()


def test_wide_intervals_become_abstentions_with_their_reason():
    strict = Adaptive(widest_reach=1e-3)
    estimate = strict.estimate(stack(flat(6, 0.9), flat(8)))
    assert estimate.abstained[0] and estimate.reason[0] in (COMPRESSED, UNCERTAIN)
    assert not estimate.abstained[1]  # white: the interval of cellwise is not judged by it
    white = Adaptive(widest_white_reach=1e-3).estimate(stack(flat(8)))
    assert white.reason[0] == UNCERTAIN
    coded = codec.jpeg(np.repeat(flat(6, 0.9).astype(np.uint8)[..., None], 3, axis=2), 60)[None, ..., 0]
    behind_a_codec = stack(*coded.astype(np.float32))
    assert not ADAPTIVE.estimate(behind_a_codec).abstained
    assert Adaptive(widest_compressed_reach=1e-3).estimate(behind_a_codec).reason[0] == COMPRESSED


def test_noise_that_looks_white_is_none_for_cellwise_alone_where_a_codec_shows_at_the_corner():
    """JPEG 90 leaves noise of 8 DN white; off its grid nothing shows."""
    coded = codec.jpeg(np.repeat(flat(8, side=256).astype(np.uint8)[..., None], 3, axis=2), 90)[..., 0]
    patches = stack(coded[:128, :128].astype(np.float32), coded[3:131, 5:133].astype(np.float32))
    estimate, white = ADAPTIVE.estimate(patches), noise.create("cellwise").estimate(patches)
    assert (np.isclose(estimate.sigma_dn, white.sigma_dn, rtol=1e-6) == [False, True]).all()


@pytest.mark.parametrize(("sigma_dn", "answered_fraction"), [(0, 0.4), (2, 0.15), (5, 0.4)])
def test_noise_hidden_by_foliage_is_not_answered(shared, sigma_dn, answered_fraction):
    """Trees and gravel, rendered: patches that hide weak noise are abstained from, the others are right."""
    files = sorted((shared / "realdata/sim_authors/images").glob("*.tiff"))
    if not files:
        pytest.skip("frames absent: ../shared/realdata/sim_authors")
    tiles = np.concatenate([sliding_window_view(read_grey8(file), (128, 128))[::213, ::256] for file in files])
    clean = tiles.reshape(-1, 128, 128).astype(float)
    noisy = np.rint(clean + sigma_dn * stream(3, "foliage").standard_normal(clean.shape)).clip(0, 255)
    estimate = ADAPTIVE.estimate(stack(*noisy))
    answered = ~estimate.abstained
    error_dn = np.abs(estimate.sigma_dn[answered] - sigma_dn)
    assert answered.mean() > answered_fraction
    assert np.median(error_dn) < 0.5 and error_dn.mean() < 1


def test_noise_that_a_video_codec_removed_is_not_read_as_zero():
    """H.264 leaves surfaces that look noise-free; the decoded frames still differ from shot to shot."""
    scene = data.coffee()[40:296, 200:456].astype(np.float64)
    frames = []
    for number in range(3):
        noise_dn = stream(1, "video", number).normal(0, 5, scene.shape[:2])
        frames.append(np.clip(np.rint(scene + noise_dn[..., None]), 0, 255).astype(np.uint8))
    decoded = codec.store(frames[-1], codec.Codec("h264", 28), frames[:-1]).mean(axis=2)
    patches = stack(*(decoded[y : y + 128, x : x + 128].astype(np.float32) for y in (0, 128) for x in (0, 128)))
    white = noise.create("cellwise").estimate(patches)
    estimate = ADAPTIVE.estimate(patches)
    vanished = white.sigma_dn < 1
    assert vanished.sum() >= 2
    assert (estimate.reason[vanished] == COMPRESSED).mean() > 0.5


@pytest.mark.parametrize("quality", [60, 80])
def test_strong_noise_behind_jpeg_is_read_with_an_interval_that_holds_it(quality):
    """Quantisation reshapes white noise; the interval of `cellwise` is too narrow for what is left."""
    scene = data.coffee()[40:296, 200:456].mean(axis=2)
    shots = []
    for number in range(4):
        noisy = scene + stream(1, "strong noise", number).normal(0, 20, scene.shape)
        whole = np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
        shots.append(codec.jpeg(whole, quality)[..., 0])
    truth = temporal_noise.measure(np.stack(shots)[:, :128, :128]).sigma_dn
    estimate = ADAPTIVE.estimate(stack(*(shot[:128, :128].astype(np.float32) for shot in shots)))
    assert not estimate.abstained.any()
    assert estimate.sigma_dn == pytest.approx(np.full(4, truth), rel=0.2)
    assert ((estimate.low_dn <= truth) & (truth <= estimate.high_dn)).all()


def test_noise_behind_a_mild_codec_is_read_wherever_the_patch_was_cut():
    """It is nearly white, but quantised; off the codec's grid that does not show at the patch's corner."""
    scene, right = data.astronaut()[:256, :256].mean(axis=2), []
    for name, quality, sigma_dn in (("jpeg", 90, 5), ("mjpeg", 5, 10)):
        shots = []
        for number in range(4):
            noisy = scene + stream(1, "mild codec", number).normal(0, sigma_dn, scene.shape)
            whole = np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
            shots.append(codec.store(whole, codec.Codec(name, quality))[3:131, 5:133, 0])
        truth = temporal_noise.measure(np.stack(shots)).sigma_dn
        estimate = ADAPTIVE.estimate(stack(*(shot.astype(np.float32) for shot in shots)))
        held = (estimate.low_dn <= truth) & (truth <= estimate.high_dn)
        right += list(held & (np.abs(estimate.sigma_dn - truth) < 0.2 * truth))
    assert sum(right) >= 6


def test_grain_without_a_codec_is_answered_only_where_the_network_is_sure(monkeypatch):
    """Asphalt and gravel look like noise that was smoothed; behind a codec a camera is the likelier cause."""
    grain = flat(6, 0.9)
    coded = cv2.imdecode(cv2.imencode(".jpg", grain.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 85])[1], 0)
    patches, estimator = stack(grain, coded.astype(np.float32)), Adaptive()
    answer, reasons = estimator.correlated.predict(patches[:, 0]), []
    for reach in (0.9 * WIDEST_REACH, 1.5 * WIDEST_REACH, 1.1 * WIDEST_QUANTISED_REACH):
        given = replace(answer, reach=np.full(2, reach / REAL_CAMERAS))
        monkeypatch.setattr(estimator.correlated, "predict", lambda *_, given=given: given)
        reasons.append(tuple(estimator.estimate(patches).reason))
    assert reasons == [("", ""), (UNCERTAIN, ""), (UNCERTAIN, COMPRESSED)]


def test_fine_quantisation_alone_allows_a_wider_interval_than_a_strong_codec(monkeypatch):
    """JPEG of quality 98 shows by its quantised blocks only."""
    coded = cv2.imdecode(cv2.imencode(".jpg", flat(6, 0.9).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 98])[1], 0)
    patches, estimator = stack(coded.astype(np.float32)), Adaptive()
    answer, reasons = estimator.correlated.predict(patches[:, 0]), []
    traces = codec_traces(answer.statistics, coded.size)
    assert traces.quantised.all() and not traces.strong.any()
    for reach in (1.1 * WIDEST_COMPRESSED_REACH, 1.1 * WIDEST_QUANTISED_REACH):
        given = replace(answer, reach=np.full(1, reach / REAL_CAMERAS))
        monkeypatch.setattr(estimator.correlated, "predict", lambda *_, given=given: given)
        reasons += list(estimator.estimate(patches).reason)
    assert reasons == ["", COMPRESSED]


@pytest.mark.parametrize("rate", [23, 28])
def test_weak_noise_behind_h264_is_not_read_as_zero(rate):
    """Noise of 2 DN: the codec removes it, while its own error differs from shot to shot by 2 to 5 DN."""
    scene = data.camera().astype(np.float64)
    shots = []
    for number in range(4):
        draw = stream(1, "weak noise", rate, number)
        frames = [np.rint(scene + draw.normal(0, 2, scene.shape)).clip(0, 255).astype(np.uint8) for _ in range(3)]
        video = [np.repeat(frame[..., None], 3, axis=2) for frame in frames]
        shots.append(codec.store(video[-1], codec.Codec("h264", rate), video[:-1]).mean(axis=2).round())
    decoded = np.stack(shots)
    corners = [(y, x) for y in range(0, 512, 128) for x in range(0, 512, 128)]
    tiles = np.stack([decoded[:, y : y + 128, x : x + 128] for y, x in corners])
    truth = np.sqrt(tiles.var(axis=1, ddof=1).mean(axis=(1, 2)))
    estimate = ADAPTIVE.estimate(stack(*tiles[:, 0].astype(np.float32)))
    assert ((truth > 1.5) & (estimate.sigma_dn < 0.5)).mean() <= 0.07
    assert (estimate.reason[truth > 1.5] == COMPRESSED).mean() > 0.6


def test_cellwise_runs_only_where_it_has_a_weight(monkeypatch):
    """Coded and clearly correlated patches are answered alike whatever `cellwise` would estimate."""
    coded = cv2.imdecode(cv2.imencode(".jpg", flat(8).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 60])[1], 0)
    patches = stack(flat(5, 0.9), coded.astype(np.float32), flat(9))
    estimator = Adaptive()
    expected, counted, measure = estimator.estimate(patches), [], estimator.white.measure_cells

    def counting(part, reason):
        counted.append(len(part))
        return measure(part, reason)

    monkeypatch.setattr(estimator.white, "measure_cells", counting)
    assert estimator.estimate(patches).sigma_dn == pytest.approx(expected.sigma_dn, rel=1e-6)
    assert sum(counted) == 1


def test_the_second_network_is_believed_where_it_reads_more_the_sooner_the_more_processing_shows():
    white_dn = np.array([10.0, 10.0, 10.0, 0.5, 5.0])
    correlated_dn = np.array([10.0, 20.0, 5.0, 5.0, 5.5])
    free, half, coded = (weights(white_dn, correlated_dn, np.full(5, shown)) for shown in (0.0, 0.5, 1.0))
    assert free[0] < 0.05 < 0.5 < free[1] < 1 and free[2] < 0.001 and free[3] > 0.95
    assert (coded > half).all() and (half > free).all() and coded[4] > 0.45 > free[4]
    apart = np.log1p(correlated_dn) - np.log1p(white_dn)
    assert np.log(free / (1 - free)) == pytest.approx(OFFSET + SLOPE * apart)


def test_noise_of_scaled_frames_is_not_taken_for_less():
    """Scaling leaves noise nearly white but for its finest part, by which `cellwise` knows it."""
    scene = cv2.GaussianBlur(data.camera(), (0, 0), 1.5).astype(np.float64)
    shots = []
    for number in range(4):
        noisy = scene + stream(1, "scaled", number).normal(0, 15, scene.shape)
        shots.append(cv2.resize(np.clip(noisy, 0, 255), None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA).round())
    pieces = [np.stack(shots)[:, y : y + 128, x : x + 128] for y in (0, 128) for x in (0, 128)]
    truth = np.array([temporal_noise.measure(piece.astype(np.uint8)).sigma_dn for piece in pieces])
    patches = stack(*(piece[0].astype(np.float32) for piece in pieces))
    white, estimate = noise.create("cellwise").estimate(patches), ADAPTIVE.estimate(patches)
    answered = ~estimate.abstained
    assert answered.sum() >= 2
    assert ((estimate.low_dn <= truth) & (truth <= 1.01 * estimate.high_dn))[answered].all()
    assert (white.high_dn < truth).all()
    assert (np.abs(estimate.sigma_dn - truth) < np.abs(white.sigma_dn - truth))[answered].all()


def test_noise_that_texture_hides_is_within_the_interval():
    """Noise of frames that were turned is no longer white; of grass, one answer in five held it before."""
    scene, matrix = cv2.GaussianBlur(data.grass(), (0, 0), 1), cv2.getRotationMatrix2D((256, 256), 2, 1)
    shots = []
    for number in range(3):
        noisy = np.clip(np.rint(scene + stream(1, "turned", number).normal(0, 2, scene.shape)), 0, 255)
        shots.append(cv2.warpAffine(noisy.astype(np.uint8), matrix, (512, 512), borderMode=cv2.BORDER_REFLECT))
    corners = [(y, x) for y in range(0, 385, 64) for x in range(0, 385, 64)]
    pieces = [np.stack(shots)[:, y : y + 128, x : x + 128] for y, x in corners]
    truth = np.array([temporal_noise.measure(piece).sigma_dn for piece in pieces])
    estimate = ADAPTIVE.estimate(stack(*(piece[0].astype(np.float32) for piece in pieces)))
    answered = ~estimate.abstained
    assert answered.sum() >= 5 and np.median(estimate.sigma_dn[answered]) < 0.6 * np.median(truth)
    assert ((estimate.low_dn <= truth) & (truth <= estimate.high_dn))[answered].all()


def test_what_a_bilateral_filter_leaves_of_noise_is_not_answered_as_white():
    scene = cv2.GaussianBlur(data.astronaut()[..., 1], (0, 0), 1)
    noisy = scene + stream(1, "bilateral").normal(0, 10, scene.shape)
    filtered = cv2.bilateralFilter(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), 5, 25, 2).astype(np.float32)
    corners = [(y, x) for y in range(0, 512, 128) for x in range(0, 512, 128)]
    patches = stack(*(filtered[y : y + 128, x : x + 128] for y, x in corners))
    assert not noise.create("cellwise").estimate(patches).abstained.any()  # 1 to 2.5 DN of 4 to 5
    reasons = ADAPTIVE.estimate(patches).reason.tolist()
    assert reasons.count(UNCERTAIN) >= 11 and set(reasons) <= {UNCERTAIN, ""}


def test_answers_do_not_depend_on_the_batch():
    patches = stack(flat(3, 0.9), flat(9), flat(6, 0.6))
    together = ADAPTIVE.estimate(patches).sigma_dn
    alone = np.concatenate([ADAPTIVE.estimate(patch[None]).sigma_dn for patch in patches])
    assert together == pytest.approx(alone, rel=1e-5)


def test_maps_cover_every_cell():
    estimate, cells = ADAPTIVE.estimate_cells(stack(flat(5, 0.9), flat(9)))
    assert cells.shape == (2, 16, 16) and np.isfinite(cells).all()
    assert np.sqrt((cells**2).mean(axis=(1, 2))) == pytest.approx(estimate.sigma_dn, rel=0.05)
    whole = ADAPTIVE.map(flat(5, 0.9, side=200) / np.float32(255))
    assert whole.shape == (25, 25) and np.isfinite(whole).all()  # no multiple of the step between tiles
    odd = ADAPTIVE.map(flat(9, side=201) / np.float32(255))  # its last cells hold one line of the picture
    assert [odd[-1].mean(), odd[:, -1].mean()] == pytest.approx([9, 9], rel=0.1)


def test_it_is_the_default_of_the_monitor():
    assert isinstance(ConditionMonitor().noise_estimator, Adaptive)


def test_no_patches_give_no_answers():
    assert len(ADAPTIVE.estimate(np.zeros((0, 1, 128, 128), np.float32))) == 0
    with pytest.raises(InputError):
        ADAPTIVE.estimate(np.zeros((1, 1, 40, 40), np.float32))


def test_grain_that_is_finer_along_columns_is_texture_of_the_ground_not_noise():
    """A road seen at a slant, stored as JPEG, shows a codec and smooth grain, as a processed picture does."""
    road = cv2.resize(flat(6, 1.6, side=256), (256, 128), interpolation=cv2.INTER_AREA)[:, 64:192]
    road = np.rint(120 + (road - road.mean()) * (6 / road.std()))
    isotropic = flat(6, 0.9)
    pictures = (road, isotropic, cv2.rotate(road, cv2.ROTATE_90_CLOCKWISE))
    stored = [cv2.imencode(".jpg", picture.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 90])[1] for picture in pictures]
    patches = stack(*(cv2.imdecode(data, 0).astype(np.float32) for data in stored))
    statistics = ADAPTIVE.correlated.predict(patches[:, 0]).statistics
    across = anisotropy(statistics)
    assert across[0] > 1.5 * FORESHORTENED and abs(across[1]) < FORESHORTENED / 2 and across[2] < -1.5 * FORESHORTENED
    estimate, cells = ADAPTIVE.estimate_cells(patches)
    assert tuple(estimate.reason[:2]) == (COMPRESSED, "")
    assert np.isnan(cells[0]).all() and np.isfinite(cells[1]).all()


def test_plainly_white_noise_behind_a_mild_codec_is_held_wherever_the_patch_was_cut():
    """Off the codec's grid it shows no trace of it, but is up to 6 % stronger or weaker; `cellwise` is sure to 4 %."""
    held, held_by_cellwise = [], []
    for quality in (80, 90, 95):
        shots = []
        for number in range(4):
            noisy = data.astronaut().mean(axis=2) + stream(1, "strong", quality, number).normal(0, 15, (512, 512))
            whole = np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
            shots.append(codec.jpeg(whole, quality)[..., 0])
        corners = [(y, x) for y in range(3, 384, 125) for x in range(5, 384, 125)]
        pieces = [np.stack(shots)[:, y : y + 128, x : x + 128] for y, x in corners]
        truth = np.array([temporal_noise.measure(piece).sigma_dn for piece in pieces])
        patches = stack(*(piece[0].astype(np.float32) for piece in pieces))
        estimate, white = ADAPTIVE.estimate(patches), noise.create("cellwise").estimate(patches)
        plain = np.isclose(estimate.sigma_dn, white.sigma_dn, rtol=1e-6)
        held += list(((estimate.low_dn <= truth) & (truth <= estimate.high_dn))[plain])
        held_by_cellwise += list(((white.low_dn <= truth) & (truth <= white.high_dn))[plain])
    assert len(held) >= 40
    assert np.mean(held) > np.mean(held_by_cellwise) + 0.2


def test_weak_noise_behind_a_codec_may_as_well_be_none():
    """What JPEG leaves of a brick's grain is read as noise of 1 DN; the interval says that there may be none."""
    brick = codec.jpeg(np.repeat(data.brick()[..., None], 3, axis=2), 95)[..., 0]
    corners = [(y, x) for y in range(0, 257, 128) for x in range(0, 257, 128)]
    behind = ADAPTIVE.estimate(stack(*(brick[y : y + 128, x : x + 128].astype(np.float32) for y, x in corners)))
    weak = ~behind.abstained & (behind.high_dn < WEAK_DN)
    assert weak.sum() >= 5 and (behind.sigma_dn[weak] > 0.5).all()
    assert (behind.low_dn[weak] == 0).all()
    white = ADAPTIVE.estimate(stack(flat(1.5)))
    assert white.high_dn < WEAK_DN and white.low_dn > 1


@pytest.mark.parametrize("option", ["widest_reach", "widest_compressed_reach", "widest_white_reach"])
@pytest.mark.parametrize("value", [0, -1, float("nan"), "wide", None])
def test_a_reach_that_is_no_positive_number_is_refused(option, value):
    with pytest.raises(InputError, match=f"{option}: expected a number above 0"):
        noise.create("adaptive", **{option: value})


def behind_a_tone_curve(read: float, photons: float, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A shaded picture with edges, formed in linear light and encoded: without noise, and in whole grey levels."""
    y, x = np.mgrid[:128, :128] / 128
    light = np.clip(0.02 + 0.5 * x**2 * (1 + 0.5 * (y > 0.5)) + 0.1 * (np.hypot(x - 0.3, y - 0.3) < 0.2), 0, 1)
    noisy = light + generator.standard_normal(light.shape) * np.sqrt(read**2 + light / photons)
    clean, made = (255 * np.clip(values, 0, 1) ** (1 / 2.2) for values in (light, noisy))
    return clean, np.rint(made)


@pytest.mark.parametrize(("read", "photons"), [(0.01, 1e9), (0.004, 1e3), (0.02, 1e9), (0.001, 500.0)])
def test_noise_that_a_tone_curve_makes_strongest_in_shadows_is_within_the_interval(read, photons):
    generator = stream(3, "shadows", str(read))
    pairs = [behind_a_tone_curve(read, photons, generator) for _ in range(6)]
    truth = np.array([(noisy - clean).std() for clean, noisy in pairs])
    result = noise.create("adaptive").estimate(stack(*(noisy for _, noisy in pairs)).astype(np.float32))
    answered = ~result.abstained
    assert answered.any()
    assert (truth <= 1.06 * result.high_dn)[answered].all()


def test_even_noise_has_as_narrow_an_interval_as_without_regard_to_uneven_noise(monkeypatch):
    generator = stream(3, "even")
    ramp = np.linspace(60, 190, 128) + np.zeros((128, 128))
    patches = stack(*(np.rint(ramp + s * generator.standard_normal(ramp.shape)) for s in (3, 6, 12))).astype(np.float32)
    wide = noise.create("adaptive").estimate(patches)
    monkeypatch.setattr("pipeline.noise.joint_answer.PRINCIPAL_REACH", 0.0)
    narrow = noise.create("adaptive").estimate(patches)
    np.testing.assert_allclose(wide.high_dn, narrow.high_dn, rtol=0.05)
    np.testing.assert_array_equal(wide.sigma_dn, narrow.sigma_dn)


def test_noise_that_non_local_means_left_at_edges_is_within_the_interval():
    picture = data.camera()[:256, :256].astype(np.float64)
    shots = [
        cv2.fastNlMeansDenoising(
            np.clip(np.rint(picture + 10 * stream(6, "nlm", number).standard_normal(picture.shape)), 0, 255).astype(
                np.uint8
            ),
            None, h=7, templateWindowSize=5, searchWindowSize=15,
        )
        for number in range(4)
    ]  # fmt: skip
    pieces = [np.stack(shots)[:, y : y + 128, x : x + 128] for y in (0, 128) for x in (0, 128)]
    truth = np.array([temporal_noise.measure(piece).sigma_dn for piece in pieces])
    result = ADAPTIVE.estimate(stack(*(piece[0].astype(np.float32) for piece in pieces)))
    answered = ~result.abstained
    assert answered.any() and (truth <= result.high_dn)[answered].all()
