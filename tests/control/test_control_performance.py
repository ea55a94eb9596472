"""The surface as a controller asks it."""

from __future__ import annotations

import numpy as np
import pytest
from control_makers import SIZES, formula_ap, performance

from pipeline.control.performance import Performance
from pipeline.errors import InputError


def test_performance_equals_the_measured_points_and_is_refused_outside():
    known = performance()
    sigma = np.array([1.0, 6.0, 21.0, 41.0])
    found = known.expected(sigma[:, None], SIZES[None])
    np.testing.assert_allclose(found.ap_percent, formula_ap(sigma[:, None], SIZES[None]), atol=1.0)
    assert (found.low <= found.ap_percent + 1e-9).all() and (found.high >= found.ap_percent - 1e-9).all()
    assert np.isnan(known.expected([42.0, 5.0], [3.0, 32.0]).ap_percent).all()
    assert known.expected(0.0, 3.0).ap_percent == known.expected(1.0, 3.0).ap_percent  # less noise than was measured
    assert known.excess(20.0, 10.0) == 0 and known.excess(82.0, 10.0) == pytest.approx(1.0)


def test_performance_is_the_surface_between_its_points():
    known = performance()
    from pipeline.control.motion import motion_mtf

    for sigma, motion in ((8.3, 5.2), (17.0, 13.0), (33.3, 25.0)):
        direct = known.surface.at(sigma, float(motion_mtf(motion, known.reference, 0)))[0]
        assert float(known.expected(sigma, motion).ap_percent) == pytest.approx(direct, abs=1.5)


def test_performance_saved_is_the_same(tmp_path):
    known = performance()
    known.save(tmp_path / "surface.npz")
    again = Performance.load(tmp_path / "surface.npz")
    np.testing.assert_array_equal(
        again.expected([5, 12], [1, 9]).ap_percent, known.expected([5, 12], [1, 9]).ap_percent
    )
    np.savez(tmp_path / "other.npz", reference=np.ones(3))
    with pytest.raises(InputError, match="control_surface"):
        Performance.load(tmp_path / "other.npz")
