"""The page of ``camera-monitor health`` in a headless browser: no console message, no overflow, every picture shown."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import escape

import numpy as np
import pytest
from health_makers import CONDITION, frame_row, run_of

from pipeline.cli.health.page import PageFrames, page

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PROBE = """<script>addEventListener("load", () => { const root = document.documentElement;
const pictures = [...document.images].filter((picture) => picture.complete && picture.naturalWidth > 0);
parent.document.documentElement.dataset.probe = JSON.stringify({
width: innerWidth, content: root.scrollWidth, pictures: pictures.length, requests:
performance.getEntriesByType("resource").filter((entry) => !entry.name.startsWith("data:")).length,
smallest: Math.min(...[...document.querySelectorAll("p, li, td, figcaption, span")].filter((part) => part.innerText)
.map((part) => parseFloat(getComputedStyle(part).fontSize))) }); });</script>"""


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
@pytest.mark.parametrize("width_px", [390, 1280])
def test_the_page_fits_phones_and_desktops(tmp_path, width_px):
    frames, rows = PageFrames(lambda image, condition: np.full((500, 700, 3), 120, np.uint8)), []
    for number in range(12):
        name = f"/a/very/long/folder/without/a/break/{'drive' * 12}.mp4#{number}"
        row = frame_row(number, picture=name, alarms="noise, trend blur horizontal" if number > 8 else "")
        frames.add(row, np.full((192, 256), 0.4, np.float32), CONDITION)
        rows.append(row)
    html = page(run_of(rows, set_aside=[f"{'x' * 150}.png: cannot be read"], complete=True).content(), frames)
    probed = re.sub(r"<meta http-equiv=.Content-Security-Policy.*?>", "", html).replace("</head>", f"{PROBE}</head>")
    probed = probed.replace('loading="lazy"', 'loading="eager"')  # so that the event "load" waits for every picture
    frame = f'<iframe style="border: 0; width: {width_px}px; height: 1000px" srcdoc="{escape(probed)}"></iframe>'
    (tmp_path / "page.html").write_text(f"<!DOCTYPE html><body>{frame}</body>")  # windows are at least 500 px wide
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
        f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1400,1200", "--dump-dom",
        (tmp_path / "page.html").as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    match = re.search(r'data-probe="([^"]*)"', done.stdout)
    assert match, done.stderr[-2000:]
    probe = json.loads(match.group(1).replace("&quot;", '"'))
    assert probe["content"] <= probe["width"] == width_px
    assert probe["pictures"] == 12 + 6 and probe["requests"] == 0
    assert probe["smallest"] >= 11.5
    assert "CONSOLE" not in done.stderr
