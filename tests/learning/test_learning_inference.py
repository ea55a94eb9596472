"""Estimators answer alike whatever the program that calls them has set in torch."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import pytest

from pipeline import blur, detection, noise
from pipeline.learning import weights
from pipeline.streams import stream


def of_blur() -> np.ndarray:
    return stream(4, "inference").random((1, 1, 192, 192)).astype(np.float32)


def of_noise() -> np.ndarray:
    levels = np.rint(128 + 5 * stream(3, "inference").standard_normal((1, 1, 128, 128)))
    return (np.clip(levels, 0, 255) / 255).astype(np.float32)


ESTIMATORS = [
    *((blur.create, name, of_blur, "mtf") for name in ("spectral", "cnn", "fused")),
    *((noise.create, name, of_noise, "sigma_dn") for name in ("adaptive", "cellwise", "cnn", "correlated")),
]


@contextmanager
def half_precision() -> Iterator[None]:
    import torch

    with torch.autocast("cpu", torch.bfloat16):
        yield


@contextmanager
def new_tensors_in_double_precision() -> Iterator[None]:
    import torch

    torch.set_default_dtype(torch.float64)
    try:
        yield
        assert torch.get_default_dtype() == torch.float64  # the caller's setting stays
    finally:
        torch.set_default_dtype(torch.float32)


@pytest.mark.parametrize("setting", [half_precision, new_tensors_in_double_precision])
@pytest.mark.parametrize(("create", "name", "patches", "answer"), ESTIMATORS)
def test_a_callers_precision_changes_nothing(
    setting: Callable, create: Callable, name: str, patches: Callable, answer: str
) -> None:
    opened, given = create(name), patches()
    expected = getattr(opened.estimate(given), answer)
    assert np.isfinite(expected).all()
    with setting():
        np.testing.assert_array_equal(getattr(opened.estimate(given), answer), expected)
        np.testing.assert_array_equal(getattr(create(name).estimate(given), answer), expected)


def of_detection() -> np.ndarray:
    return np.kron(stream(5, "inference").random((16, 16)), np.ones((8, 8))).astype(np.float32)


@pytest.mark.parametrize("name", ["compact", "compact_two_stage"])
@pytest.mark.parametrize("setting", [half_precision, new_tensors_in_double_precision])
def test_a_callers_precision_leaves_detections_as_they_are(setting: Callable, name: str) -> None:
    opened, picture = detection.create(name, score_floor=0.0), of_detection()
    (expected,) = opened.detect([picture])
    assert len(expected)
    with setting():
        for detector in (opened, detection.create(name, score_floor=0.0)):
            (answer,) = detector.detect([picture])
            np.testing.assert_array_equal(answer.boxes, expected.boxes)
            np.testing.assert_array_equal(answer.score, expected.score)


def test_an_answer_changes_nothing_that_other_threads_see(monkeypatch: pytest.MonkeyPatch) -> None:
    """Networks that run in several threads do not set the type of new tensors, which holds for all of them."""
    import torch

    opened, given = noise.create("cellwise"), of_noise()
    expected = opened.estimate(given).sigma_dn
    with new_tensors_in_double_precision(), monkeypatch.context() as patched:
        patched.setattr(torch, "set_default_dtype", lambda kind: pytest.fail(f"{kind} set for all threads"))
        with ThreadPoolExecutor(4) as pool:
            answers = [answer.sigma_dn for answer in pool.map(opened.estimate, [given] * 8)]
    np.testing.assert_array_equal(answers, [expected] * 8)


def test_threads_that_make_networks_restore_what_the_caller_has_set() -> None:
    """The first to begin ends before the second does: made one by one, each is of float32 and leaves float64 behind."""
    import torch

    inside, begun = threading.Event(), threading.Event()

    def first() -> torch.nn.Module:
        inside.set()
        begun.wait(0.5)  # the second would be in the middle of it by now
        return torch.nn.Linear(3, 2)

    def second() -> torch.nn.Module:
        begun.set()
        threading.Event().wait(0.2)
        return torch.nn.Linear(3, 2)

    torch.manual_seed(5)
    before = torch.get_rng_state()
    with new_tensors_in_double_precision(), ThreadPoolExecutor(2) as pool:
        one = pool.submit(weights.untrained, first)
        inside.wait()
        other = pool.submit(weights.untrained, second)
        assert {made.result().weight.dtype for made in (one, other)} == {torch.float32}
    assert torch.equal(torch.get_rng_state(), before)
