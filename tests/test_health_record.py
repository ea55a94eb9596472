"""The documents state the run times of `camera-monitor health` that its record holds."""

from __future__ import annotations

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULTS = json.loads((ROOT / "benchmarks/results/health.json").read_text(encoding="utf-8"))["results"]
GREY, COLOUR, EVERY = (RESULTS[name] for name in ("health", "health, colour", "health, every tile and patch"))


def numbers(document: str, pattern: str) -> list[float]:
    """The groups of a pattern, whose spaces stand for any white space, where it occurs in a document: once."""
    text = (ROOT / "docs" / document).read_text(encoding="utf-8")
    (match,) = re.finditer(pattern.replace(" ", r"\s+"), text)
    return [float(group) for group in match.groups()]


def test_the_monitors_document_states_the_speed_of_health() -> None:
    pattern = r"takes ([\d.]+) s of processor time \(([\d.]+) s in colour\), ([\d.]+) s on all of its tiles and patches"
    recorded = [round(each["processor_ms"] / 1000, 3) for each in (GREY, COLOUR, EVERY)]
    assert numbers("monitor.md", pattern) == recorded
    (per_second,) = numbers("monitor.md", r"patches: (\d+) frames a second, grey or in colour, on two free cores")
    assert all(round(each["clock_fps"]) == per_second for each in (GREY, COLOUR))


def test_the_document_on_scale_states_the_speed_of_health() -> None:
    row = r"health`, grey / colour \| (\d+) / (\d+) ms \| [^|]*15 000 frames \| (\d+) / (\d+) core minutes"
    each_ms = [each["processor_ms"] for each in (GREY, COLOUR)]
    minutes = [round(15_000 * milliseconds / 60_000) for milliseconds in each_ms]
    assert numbers("scale.md", row) == [*map(round, each_ms), *minutes]
