"""Change-point alarm: run length between false alarms by simulation, delays on series of faults."""

import numpy as np
import pytest

from benchmarks.trend_alarms import LAWS, false_alarms
from pipeline.condition.change_point import SHIFT_SIGMAS, Chart, Reference, drift, run_length, threshold_for
from pipeline.condition.trend import FRAMES_BETWEEN_FALSE_ALARMS, QUANTITIES, REFERENCE_FRAMES, ConditionTrend
from pipeline.errors import InputError
from pipeline.streams import stream

HOUR = 36_000  # frames at 10 per second
SPREAD = 0.1


def autoregressive(generator, phi, runs):
    """Endless stationary series: (runs,) values per step."""
    value = generator.standard_normal(runs)
    while True:
        yield SPREAD * value
        value = phi * value + np.sqrt(1 - phi**2) * generator.standard_normal(runs)


def test_the_threshold_has_the_run_length_asked_for():
    for allowance in (0.5, 1.0):
        for tau2 in (1.0, 4.0, 19.0):
            threshold = threshold_for(108_000, allowance, tau2)
            assert run_length(threshold, allowance, tau2) == pytest.approx(108_000, rel=1e-6)
    assert float(run_length(4.0, 0.5, 1.0)) == pytest.approx(336, rel=0.02)  # 336 in Hawkins and Olwell (1998), h = 4


def test_simulated_run_length_is_that_of_the_formula():
    """With a reference that is known exactly."""

    class Exact(Reference):
        frames = 10**12

        def scores(self, values):
            return values

    chart = Chart(Exact(np.zeros((1, 4000)), np.ones(4000)), 400.0)
    generator, first = stream(0, "exact chart"), np.full(4000, np.nan)
    for frame in range(2500):
        begins = chart.step(generator.standard_normal(4000))
        first = np.where(begins & np.isnan(first), frame + 1, first)
    mean = np.nanmean(np.where(np.isnan(first), 2500, first))
    assert 0.8 * 400 < mean < 1.3 * 400


@pytest.mark.parametrize(("phi", "frames"), [(0.0, 300), (0.5, 300), (0.8, 300), (0.9, 300), (0.0, 100), (0.8, 100)])
def test_less_than_one_false_alarm_an_hour_for_all_quantities_together(phi, frames):
    runs, length = 200, 4500
    series = autoregressive(stream(0, "false alarms", phi, frames), phi, runs)
    reference = Reference.of([next(series) for _ in range(frames)])
    chart = Chart(reference, FRAMES_BETWEEN_FALSE_ALARMS)
    alarms = sum(int(chart.step(next(series)).sum()) for _ in range(length))
    assert len(QUANTITIES) * alarms / (runs * length / HOUR) < 1.0


@pytest.mark.parametrize("law", [*list(LAWS)[3:8], *list(LAWS)[9:11]])
def test_scatter_that_is_no_normal_autoregression_raises_as_few(law):
    """Frames that stand out, heavy tails, skew, stop and go, slow scenery below the scatter of the estimates."""
    bound = 3.0 if " and white" in law else 1.0  # slow scenery is not kept to one: docs/monitor.md
    assert false_alarms(law, series=150, frames=3000)["alarms_an_hour"] < bound


def test_scores_are_those_of_ranks_bounded_and_none_where_the_change_is_too_small_to_matter():
    values = stream(0, "scores").normal(1.0, SPREAD, 301)
    reference = Reference.of(values)
    middle, largest, end = float(np.median(values)), float(values.max()), float(reference.scores(values.max() + 1e-9))
    assert float(reference.median) == middle and float(reference.scores(middle)) == pytest.approx(0.0, abs=1e-9)
    assert 2.8 < end < 3.0 and float(reference.scores(-100.0)) == pytest.approx(-end, abs=1e-6)
    assert float(reference.scores(100.0)) == pytest.approx(1 + (end - 1) * float(reference.long_run_variance), rel=1e-4)
    transformed = Reference.of(np.exp(5 * values))
    for value in np.linspace(values.min(), largest, 20):
        assert transformed.scores(np.exp(5 * value)) == pytest.approx(reference.scores(value))
    assert float(Reference.of(np.full(200, 0.7)).scores(0.71)) == pytest.approx(0.5)  # half of 2 %


