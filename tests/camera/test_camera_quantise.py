"""Full well, whole electrons, conversion and rounding."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera.quantise import as_image, collect, digitise, full_range, to_8bit
from pipeline.camera.sensor import Sensor
from pipeline.errors import InputError
from pipeline.streams import stream


def test_quantise_collect_saturates_and_keeps_whole_electrons():
    given_e = np.float32([-5.0, 0.0, 0.9, 1.0, 100.5, 19_999.9, 20_000.0, 25_000.0])
    np.testing.assert_array_equal(collect(given_e, Sensor()), [0, 0, 0, 1, 100, 19_999, 20_000, 20_000])
    assert given_e[0] == -5.0


def test_quantise_digitise_rounds_and_clips():
    sensor = Sensor()
    steps = np.float32([-300, 0, 39, 40, 117, 118, 20_000, 30_000])
    np.testing.assert_array_equal(digitise(steps, sensor), [0, 0, 0, 1, 1, 2, 255, 255])
    np.testing.assert_array_equal(digitise(steps, sensor.at_gain(2))[-2:], [255, 255])


@given(dn=st.integers(0, 255), gain=st.sampled_from([1.0, 2.0, 7.5]), full_well=st.sampled_from([5e3, 2e4, 1e5]))
def test_quantise_every_grey_level_survives_the_way_there_and_back(dn, gain, full_well):
    sensor = Sensor(full_well_e=full_well, gain=gain)
    image = np.full((1, 1), dn / 255, np.float32)
    assert digitise(sensor.electrons(image), sensor)[0, 0] == dn
    if gain <= 2.0:  # half a DN is more than one electron
        assert digitise(collect(sensor.electrons(image), sensor), sensor)[0, 0] == dn


def test_quantise_adds_a_twelfth_of_a_squared_dn():
    ramp = np.linspace(20, 200, 1_000_001, dtype=np.float64)
    error = digitise((ramp / Sensor().dn_per_electron).astype(np.float32), Sensor()) - ramp
    assert abs(error.var() - 1 / 12) < 1e-3
    assert abs(error.mean()) < 1e-3


def test_quantise_full_range_and_8bit_are_inverse():
    every = np.arange(256, dtype=np.float32).reshape(16, 16)
    image = full_range(every)
    np.testing.assert_array_equal(image, np.arange(256).reshape(16, 16).astype(np.float32) / np.float32(255))
    np.testing.assert_array_equal(to_8bit(image), every.astype(np.uint8))
    np.testing.assert_array_equal(to_8bit(np.float32([[-0.1, 0.499 / 255, 0.501 / 255, 1.7]])), [[0, 0, 1, 255]])


def test_quantise_writes_where_it_is_told():
    electrons = np.full((3, 4), 7999.7, np.float32)
    assert collect(electrons, Sensor(), out=electrons) is electrons
    assert digitise(electrons, Sensor(), out=electrons) is electrons
    assert full_range(electrons, out=electrons) is electrons
    assert electrons[0, 0] == np.float32(102) / np.float32(255)


def test_quantise_an_image_is_the_same_as_a_tensor_with_a_gradient():
    grey = stream(1, "image").random((6, 7)).astype(np.float32)
    eight = to_8bit(grey)
    np.testing.assert_array_equal(as_image(torch.from_numpy(grey).requires_grad_()), grey)
    np.testing.assert_array_equal(as_image(torch.from_numpy(eight)), as_image(eight))


def test_quantise_an_image_with_masked_pixels_is_refused():
    grey = stream(1, "image").random((6, 7)).astype(np.float32)
    with pytest.raises(InputError, match="image: masked pixels"):
        as_image(np.ma.masked_greater(grey, 0.9))
    np.testing.assert_array_equal(as_image(np.ma.array(grey)), grey)  # none is masked
