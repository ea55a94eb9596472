"""The plots of the page of ``camera-monitor health``: what they show of many frames."""

from __future__ import annotations

import re

import pytest

from pipeline.cli.health.trend_plot import HEIGHT, MOST_BINS, Line, plot


def heights(svg):
    """Of every point of the lines, from the bottom, as a fraction of the plot."""
    points = re.findall(r'<polyline class="first" points="([^"]*)"/>', svg)
    return [1 - float(point.split(",")[1]) / HEIGHT for run in points for point in run.split(" ")]


@pytest.mark.parametrize("frame", range(8))
@pytest.mark.parametrize("value", [20.0, 1.0])
def test_a_single_frame_far_off_shows_among_many(frame, value):
    values = [5.0] * 4 * MOST_BINS
    values[frame] = value
    drawn = plot("noise", [Line("noise", values, "first")], least_high=20.0)
    shown = heights(drawn.svg)
    assert len(shown) <= 2 * MOST_BINS
    assert any(abs(height * drawn.high - value) < 0.05 for height in shown)