def test_an_alarm_stands_until_the_sum_is_back_at_zero():
    class Raw(Reference):
        def scores(self, values):
            return values

    chart = Chart(Raw(np.zeros((300, 1)), np.ones(1)), FRAMES_BETWEEN_FALSE_ALARMS)
    begun = [bool(chart.step([3.0])[0]) for _ in range(6)]
    assert sum(begun) == 1
    while chart.total[0] > chart.threshold[0]:
        chart.step([0.0])
    assert 0 < chart.total[0] <= chart.threshold[0] and chart.alarm[0]
    assert not any(chart.step([3.0])[0] for _ in range(6))  # the same alarm, above the threshold again
    while chart.total[0] > 0:
        assert chart.alarm[0]
        chart.step([0.0])
    assert not chart.alarm[0]


def test_a_large_shift_is_seen_within_a_second_and_an_alarm_clears():
    """By most of 200 charts; a reference that may hide slow scenery makes a chart slower."""
    generator = stream(0, "shift")
    chart = Chart(Reference.of(generator.normal(0, SPREAD, (300, 200))), FRAMES_BETWEEN_FALSE_ALARMS)
    for values in generator.normal(0, SPREAD, (100, 200)):
        assert not chart.step(values).any()
    delay = np.zeros(200)
    for values in generator.normal(5 * SPREAD, SPREAD, (100, 200)):
        delay += ~chart.alarm
        chart.step(values)
    assert delay.min() >= 3 and np.median(delay) <= 5 and np.quantile(delay, 0.8) <= 10 and delay.max() <= 50
    for values in generator.normal(0, SPREAD, (30, 200)):
        chart.step(values)
    assert chart.alarm.mean() < 0.3


def test_an_alarm_that_stood_for_long_clears_as_soon_as_a_short_one():
    generator, clear = stream(0, "long alarm"), []
    reference = Reference.of(generator.normal(0, SPREAD, (300, 200)))
    later = generator.normal(0, SPREAD, (200, 200))
    for frames in (100, 1000):
        chart = Chart(reference, FRAMES_BETWEEN_FALSE_ALARMS)
        for values in generator.normal(5 * SPREAD, SPREAD, (frames, 200)):
            chart.step(values)
        assert chart.alarm.all()
        for values in later:
            chart.step(values)
            clear.append(chart.alarm.mean())
    np.testing.assert_allclose(clear[:200], clear[200:], atol=0.02)
    assert clear[40] < 0.3 and clear[-1] == 0


def test_a_single_leap_and_missing_values_raise_nothing():
    chart = Chart(Reference.of(stream(0, "leap").normal(0, SPREAD, 300)), FRAMES_BETWEEN_FALSE_ALARMS)
    assert not chart.step(100.0)
    before = float(chart.total)
    assert not chart.step(np.nan) and float(chart.total) == before
    assert float(chart.threshold) > SHIFT_SIGMAS


def mtf(level):
    return np.full((2, 8), level)


def run(levels, name, spread=0.05):
    """Alarms of a series of (sigma DN, mean MTF) of a camera at 10 frames per second."""
    generator, trend, alarms = stream(0, "series", name), ConditionTrend(), []
    for sigma, level in levels:
        scatter = np.exp(spread * generator.standard_normal(2))
        alarms += trend.step(sigma * scatter[0], np.clip(mtf(level) * scatter[1], 0, 1))
    return alarms, trend


