"""The verdict of ``camera-monitor health``: words that follow from the numbers of frames."""

from __future__ import annotations

import numpy as np
import pytest
from health_makers import frame_row

from pipeline.cli.health.ranking import badness
from pipeline.cli.health.verdict import run_verdict


def test_the_verdict_has_what_is_known_only():
    known = frame_row(
        0, blur="moderately blurred", blur_direction="horizontal",
        mtf=np.stack([np.linspace(0.9, 0.05, 8), np.linspace(1, 0.6, 8)]),
        ap_percent=71.2, ap_low_percent=66.0, ap_high_percent=75.0, sharp_ap_percent=93.4, best_exposure_ms=4.0,
        best_iso=800.0, best_ap_percent=85.0, gain_percent=13.8, advice="move",
    )  # fmt: skip
    verdict = run_verdict([known], without_precision="")
    assert verdict["sentence"] == (
        "Slightly blurred, mainly horizontal; noise low (2.0 DN). Expected AP 71 % of 93 % (95 % interval 66 to 75). "
        "Cause: probably motion. Try 4 ms at ISO 800 (14 points of AP more expected)."
    )
    assert verdict["sentences"] == [verdict["sentence"]]
    other = run_verdict([known | {"ap_percent": 66.0}], without_precision="")["sentence"]
    assert other.endswith("(14 points of AP more expected, from 71 % by noise and motion alone).")
    bounded = run_verdict(
        [known | {"ap_percent": 66.0, "blur_range": "sharp to strongly blurred"}], without_precision=""
    )
    assert bounded["sentence"].endswith("(at least 14 points of AP more expected).")
    little = run_verdict([known | {"gain_percent": 1.9}], without_precision="")
    assert "Try" not in little["sentence"]
    none = "No better settings: none within the limits is expected to gain 2 points of AP."
    assert little["sentence"].endswith(none)
    for advice, words in (
        ("hold", none),
        ("none: give --iso too", "No advice: give --iso too."),
        ("abstained", "No advice: blur or noise is unknown."),
        ("refused", "No advice: no average precision was measured at such blur and noise."),
    ):
        assert run_verdict([known | {"advice": advice}], without_precision="")["sentence"].endswith(words)
    dark = known | {"advice": "refused", "sharp_ap_percent": np.nan}
    words = "No advice: no average precision was measured at such low brightness."
    assert run_verdict([dark], without_precision="")["sentence"].endswith(words)
    undirected = known | {"blur_direction": ""}
    round_blur = run_verdict([undirected], without_precision="")
    assert round_blur["sentence"].endswith("(14 points of AP more expected, if the blur is of motion).")
    sharp = known | {"blur": "sharp", "mtf": np.full((2, 8), 0.99), "advice": "hold"}
    mixed = run_verdict([sharp, sharp, undirected], without_precision="")["sentence"]
    assert (
        "sharp; noise" in mixed
        and "if the blur is of motion, as for v.mp4#0; other settings advised in 1 of 3" in mixed
    )
    both = run_verdict([known, known | {"advice": "hold"}], without_precision="")["sentence"]
    assert both.endswith("(14 points of AP more expected, as for v.mp4#0; other settings advised in 1 of 2 frames).")
    unknown = frame_row(0, blur="", noise="", sigma_dn=np.nan, sigma_at_most_dn=np.nan, mtf=np.full((2, 8), np.nan),
                        flags="black", abstained={"blur": {"flat": 4}})  # fmt: skip
    verdict = run_verdict([unknown], without_precision="no surface", without_trend="No trend: 9 frames.", set_aside=2)
    sentences = verdict["sentences"]
    assert sentences[0] == "Blur unknown; noise unknown."
    assert "Blur is unknown in 1 of 1 frames (no variation to measure)." in sentences
    assert "Frames flagged: black 1." in sentences
    assert "No trend: 9 frames." in sentences and "2 files or frames were set aside." in sentences
    assert "Expected average precision is unknown: no surface." in sentences
    assert run_verdict([], without_precision="", set_aside=1)["sentences"][0] == "No frame could be analysed."


