"""Maps, thumbnails and plots of ``camera-monitor health``: text that can be read, flags in captions, sources apart."""

from __future__ import annotations

import re

import numpy as np
import pytest
from data_makers import picture
from health_makers import CONDITION, frame_row, run_of
from matplotlib.figure import Figure
from matplotlib.text import Text

from pipeline.cli.health import picture as health_picture
from pipeline.cli.health.page import MOST_SOURCES, PageFrames, page
from pipeline.condition import ConditionMonitor

SHOWN_PX = 480  # width of a map on the page, of a window of 1400 px
LEAST_PX = 9.0
NEW_FIGURE = health_picture.style.new_figure


def kept_figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Figures as they are drawn from now on."""
    figures: list[Figure] = []

    def new_figure(width_in: float, height_in: float) -> Figure:
        figures.append(NEW_FIGURE(width_in, height_in))
        return figures[-1]

    monkeypatch.setattr(health_picture.style, "new_figure", new_figure)
    return figures


@pytest.mark.parametrize(("width_px", "height_px"), [(640, 480), (1242, 375)])
@pytest.mark.parametrize("reason", [{}, {"alternating": 3}])
def test_the_text_of_maps_can_be_read_on_the_page_and_is_inside_the_picture(monkeypatch, width_px, height_px, reason):
    image = (picture("maps", width_px, height_px) / 255).astype(np.float32)
    condition = ConditionMonitor(noise_name="pca").frame(image)
    if reason:
        condition.noise.summary.value[...] = np.nan
        monkeypatch.setattr(type(condition), "reasons", {"noise": reason, "blur": {}})
    drawn = kept_figures(monkeypatch)
    pixels = health_picture.draw(image, condition)
    (figure,) = drawn
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    smallest_px = min(text.get_fontsize() for text in texts) / 72 * SHOWN_PX / figure.get_size_inches()[0]
    assert smallest_px >= LEAST_PX
    assert any(re.fullmatch(r"(>?\d\.\d\d\n>?\d\.\d\d)", text.get_text()) for text in texts)
    titles = [text for text in texts if text.get_text().startswith(("Noise: ", "Blur: "))]
    assert not any("nan" in text.get_text() for text in titles)  # this estimator has no interval
    assert len(titles) == 2 and all(text.get_window_extent().x1 <= pixels.shape[1] for text in titles)
    assert max(text.get_window_extent().y1 for text in titles) <= pixels.shape[0]


def test_numbers_that_would_be_too_small_to_read_are_left_out(monkeypatch):
    monkeypatch.setattr(health_picture, "NUMBERS_PT", health_picture.LEAST_NUMBERS_PT / 2)
    drawn = kept_figures(monkeypatch)
    image = (picture("maps", 640, 480) / 255).astype(np.float32)
    health_picture.draw(image, ConditionMonitor(noise_name="pca").frame(image))
    assert not any("\n" in text.get_text() for text in drawn[0].findobj(Text))


def page_of(names: list[str], **changes: object) -> str:
    """The page of a run on frames of these names."""
    frames = PageFrames(lambda image, condition: np.full((30, 60, 3), 120, np.uint8))
    rows = [frame_row(0, picture=name, **changes) for name in names]
    for row in rows:
        frames.add(row, np.ones((20, 40), np.float32), CONDITION)
    return page(run_of(rows, complete=True).content(), frames)


def test_captions_name_flags_and_white_frames_have_a_border():
    html = page_of(["a.png", "b.png"], flags="black, over_exposed", blur="", noise="", sigma_dn=np.nan)
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", html)
    assert len(captions) == 4 and all(text.count("black; over-exposed") == 1 for text in captions)
    assert ".thumbnails img { border: 1px solid" in html
    assert "<td>blur unknown; noise unknown (at most 3 DN)</td><td>black, over-exposed</td>" in html


def test_plots_mark_where_the_next_video_or_folder_begins():
    names = ["v.mp4#0", "v.mp4#1", "w.mp4#0", "w.mp4#1", "c/1.png", "c/2.png"]
    html = page_of(names)
    plots = re.findall(r"<svg.*?</svg>", html)
    assert len(plots) == 2 and "the next of the 3 videos or folders begins" in html
    for svg in plots:
        assert re.findall(r'class="source" x1="([\d.]+)"', svg) == ["333.3", "666.7"]
    assert plots[0].count('<polyline class="first"') == 3  # no line leads from one source to the next
    for one_source in (names[:2], [f"{number}/a.png" for number in range(MOST_SOURCES + 1)]):
        html = page_of(one_source)
        assert 'class="source"' not in html and "begins" not in html
