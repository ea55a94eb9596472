"""Digests that are the same in every process: equal contents, equal digests; what has none is refused."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import blur, noise
from pipeline.camera.settings import CameraSettings
from pipeline.experiments.condition import Condition
from pipeline.recording.stable_digest import stable_digest


@dataclass(frozen=True)
class Named:
    name: str
    values: np.ndarray = field(compare=False)


@dataclass(frozen=True)
class OtherNamed(Named):
    pass


VALUES: list[Any] = [
    None, True, 1, 1.0, -1, 0.0, -0.0, float("nan"), "1", "", b"1", "None", Path("1"), Path("a/b"), "a/b",
    (), [], {}, (1,), [1], (1, (2,)), (1, 2), ((1, 2),), {1}, frozenset(), frozenset({"a", "b"}), {"a": "b"},
    {"b": "a"}, [["a"], "b"], ["a", ["b"]], ["ab"], ["a", "b"],
    np.float64(1.0), np.float32(1.0), np.zeros(2), np.zeros((2, 1)), np.zeros(2, np.float32), np.array(["a", "b"]),
    blur.create, noise.create, Named, OtherNamed,
    partial(blur.create, "a"), partial(blur.create, name="a"), partial(noise.create, "a"),
    Named("a", np.zeros(2)), Named("a", np.ones(2)), OtherNamed("a", np.zeros(2)), CameraSettings(),
    CameraSettings(light="linear"), Condition(), Condition(target_sigma_dn=1.0),
]  # fmt: skip


def test_different_values_have_different_digests() -> None:
    digests = [stable_digest(value) for value in VALUES]
    assert len(set(digests)) == len(VALUES)
    assert {len(digest) for digest in digests} == {64}


def test_equal_values_have_equal_digests_whatever_their_order_layout_and_identity() -> None:
    for value in VALUES:
        assert stable_digest(copy.deepcopy(value)) == stable_digest(value)
    assert stable_digest({"a": 1, "b": 2}) == stable_digest({"b": 2, "a": 1})
    assert stable_digest({"a", "b"}) == stable_digest(frozenset({"b", "a"}))
    assert stable_digest(partial(blur.create, a=1, b=2)) == stable_digest(partial(blur.create, b=2, a=1))
    matrix = np.arange(6.0).reshape(2, 3)
    assert stable_digest(matrix) == stable_digest(np.asfortranarray(matrix))
    name = "".join(["a", "b"])
    assert stable_digest([name, name]) == stable_digest(["ab", "".join(["a", "b"])])


def test_a_digest_is_that_of_other_versions_too() -> None:
    value = partial(blur.create, "spectral", words=frozenset({"a", "b"}), sizes=(1, 2.5, np.arange(3, dtype="<i4")))
    assert stable_digest(value) == "f99b4fcbd8d6d7527cee9c8f11f59367a62f9d39acd028fee5a3284c8036953a"


class Plain:
    """Without a digest: nothing tells what it holds."""


@pytest.mark.parametrize(
    "value", [Plain(), lambda: None, [Plain()], {"a": Plain()}, np.array([None]), [].append, object()]
)
def test_what_has_no_stable_digest_is_refused(value: Any) -> None:
    with pytest.raises(TypeError, match="no digest that is the same|does not stand for its content"):
        stable_digest(value)


def test_functions_within_functions_are_refused() -> None:
    def inner() -> None:
        """Its name is that of every other one made here, whatever it closes over."""

    with pytest.raises(TypeError, match="does not stand for its content"):
        stable_digest(partial(inner))