DARK = {"sharp_ap_percent": np.nan}  # of a surface whose frames are brighter
ROWS = {"flags": "banded", "row_noise_dn": 8.3, "column_noise_dn": 0.0}
IMPULSES = {"flags": "impulses", "impulse_fraction": 0.01}
OF_ROWS = "with noise of rows, columns or single pixels"


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ([{"blur": "sharp", "noise": ""}], "noise unknown"),
        ([{"blur": "", "noise": ""}], "blur and noise unknown"),
        ([{"blur": "sharp", "noise": ""}, {"blur": "", "noise": "low"}], "blur and noise unknown"),
        ([{"blur": "sharp", "noise": "low"}, {"blur": "", "noise": "low"}], "none was measured at such blur and noise"),
        ([DARK], "none was measured at such low brightness"),
        ([ROWS], f"none was measured {OF_ROWS}"),
        ([IMPULSES], f"none was measured {OF_ROWS}"),
        ([DARK, DARK, ROWS], f"none was measured at such low brightness (2 of 3 frames) or {OF_ROWS} (1 of 3 frames)"),
        ([{"noise": "", "sigma_dn": np.nan}, {"noise": "", "sigma_dn": np.nan}, {"ap_percent": 70.0}], "noise unknown"),
    ],
)
def test_why_the_expected_precision_is_unknown(parts, words):
    unknown = {"ap_percent": np.nan, "sharp_ap_percent": 93.4}
    rows = [frame_row(index, **unknown | part) for index, part in enumerate(parts)]
    assert f"Expected AP unknown: {words}." in run_verdict(rows, without_precision="")["sentence"]


def test_noise_that_texture_may_hide_is_stated_beside_none():
    row = frame_row(0, sigma_dn=0.02, sigma_low_dn=0.0, sigma_high_dn=14.2, noise="very low", blur="sharp")
    sentence = run_verdict([row], without_precision="")["sentence"]
    assert "noise very low (0.0 DN; texture may hide up to 14 DN)" in sentence
    assert "(0.0 DN)" in run_verdict([row | {"sigma_high_dn": 1.0}], without_precision="")["sentence"]
    worst = run_verdict([row, row], without_precision="")["sentences"]
    assert any("Worst frame" in words and "up to 14 DN" in words for words in worst)


@pytest.mark.parametrize(
    ("high_dn", "words"),
    [(5.9, "noise moderate (4.2 DN)"), (9.8, "noise moderate (4.2 DN; there may be up to 10 DN)")],
)
def test_noise_that_may_be_much_more_than_estimated_is_stated_beside_it(high_dn, words):
    row = frame_row(0, sigma_dn=4.2, sigma_low_dn=3.6, sigma_high_dn=high_dn, noise="moderate", blur="sharp")
    assert words in run_verdict([row], without_precision="")["sentence"]


def test_a_run_whose_noise_a_codec_mostly_hides_is_not_judged_by_the_frames_that_have_an_estimate():
    coded = frame_row(0, sigma_dn=np.nan, sigma_high_dn=np.nan, sigma_at_most_dn=14.2, noise="", blur="sharp",
                      ap_low_percent=31.0, sharp_ap_percent=96.0, mtf=np.full((2, 8), 0.99))  # fmt: skip
    noisy = coded | {"sigma_dn": 18.0, "sigma_high_dn": 20.0, "sigma_at_most_dn": 20.0, "noise": "high",
                     "ap_percent": 25.0, "ap_low_percent": 17.0, "ap_high_percent": 33.0}  # fmt: skip
    verdict = run_verdict([coded, coded, noisy], without_precision="")
    start = "Median of 3 frames: sharp; noise unknown (at most 15 DN). Expected AP at least 31 % of 96 %."
    assert verdict["sentence"] == start and "Worst frame: v.mp4#0, sharp; noise high (18.0 DN)." in verdict["sentences"]
    assert np.isnan([verdict["median_sigma_dn"], verdict["median_ap_percent"]]).all()
    assert verdict["median_sigma_at_most_dn"] == 14.2
    half = run_verdict([coded, noisy], without_precision="")
    assert half["median_sigma_dn"] == 18 and "noise high (18.0 DN)" in half["sentence"]


