"""The page of ``camera-monitor health``: one file, nothing fetched; trends, precision and advice of its run."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from control_makers import performance
from data_makers import picture
from health_makers import CONDITION, KnownMonitor, frame_row, run_of

from pipeline.cli import main
from pipeline.cli.analysis.frame import FrameAnalysis, Settings, Thresholds
from pipeline.cli.health.page import MOST_THUMBNAILS, WORST_FRAMES, PageFrames, page
from pipeline.cli.health.row_words import row_words
from pipeline.cli.health.trend_words import without_trend
from pipeline.cli.health.verdict import run_verdict
from pipeline.condition.trend import ConditionTrend
from pipeline.streams import stream

LOADS = {"src", "srcset", "href", "data", "action", "poster", "background", "formaction"}


class References(HTMLParser):
    """Addresses that a page loads or links, its tags, and texts."""

    def __init__(self):
        super().__init__()
        self.addresses, self.tags, self.texts, self.open = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.addresses += [value for name, value in attributes if name in LOADS]
        self.addresses += [value for name, value in attributes if name.startswith("on")]

    def handle_data(self, text):
        self.texts.append(text)


def parse(html):
    parser = References()
    parser.feed(html)
    return parser


def assert_self_contained(html):
    """No address but ``data:``, no script, no imported style, no element that loads."""
    parser = parse(html)
    assert all(address.startswith("data:image/") for address in parser.addresses)
    assert not {"script", "link", "iframe", "object", "embed", "base", "form"} & set(parser.tags)
    assert not re.search(r"@import|url\(|https?://", html)
    assert "default-src 'none'" in html


def test_a_run_writes_a_self_contained_page_and_states_its_means(tmp_path):
    for name, blur_px in (("a", 0.0), ("b", 3.0)):
        image = cv2.GaussianBlur(picture("health"), (0, 0), 0.8 + blur_px)
        assert cv2.imwrite(str(tmp_path / f"{name}.png"), image)
    (tmp_path / "bad.png").write_bytes(b"none")
    done = CliRunner().invoke(main, ["health", str(tmp_path), "--out", str(tmp_path / "out"), "--alarm-mtf50", "0.2"])
    assert done.exit_code == 3, done.output
    html = (tmp_path / "out/health.html").read_text()
    assert_self_contained(html)
    parser = parse(html)
    pictures = [address for address in parser.addresses if address.startswith("data:image/jpeg;base64,")]
    decoded = [cv2.imdecode(np.frombuffer(base64.b64decode(p.split(",")[1]), np.uint8), 1) for p in pictures]
    assert len(decoded) == 4 and all(min(part.shape[:2]) > 100 for part in decoded)  # two thumbnails, two with maps
    content = json.loads((tmp_path / "out/health.json").read_text())
    text = " ".join(parser.texts)
    assert content["verdict"]["sentence"] in text and "bad.png" in text
    assert content["verdict"]["sentence"].startswith("Median of 2 frames: ")
    assert done.stdout.startswith(content["verdict"]["sentence"])
    assert {"mtf_spectral.safetensors", "sigma_cellwise.safetensors", "sigma_correlated.safetensors"} <= set(
        content["weights_sha256"]
    )
    assert all(len(digest) == 64 for digest in content["weights_sha256"].values())
    assert content["version"] and len(content["set_aside"]) == 1


def test_the_page_states_in_one_line_what_the_noise_is_made_of():
    """Of two frames the medians; nothing where the estimator does not take noise apart, or nothing was analysed."""
    frames = PageFrames(lambda image, condition: np.zeros((20, 20, 3), np.uint8))
    rows = [frame_row(0, white_sigma_dn=0.5, noise_correlation=0.5),
            frame_row(1, white_sigma_dn=0.7, noise_correlation=0.7)]  # fmt: skip
    content = run_of(rows).content()
    verdict = content["verdict"]
    assert (verdict["median_white_sigma_dn"], verdict["median_noise_correlation"]) == pytest.approx((0.6, 0.6))
    line = "Noise of 2.0 DN, of which 0.6 DN white; neighbouring pixels correlate by 0.60"
    assert f"<p>{line}: the camera has processed its noise.</p>" in page(content, frames)
    unknown = {"white_sigma_dn": np.nan, "noise_correlation": np.nan}
    for few in ([], [frame_row(0, **unknown)], [frame_row(0), *(frame_row(1, sigma_dn=np.nan, **unknown),) * 2]):
        assert "DN white" not in page(run_of(few).content(), frames)


def test_a_page_keeps_the_worst_frames_and_few_thumbnails_of_many():
    frames = PageFrames(lambda image, condition: np.full((30, 60, 3), 255 * image[0, 0], np.uint8))
    rows = []
    for number in range(300):
        row = frame_row(number, sigma_dn=20.0 if number in (7, 150, 299) else 2.0)
        frames.add(row, np.full((20, 40), 0.5, np.float32), CONDITION)
        rows.append(row)
    assert len(frames.worst) == WORST_FRAMES and MOST_THUMBNAILS / 2 < len(frames.thumbnails) <= MOST_THUMBNAILS
    assert {part.row["picture"] for part in frames.worst[:3]} == {"v.mp4#7", "v.mp4#150", "v.mp4#299"}
    spacing = np.diff([int(part.row["picture"].split("#")[1]) for part in frames.thumbnails])
    assert len(set(spacing)) == 1
    alarm = {
        "sequence": "v.mp4", "picture": "v.mp4#150", "quantity": "noise", "frame": 150, "since_frame": 149,
        "reference": 2.0, "level": 20.0, "words": "noise 2.0 to 20.0 DN since frame 149",
    }  # fmt: skip
    html = page(run_of(rows, trend_alarms=[alarm], complete=True).content(), frames)
    assert_self_contained(html)
    assert html.count("<svg") == 2 and html.count('class="mark"') == 2 and 'class="threshold"' in html
    assert "noise 2.0 to 20.0 DN since frame 149" in html and "not released" in html


def test_names_of_frames_cannot_inject_markup():
    row = frame_row(0, picture="<script>alert(1)</script>.png")
    frames = PageFrames(lambda image, condition: np.zeros((20, 20, 3), np.uint8))
    frames.add(row, np.zeros((20, 20), np.float32), CONDITION)
    assert_self_contained(page(run_of([row], set_aside=["<img src=x onerror=alert(1)>"]).content(), frames))


def test_a_series_that_worsens_raises_a_trend_alarm_with_exit_code_and_a_steady_one_none():
    generator = stream(0, "worsening")
    for last, alarmed in ((0.2, False), (0.6, True)):
        analysis = FrameAnalysis(KnownMonitor(), Thresholds(), reference_frames=100)
        rows = []
        for number in range(140):
            level = (0.2 if number < 120 else last) * (1 + 0.05 * generator.standard_normal())
            rows.append(analysis.analyse(f"v.mp4#{number}", np.full((40, 40), level, np.float32), "v.mp4", "v.mp4")[0])
        assert bool(analysis.trend_alarms) == alarmed
        assert any("trend noise" in row["alarms"] for row in rows[120:]) == alarmed
        assert not any(row["alarms"] for row in rows[:120])
    assert analysis.trend_alarms[0]["frame"] >= 120


def test_a_trend_alarm_names_the_picture_and_so_the_video_that_the_change_began_with():
    """Of every second frame of two videos."""
    generator, analysis = stream(0, "named"), FrameAnalysis(KnownMonitor(), Thresholds(), reference_frames=100)
    for name, change in (("a.mkv", 120), ("b.mkv", 110)):
        for number in range(130):
            level = (0.2 if number < change else 0.6) * (1 + 0.02 * generator.standard_normal())
            analysis.analyse(f"{name}#{2 * number}", np.full((40, 40), level, np.float32), name, name)
    alarms = [alarm for alarm in analysis.trend_alarms if alarm["quantity"] == "noise"]
    assert [alarm["since_picture"] for alarm in alarms] == ["a.mkv#240", "b.mkv#220"]
    assert [alarm["since_frame"] for alarm in alarms] == [120, 110]
    sentences = run_verdict([frame_row(0)], without_precision="", trend_alarms=alarms)["sentences"]
    assert [text[-16:] for text in sentences if "Trend" in text] == ["since a.mkv#240.", "since b.mkv#220."]


@pytest.mark.parametrize(
    ("frames", "sigma_dn", "sentence"),
    [(1, 3.0, "No trend: 1 frame of a series has an estimate, the reference alone takes 100."),
     (9, 3.0, "No trend: 9 frames of a series have an estimate, the reference alone takes 100."),
     (150, np.nan, "No trend of noise: 0 frames of a series have an estimate, the reference alone takes 100."),
     (150, 3.0, "")],
)  # fmt: skip
def test_what_has_no_trend_for_want_of_estimates_is_stated(frames, sigma_dn, sentence):
    trend = ConditionTrend(100)
    for _ in range(frames):
        trend.step(sigma_dn, np.full((2, 8), 0.5))
    assert without_trend(SimpleNamespace(trends={"v.mp4": trend}), 100) == sentence
    assert without_trend(SimpleNamespace(trends={}), 100) == ""


def test_a_quantity_that_changed_within_the_reference_is_stated():
    trend, reference = ConditionTrend(120), stream(0, "changed reference").normal(0, 0.02, 400)
    for number in range(120):
        trend.step(2.0 * np.exp(0.01 * number + reference[number]), np.full((2, 8), 0.5))
    sentence = without_trend(SimpleNamespace(trends={"v.mp4": trend}), 120)
    assert sentence.startswith("No reliable trend of noise: changed within the reference (noise 2.")
    assert sentence.endswith(
        " DN within frames 0 to 119); give fewer --reference-frames, or start from a camera in order."
    )
    two = without_trend(SimpleNamespace(trends={"v.mp4": trend, "w.mp4": ConditionTrend(120)}), 120)
    assert "No reliable trend of noise in v.mp4: " in two
    for number in range(120, 400):  # steady from here on
        trend.step(2.0 * np.exp(1.2 + reference[number]), np.full((2, 8), 0.5))
    sentence = without_trend(SimpleNamespace(trends={"v.mp4": trend}), 120)
    assert sentence.startswith("Changed within the first reference of the trend: noise 2.")
    assert sentence.endswith("compared with frames 120 to 239 since.")


def test_precision_and_advice_follow_where_surface_and_settings_are_known():
    image = np.full((40, 40), 0.4, np.float32)
    plain = FrameAnalysis(KnownMonitor(), Thresholds()).analyse("a.png", image)[0]
    assert np.isnan(plain["ap_percent"]) and np.isnan(plain["best_exposure_ms"])
    measured = FrameAnalysis(KnownMonitor(), Thresholds(), performance()).analyse("a.png", image)[0]
    assert 0 < measured["ap_percent"] < measured["sharp_ap_percent"] and np.isnan(measured["best_exposure_ms"])
    settings = Settings("16ms", 100)
    advised = FrameAnalysis(KnownMonitor(), Thresholds(), performance(), settings).analyse("a.png", image)[0]
    assert advised["exposure_ms"] == pytest.approx(16.0) and advised["advice"] == "move"
    assert advised["gain_percent"] > 0 and advised["ap_percent"] == measured["ap_percent"]
    lacking = FrameAnalysis(KnownMonitor(), Thresholds(), performance(), Settings("16ms"))
    assert lacking.analyse("a.png", image)[0]["advice"] == "none: give --iso too"
    assert advised["best_exposure_ms"] != pytest.approx(16.0) and 100 <= advised["best_iso"] <= 3200
    relative = FrameAnalysis(KnownMonitor(), Thresholds(), performance(), settings, relative=True)
    assert relative.analyse("a.png", image)[0]["ap_percent"] < measured["ap_percent"]


def test_the_expected_precision_reaches_as_far_as_an_uncertain_blur():
    class Unsure(KnownMonitor):
        def __init__(self, low, high):
            self.ends = (np.full((2, 8), end) for end in (low, high))

        def frame(self, image, codec="", quantiser=None):
            seen = super().frame(image)
            low, high = self.ends
            summary = replace(seen.blur.summary, low=low, high=high)
            return replace(seen, blur=replace(seen.blur, summary=summary))

    image = np.full((40, 40), 0.4, np.float32)
    sure, unsure = (
        FrameAnalysis(Unsure(*ends), Thresholds(), performance()).analyse("a.png", image)[0]
        for ends in ((0.58, 0.62), (0.05, 1.0))
    )
    assert (sure["blur_range"], unsure["blur_range"]) == ("", "sharp to strongly blurred")
    assert unsure["ap_percent"] == sure["ap_percent"]
    assert unsure["ap_low_percent"] < sure["ap_low_percent"] and unsure["ap_high_percent"] > sure["ap_high_percent"]
    assert row_words(unsure).startswith("sharp (uncertain: sharp to strongly blurred); noise")
    sentences = run_verdict([unsure, unsure | {"blur": "strongly blurred"}], without_precision="")["sentences"]
    assert "(uncertain: sharp to strongly blurred)" in sentences[0]
    assert not any("at least moderately blurred" in sentence for sentence in sentences)  # none certainly is


def test_a_failing_advice_states_its_own_reason():
    image, surface = np.full((40, 40), 0.4, np.float32), performance()
    surface.reference = np.where(np.arange(8) == 3, 0.01, surface.reference)  # unusable
    analysis = FrameAnalysis(KnownMonitor(), Thresholds(), surface, Settings("16ms", 100))
    advice = analysis.analyse("a.png", image)[0]["advice"]
    assert advice.startswith("none: ") and "reference MTF" in advice and "limits" not in advice
    outside = FrameAnalysis(KnownMonitor(), Thresholds(), performance(), Settings("90ms", 100))
    row = outside.analyse("a.png", image)[0]
    assert row["advice"] == "move" and row["best_exposure_ms"] <= 33


@pytest.mark.parametrize("command", [["health"], ["advise", "--exposure", "4ms", "--iso", "100"]])
def test_a_surface_of_another_format_is_named_and_nothing_is_to_be_deleted(tmp_path, command):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((40, 40), np.uint8))
    done = CliRunner().invoke(main, [*command, str(tmp_path / "a.png"), "--surface", str(tmp_path / "a.png")])
    assert done.exit_code == 2 and len(done.stderr.splitlines()) == 1
    assert "a.png: not a surface of average precision (.npz)" in done.stderr and "delete" not in done.stderr


def test_the_least_precision_is_that_of_the_most_noise(monkeypatch):
    image = np.full((40, 40), 0.4, np.float32)
    known = FrameAnalysis(KnownMonitor(), Thresholds(), performance()).analyse("a.png", image)[0]

    class Withheld(KnownMonitor):
        def frame(self, image, codec="", quantiser=None):
            seen = super().frame(image)
            unknown = np.full_like(seen.noise.summary.value, np.nan)
            summary = replace(seen.noise.summary, value=unknown, low=unknown, high=unknown)
            most = float(seen.noise.summary.value)
            return replace(seen, noise=replace(seen.noise, summary=summary, at_most_dn=most))

    row = FrameAnalysis(Withheld(), Thresholds(), performance()).analyse("a.png", image)[0]
    assert np.isnan(row["ap_percent"]) and np.isnan(row["ap_high_percent"])
    assert row["ap_low_percent"] == known["ap_low_percent"] and row["sigma_at_most_dn"] == known["sigma_dn"]
