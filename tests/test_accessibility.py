"""The pages in headless Chromium at phone and desktop width: clean by axe, no console message, request or overflow."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from browser import BROWSER, inspected

sys.path.insert(0, str(Path(__file__).parent / "report"))

from health_makers import CONDITION, frame_row, run_of
from report_makers import make_all

from pipeline.cli.health.page import PageFrames, page
from pipeline.report.build import build

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed to open the pages in"),
]
WIDTHS_PX = {"phone": 390, "desktop": 1280}


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, str]:
    """The page of a run of health, and a report built from small results."""
    frames, rows = PageFrames(lambda image, condition: np.full((500, 700, 3), 120, np.uint8)), []
    for number in range(12):
        row = frame_row(number, picture=f"drive.mp4#{number}", alarms="noise, trend blur" if number > 8 else "")
        frames.add(row, np.full((192, 256), 0.4, np.float32), CONDITION)
        rows.append(row)
    health = page(run_of(rows, set_aside=["x.png: cannot be read"], complete=True).content(), frames)
    folder = tmp_path_factory.mktemp("report")
    build(make_all(tmp_path_factory.mktemp("stages"), ("sim",), ("pca", "bf")), folder)
    return {"health": health, "report": (folder / "index.html").read_text(encoding="utf-8")}


@pytest.mark.parametrize("width", WIDTHS_PX)
@pytest.mark.parametrize("name", ["health", "report"])
def test_pages_are_accessible(name, width, pages, tmp_path):
    shown = inspected(pages[name], WIDTHS_PX[width], tmp_path)
    assert shown["violations"] == []
    assert shown["overflow"] <= 0 and shown["requests"] == [] and shown["console"] == []


def test_axe_reports_what_is_wrong(tmp_path):
    """A page with a picture without a text, grey on grey, and wider than the window."""
    html = (
        '<!DOCTYPE html><html lang="en"><head><title>a</title></head><body><main><h1>words</h1>'
        '<p style="color: #bbb">grey on white</p>'
        '<img src="data:image/gif;base64,R0lGODlhAQABAAAAACw="><div style="width: 3000px">b</div></main></body></html>'
    )
    shown = inspected(html, 390, tmp_path)
    assert {rule["id"] for rule in shown["violations"]} >= {"image-alt", "color-contrast"}
    assert shown["overflow"] > 2000
