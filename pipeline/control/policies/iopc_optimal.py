"""One jump to the settings with the highest expected average precision, held until the condition has changed.

The paper maximises AP over alpha (Wischow et al. 2023, Sec. VI); its printed formula scales noise and blur by the same
alpha, while they move in opposite directions: ``AP(sigma(alpha), d / alpha)`` here. A new jump is made when brightness
leaves the dead band or another split promises clearly more.
"""

from __future__ import annotations

import math

from pipeline.control.iopc import Choice, Frame, IopcPolicy


class IopcOptimal(IopcPolicy):
    """Argmax of the surface; takes what `IopcPolicy` takes."""

    def choose(self, frame: Frame) -> Choice:
        """See `IopcPolicy.choose`."""
        among = self.candidates(frame)
        index = self.preferred(frame, among)
        new, expected = among.states[index], among.ap_percent[index]
        if math.isnan(expected) and new == frame.kept:
            reason = "nothing was measured at any split; none is clearly nearer to the measured region"
        elif math.isnan(expected):
            reason = "nothing was measured at any split; nearest to the measured region"
        elif new == frame.kept:
            reason = f"AP {expected:.1f} % expected; no split promises clearly more"
        else:
            reason = f"noise {among.sigma_dn[index]:.1f} DN and motion {among.motion_px[index]:.1f} px expected"
        return Choice(new, reason, among)
