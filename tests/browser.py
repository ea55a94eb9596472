"""A page in headless Chromium at a stated width: console, requests, overflow, and what axe finds (WCAG 2.1 A and AA).

``tests/vendor/axe.min.js`` is axe-core 4.12.1 of Deque Systems, unmodified (Mozilla Public License 2.0, in its header).
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import escape
from pathlib import Path
from typing import Any

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
AXE = Path(__file__).resolve().parent / "vendor/axe.min.js"
POLICY = re.compile(r"<meta http-equiv=.Content-Security-Policy.*?>")
PROBE = """<script>addEventListener("load", async () => {
const root = document.documentElement, overflow = root.scrollWidth - root.clientWidth;
const requests = performance.getEntriesByType("resource").map((entry) => entry.name)
.filter((name) => !name.startsWith("data:"));
const tags = {type: "tag", values: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]};
const result = await axe.run(document, {runOnly: tags, resultTypes: ["violations"], iframes: false});
const violations = result.violations.map((rule) => ({id: rule.id, help: rule.help, impact: rule.impact,
count: rule.nodes.length, nodes: rule.nodes.slice(0, 4).map((node) => node.html.slice(0, 160) + " | "
+ (node.any[0] || node.all[0] || {message: ""}).message)}));
parent.document.documentElement.dataset.probe = JSON.stringify({overflow, requests, violations}); });</script>"""


def inspected(html: str, width_px: int, folder: Path) -> dict[str, Any]:
    """What a browser and axe report of a page.

    Args:
        html: the page.
        width_px: of the window that it is shown in.
        folder: for the page and the browser's profile.

    Returns:
        ``overflow`` beyond the width in px, ``requests`` made, ``violations`` of axe, ``console`` messages.
    """
    assert BROWSER is not None
    axe = AXE.read_text(encoding="utf-8").replace("</script", "<\\/script")
    probed = POLICY.sub("", html).replace("</head>", f"<script>{axe}</script>{PROBE}</head>")
    frame = f'<iframe style="border: 0; width: {width_px}px; height: 1000px" srcdoc="{escape(probed)}"></iframe>'
    (folder / "page.html").write_text(f"<!DOCTYPE html><body>{frame}</body>", encoding="utf-8")
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
        "--virtual-time-budget=60000", f"--user-data-dir={folder / 'profile'}", "--window-size=1400,1200", "--dump-dom",
        (folder / "page.html").as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=400)
    match = re.search(r'data-probe="([^"]*)"', done.stdout)
    assert match, done.stderr[-2000:]
    content: dict[str, Any] = json.loads(match.group(1).replace("&quot;", '"').replace("&amp;", "&"))
    return {**content, "console": [line for line in done.stderr.splitlines() if "CONSOLE" in line]}