def test_what_a_coded_frame_holds_at_most_stands_beside_unknown_noise_with_the_least_precision():
    coded = frame_row(0, sigma_dn=np.nan, sigma_at_most_dn=3.2, noise="", blur="sharp", ap_low_percent=88.4,
                      sharp_ap_percent=93.4, mtf=np.full((2, 8), 0.99))  # fmt: skip
    verdict = run_verdict([coded, coded], without_precision="")
    assert verdict["sentence"].endswith("sharp; noise unknown (at most 4 DN). Expected AP at least 88 % of 93 %.")
    assert any("Worst frame" in words and "(at most 4 DN)" in words for words in verdict["sentences"])


def test_bounds_of_a_few_frames_do_not_stand_for_those_that_have_none():
    """Nine raw mosaics of 20 DN, whose noise has no estimate, and one clean JPEG."""
    bounded = frame_row(0, sigma_dn=np.nan, sigma_high_dn=np.nan, sigma_at_most_dn=4.2, noise="", blur="sharp",
                        ap_low_percent=83.0, sharp_ap_percent=96.0, mtf=np.full((2, 8), 0.99))  # fmt: skip
    mosaic = bounded | {"sigma_at_most_dn": np.nan, "ap_low_percent": np.nan}
    noisy = bounded | {"sigma_dn": 28.0, "sigma_high_dn": 30.0, "sigma_at_most_dn": 30.0, "noise": "very high",
                       "ap_percent": 12.0, "ap_low_percent": 9.0, "ap_high_percent": 14.0}  # fmt: skip
    for rows, at_most, least in (
        ([bounded] + 9 * [mosaic], np.nan, None),
        (5 * [bounded] + 5 * [mosaic], np.nan, None),  # half of all
        (4 * [noisy] + 2 * [bounded] + 4 * [mosaic], np.nan, None),  # more than half of all, a third of the unknown
        (6 * [bounded] + 4 * [mosaic], 4.2, 83),
        (2 * [noisy] + 2 * [bounded] + [mosaic], 30.0, 9),  # at most that: two of five certainly have less
    ):
        verdict = run_verdict(rows, without_precision="")
        assert np.isnan(verdict["median_sigma_dn"])
        assert verdict["median_sigma_at_most_dn"] == pytest.approx(at_most, nan_ok=True)
        assert ("at most" in verdict["sentence"]) == bool(least)
        assert (f"Expected AP at least {least} % of 96 %" if least else "Expected AP unknown") in verdict["sentence"]


def test_the_flags_that_make_a_frame_the_worst_are_named():
    rows = [frame_row(0), frame_row(1, blur="sharp", noise="very low", sigma_dn=0.0, flags="dark, over_exposed")]
    (worst,) = (text for text in verdict_of(rows) if text.startswith("Worst frame"))
    assert worst == "Worst frame: v.mp4#1, sharp; noise very low (0.0 DN); dark; over-exposed."


def test_the_worst_frame_is_one_that_was_measured_and_others_are_named():
    unknown = {"blur": "", "noise": "", "sigma_dn": np.nan, "mtf": np.full((2, 8), np.nan)}
    bad = frame_row(1, blur="strongly blurred", mtf=np.full((2, 8), 0.1))
    rows = [frame_row(0), bad, frame_row(2, **unknown, flags="black"), frame_row(3, **unknown)]
    sentences = run_verdict(rows, without_precision="")["sentences"]
    assert f"Worst frame: {bad['picture']}, strongly blurred; noise low (2.0 DN)." in sentences
    first = f"the first {rows[2]['picture']}"
    assert f"Neither blur nor noise could be measured in 2 of 4 frames: {first}." in sentences
    sentences = run_verdict(rows[2:], without_precision="")["sentences"]
    assert not any(sentence.startswith("Worst frame") for sentence in sentences)


def test_a_part_that_is_blurred_is_stated_where_the_median_patch_is_not():
    (single,) = (text for text in verdict_of([frame_row(0, blurred_fraction=0.43)]) if "Partly" in text)
    assert "43 % of the patches are at least moderately blurred" in single
    several = verdict_of([frame_row(0), frame_row(1, blurred_fraction=0.25), frame_row(2, blurred_fraction=0.5)])
    assert "Partly blurred: 2 of 3 frames, v.mp4#2 on 50 % of the patches." in several
    whole = [frame_row(0, blur="strongly blurred", blurred_fraction=1.0), frame_row(1, blurred_fraction=0.19)]
    assert not any("Partly" in text for text in verdict_of(whole))