def test_slow_defocus_a_wet_lens_and_a_rising_temperature_raise_alarms_in_time():
    """Bounds of the delays in seconds."""
    calm = [(3.0, 0.6)] * (REFERENCE_FRAMES + 200)
    assert run(calm, "calm")[0] == []
    defocus = [(3.0, 0.6 * np.exp(-0.5 * t / 3000)) for t in range(3000)]  # half a neper in five minutes
    wet = [(3.0, 0.35)] * 100
    warm = [(3.0 * 2 ** (t / 1200), 0.6) for t in range(1200)]  # twice the noise in two minutes
    bounds = {
        "defocus": (defocus, "blur horizontal", 120.0),
        "wet": (wet, "blur vertical", 2.0),
        "warm": (warm, "noise", 40.0),
    }
    for name, (fault, quantity, most_s) in bounds.items():
        alarms, trend = run(calm + fault, name)
        alarm = next(alarm for alarm in alarms if alarm.quantity == quantity)
        assert 0 < (alarm.frame - len(calm)) / 10 < most_s, (name, alarm)
        assert trend.state() == "alarm" and quantity in trend.active
        assert alarm.since_frame <= alarm.frame and "since frame" in alarm.words()
        other = {"noise"} - {quantity} if quantity != "noise" else {"blur horizontal", "blur vertical"}
        assert not other & {alarm.quantity for alarm in alarms}


def test_an_alarm_of_blur_names_noise_that_has_grown_too():
    calm, worse = [(2.0, 0.6)] * (REFERENCE_FRAMES + 100), [(8.0, 0.5)] * 100
    alarms = {alarm.quantity: alarm for alarm in run(calm + worse, "noise and blur")[0]}
    assert alarms["blur vertical"].noisier and "noise has grown too" in alarms["blur vertical"].words()
    assert not alarms["noise"].noisier and "too" not in alarms["noise"].words()
    alone = run(calm + [(2.0, 0.5)] * 100, "blur alone")[0]
    assert alone and not any(alarm.noisier for alarm in alone)


def test_an_alarm_states_levels_and_the_frame_of_the_change():
    calm = [(2.0, 0.6)] * (REFERENCE_FRAMES + 100)
    (alarm,) = [part for part in run(calm + [(8.0, 0.6)] * 50, "noise step")[0] if part.quantity == "noise"]
    assert abs(alarm.since_frame - len(calm)) <= 2
    assert alarm.reference == pytest.approx(2.0, rel=0.05) and alarm.level == pytest.approx(8.0, rel=0.15)


def test_alarms_and_drifts_name_the_pictures_of_frames_that_have_names():
    """As of every third frame of a video, in which the noise grows within the reference and leaps at frame 1200."""
    scatter, trend, alarms = stream(0, "named frames").normal(0, 0.02, 450), ConditionTrend(120), []
    for number in range(450):
        sigma = 2.0 * np.exp(0.01 * min(number, 120) + scatter[number]) * (3 if number >= 400 else 1)
        alarms += trend.step(sigma, mtf(0.5), f"a\n.mp4#{3 * number}")
    drifted, (alarm,) = trend.drifts["noise"], alarms
    assert drifted.pictures == ("a\n.mp4#0", "a\n.mp4#357") and drifted.instead == (120, 239)
    assert drifted.words().endswith(
        r" DN within a\n.mp4#0 to a\n.mp4#357, compared with a\n.mp4#360 to a\n.mp4#717 since"
    )
    assert (alarm.since_frame, alarm.since_picture) == (400, "a\n.mp4#1200")
    assert alarm.words().endswith(r" DN since a\n.mp4#1200")


def test_short_references_are_refused():
    with pytest.raises(InputError, match="at least 100"):
        ConditionTrend(99)
    with pytest.raises(InputError, match="at least 100"):
        Reference.of(np.zeros(99))


def test_a_reference_of_what_is_no_number_is_refused():
    values = np.zeros(200)
    values[7] = np.nan
    with pytest.raises(InputError, match="no numbers"):
        Reference.of(values)


@pytest.mark.parametrize(("phi", "frames"), [(0.0, 100), (0.8, 100), (0.9, 100), (0.0, 300), (0.8, 300), (0.95, 300)])
def test_stationary_autocorrelated_references_are_not_found_to_drift(phi, frames):
    runs = 4000
    series = autoregressive(stream(0, "stationary reference", phi, frames), phi, runs)
    assert drift([next(series) for _ in range(frames)])[2].mean() < 0.005


