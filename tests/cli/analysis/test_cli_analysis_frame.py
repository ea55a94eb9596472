"""The analysis of a frame: what is relative to sharp frames is first made absolute where that is asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from control_makers import REFERENCE, performance
from health_makers import KnownMonitor

from pipeline.cli.analysis.frame import FrameAnalysis, Settings, Thresholds


class OfWholeCamera(KnownMonitor):
    """The same condition with the contrast that sharp frames have in it."""

    def frame(self, image, codec="", quantiser=None):
        seen = super().frame(image)
        ends = {name: REFERENCE * getattr(seen.mtf, name) for name in ("value", "low", "high")}
        return replace(seen, blur=replace(seen.blur, summary=replace(seen.mtf, **ends)))


def test_advice_on_blur_relative_to_sharp_frames_is_that_on_the_blur_of_the_whole_camera():
    image, given = np.full((40, 40), 0.4, np.float32), (Thresholds(), performance(), Settings("16ms", 100))
    relative, absolute, mistaken = (
        FrameAnalysis(monitor, *given, relative=relative).analyse("a.png", image)[0]
        for monitor, relative in ((KnownMonitor(), True), (OfWholeCamera(), False), (KnownMonitor(), False))
    )
    names = ("advice", "exposure_ms", "iso", "best_exposure_ms", "best_iso", "best_ap_percent", "gain_percent")
    assert [relative[name] for name in names] == [absolute[name] for name in names]
    assert (relative["advice"], mistaken["advice"]) == ("hold", "move")  # the latter as if its lens had no blur