def test_a_part_of_one_grey_level_is_not_said_to_be_a_border():
    """Pictures reduced to few grey levels have such parts, too."""
    without = {"sigma_dn": np.nan, "sigma_high_dn": np.nan, "sigma_at_most_dn": np.nan, "noise": ""}
    sentences = verdict_of([frame_row(0, **without, abstained={"noise": {"covered": 3}})])
    reason = "a part has one grey level: a border, or a picture of few levels"
    assert f"Noise is unknown in 1 of 1 frames ({reason})." in sentences


def test_frames_that_have_an_estimate_do_not_stand_for_more_that_have_none():
    """31 of 40 were too bright to measure noise in; the others, the darkest, had none."""
    unknown = {"sigma_dn": np.nan, "sigma_high_dn": np.nan, "sigma_at_most_dn": np.nan, "noise": ""}
    few = verdict_of([frame_row(0), frame_row(1), *(frame_row(number, **unknown) for number in range(2, 5))])
    assert "noise unknown" in few[0] and "Noise is unknown in 3 of 5 frames" in " ".join(few)
    most = verdict_of([frame_row(0), frame_row(1), frame_row(2), *(frame_row(3, **unknown) for _ in range(2))])
    assert "noise low (2.0 DN)" in most[0]
    blind = {"mtf": np.full((2, 8), np.nan), "blur": ""}
    assert "blur unknown" in verdict_of([frame_row(0), frame_row(1, **blind), frame_row(2, **blind)])[0]


def test_the_worst_frame_has_the_worst_grade_not_the_least_contrast_on_average():
    moderate = frame_row(0, blur="moderately blurred", mtf=np.full((2, 8), 0.3))
    strong = frame_row(1, blur="strongly blurred", mtf=np.stack([np.full(8, 0.1), np.full(8, 0.8)]))
    noisy = frame_row(2, noise="high", sigma_dn=15.0)
    uncertain = frame_row(3, blur="strongly blurred", blur_range="sharp to strongly blurred", mtf=np.full((2, 8), 0.2))
    ordered = sorted([strong, moderate, uncertain, noisy, frame_row(4)], key=badness)
    assert [row["picture"][-1] for row in ordered] == [
        "3",
        "4",
        "0",
        "2",
        "1",
    ]  # "slightly" is worse than what may be sharp
    assert sorted([strong, frame_row(5, alarms="noise"), frame_row(6, flags="black")], key=badness)[0] is strong


def verdict_of(rows):
    return run_verdict(rows, without_precision="")["sentences"]


def test_frames_noisier_than_what_is_measured_count_as_highly_noisy_and_as_the_worst():
    """Their noise is unknown, but for being more than 60 DN; so may their blur be."""
    beyond = frame_row(
        1, noise="", sigma_dn=np.nan, sigma_high_dn=np.nan, sigma_at_most_dn=np.nan, noise_patches=20,
        abstained={"noise": {"beyond": 11, "uncertain": 9}},
    )  # fmt: skip
    blind = beyond | {"picture": "v.mp4#2", "blur": "", "mtf": np.full((2, 8), np.nan)}
    few = beyond | {"picture": "v.mp4#3", "abstained": {"noise": {"beyond": 10, "uncertain": 10}}}
    high = frame_row(4, noise="high", sigma_dn=19.0)
    assert sorted([beyond, few, high, blind], key=badness)[:2] == [few, high]
    sentences = run_verdict([frame_row(0), high, beyond, few], without_precision="")["sentences"]
    assert "2 of 4 frames are at least moderately blurred or highly noisy." in sentences
    assert "Worst frame: v.mp4#1, slightly blurred; noise unknown (beyond 60 DN)." in sentences
    sentences = run_verdict([high, blind], without_precision="")["sentences"]
    assert "Worst frame: v.mp4#2, blur unknown; noise unknown (beyond 60 DN)." in sentences