@pytest.mark.parametrize(("frames", "least_share"), [(100, 0.75), (300, 0.99)])
def test_references_that_change_by_ten_spreads_drift_up_or_down_at_once_or_steadily(frames, least_share):
    runs, time, m = 200, np.linspace(0, 1, frames)[:, None], frames // 3
    series = autoregressive(stream(0, "drifting reference", frames), 0.5, runs)
    noise = np.array([next(series) for _ in range(frames)])
    for change in (time, -time, time > 0.5, 1 - np.exp(-3 * time)):
        first, last, drifted = drift(noise + 10 * SPREAD * change)
        assert drifted.mean() > least_share
        expected = 10 * SPREAD * (np.mean(change[-m:]) - np.mean(change[:m]))
        assert np.mean(last - first) == pytest.approx(expected, abs=0.1 * SPREAD)


def test_a_smooth_drift_counts_and_one_too_small_to_matter_does_not():
    time, scatter = np.linspace(0, 1, 300), stream(0, "smooth drift").normal(0, 0.002, 300)
    assert drift(0.5 * time)[2] and drift(0.5 * time + scatter)[2]
    assert not drift(0.1 * time + scatter)[2]  # significant, but the thirds differ by 0.07
    with pytest.raises(InputError, match="at least 100"):
        drift(np.zeros(99))


def test_a_camera_that_defocuses_within_its_reference_frames_is_not_watched_until_it_is_steady():
    defocus = [(3.0, 0.8 * np.exp(-1.0 * min(t, REFERENCE_FRAMES) / REFERENCE_FRAMES)) for t in range(900)]
    alarms, trend = run(defocus[:REFERENCE_FRAMES], "defocus in the reference")
    assert not alarms and trend.watched == ("noise",) and not trend.learning
    change = trend.drifts["blur horizontal"]
    assert set(trend.drifts) == {"blur horizontal", "blur vertical"} and change.instead is None
    assert (change.first_frame, change.last_frame) == (0, REFERENCE_FRAMES - 1)
    assert change.before == pytest.approx(0.8 * np.exp(-1 / 6), rel=0.03)
    assert change.after == pytest.approx(0.8 * np.exp(-5 / 6), rel=0.03)
    assert change.words().startswith("blur horizontal: mean MTF 0.6") and change.words().endswith("frames 0 to 299")
    alarms, trend = run(defocus, "defocus in the reference")
    assert not alarms and trend.watched == QUANTITIES
    assert trend.drifts["blur vertical"].instead == (300, 599)
    assert trend.drifts["blur vertical"].words().endswith("compared with frames 300 to 599 since")
    alarms, trend = run(defocus + [(3.0, 0.15)] * 50, "defocus in the reference")
    assert {alarm.quantity for alarm in alarms} == {"blur horizontal", "blur vertical"}


def test_a_defocus_that_goes_on_raises_its_alarm_against_the_first_reference():
    """No later reference takes over that would forget it."""
    defocus = [(3.0, 0.8 * np.exp(-3.0 * t / 900)) for t in range(1500)]
    alarms, trend = run(defocus, "defocus that goes on")
    assert trend.drifts["blur horizontal"].instead is None and trend.state() == "alarm"
    assert {alarm.quantity for alarm in alarms} == {"blur horizontal", "blur vertical"}


def test_a_reference_that_is_steady_but_worse_than_the_first_does_not_take_over():
    """It would forget the alarm, and what the camera was before."""
    ramp = [(3.0, 0.8 * np.exp(-0.7 * min(t, REFERENCE_FRAMES) / REFERENCE_FRAMES)) for t in range(REFERENCE_FRAMES)]
    alarms, trend = run(ramp + [(3.0, 0.25)] * 2 * REFERENCE_FRAMES, "steady but worse")
    assert {alarm.quantity for alarm in alarms} == {"blur horizontal", "blur vertical"}
    assert trend.state() == "alarm" and trend.drifts["blur horizontal"].instead is None
