"""Wrong arguments of experiments in Python end in one line that says what was expected, not in a KeyError."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data_makers import make_folder

from pipeline import datasets
from pipeline import noise as noise_estimators
from pipeline.blur.base import BlurEstimate
from pipeline.datasets.dataset import Dataset
from pipeline.datasets.patches import Patch
from pipeline.datasets.settings import DatasetSettings
from pipeline.errors import InputError
from pipeline.experiments import frames, noise, table_one
from pipeline.experiments.condition import grid, sharp_kernel
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Method, run

WAVELET = noise_estimators.create("wavelet")


class Half:
    """An MTF of one half everywhere."""

    def estimate(self, patches: Any) -> BlurEstimate:
        count = len(patches)
        return BlurEstimate(np.full((count, 2, 8), 0.5), np.zeros(count, bool), np.full(count, ""))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return datasets.open_dataset("folder", "mine", make_folder(tmp_path_factory.mktemp("mine"), frames=1, labels=False))


@pytest.fixture(scope="module")
def tiles(dataset: Dataset) -> list[TestFrame]:
    return frames.of_dataset(dataset, "sigma_dn", 1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("sigma",), "quantity 'sigma': expected 'mtf' or 'sigma_dn'"),
        (("blur",), "quantity 'blur': expected"),
        (("mtf", 0), "per_frame=0: expected at least 1, or None"),
    ],
)
def test_frames_of_an_unknown_quantity_are_refused(arguments: Any, words: str, dataset: Dataset) -> None:
    with pytest.raises(InputError, match=words):
        frames.of_dataset(dataset, *arguments)


def test_patches_of_an_unknown_quantity_and_of_none_are_refused() -> None:
    wrong: Any = {"sigma": None}
    with pytest.raises(InputError, match="quantity 'sigma': expected"):
        frames.of_index(Path("nowhere"), "mine", DatasetSettings(kind="folder", root=".", dvc_dependency="."), wrong)
    with pytest.raises(InputError, match="quantity 'sigma': expected"):
        frames.with_patches([], wrong, "here")
    with pytest.raises(InputError, match="here: no quantity to be estimated; expected mtf or sigma_dn"):
        frames.with_patches([], {}, "here")


CALLS: list[tuple[Callable[[list[TestFrame]], Any], str]] = [
    (lambda tiles: noise.measure({"a": "pca"}, tiles, ["dcsn"], [0]), r"'a': .*as pipeline\.noise\.create.*not 'pca'"),
    (lambda tiles: noise.measure({"a": type(WAVELET)}, tiles, ["dcsn"], [0]), "'a': expected an object.*not <class"),
    (lambda tiles: noise.measure(["pca"], tiles, ["dcsn"], [0]), "name -> estimator, not list"),  # type: ignore[arg-type]
    (lambda tiles: noise.measure({}, tiles, ["dcsn"], [0]), "estimators: .*name -> estimator, not none"),
    (lambda tiles: noise.measure({"a": WAVELET}, tiles, [], [0]), "noise_sources: expected at least one"),
    (lambda tiles: noise.measure({"a": WAVELET}, tiles, ["dcsn"], []), "target_sigmas_dn: expected at least one"),
    (lambda tiles: noise.measure({"a": WAVELET}, [], ["dcsn"], [0]), "none has a patch for 'sigma_dn'"),
    (
        lambda tiles: noise.measure({"a": WAVELET}, [item.frame for item in tiles], ["dcsn"], [0]),  # type: ignore[misc]
        "expected pipeline.experiments.frames.TestFrame.*not Frame",
    ),
    (lambda tiles: table_one.measure({"a": "spectral"}, tiles), r"as pipeline\.blur\.create.*not 'spectral'"),
    (lambda tiles: table_one.measure({"a": Half()}, tiles, []), "none has a patch for 'mtf'.*of_dataset"),
    (lambda tiles: table_one.measure({"a": Half()}, tiles, [np.ones((3, 3))]), "kernels: .*Kernel.* not ndarray"),  # type: ignore[list-item]
    (
        lambda tiles: run(tiles, grid([sharp_kernel()]), [Method("a", "sigma", WAVELET)]),  # type: ignore[arg-type]
        "quantity 'sigma': expected",
    ),
    (
        lambda tiles: run(tiles, grid([sharp_kernel()]), [Method("a", "sigma_dn", WAVELET)] * 2),
        "two estimators of sigma_dn are called 'a'",
    ),
]


@pytest.mark.parametrize("number", range(len(CALLS)))
def test_wrong_arguments_of_experiments_say_what_was_expected(number: int, tiles: list[TestFrame]) -> None:
    call, words = CALLS[number]
    with pytest.raises(InputError, match=words):
        call(tiles)


def test_an_estimator_of_noise_and_one_of_blur_may_have_one_name(tiles: list[TestFrame]) -> None:
    """As `cnn` in ``detection.measure`` or ``combined``; the one answered in the place of the other."""
    both = [TestFrame(item.frame, {**item.patches, "mtf": [Patch(0, 0, 192, "")]}) for item in tiles]
    methods = [Method("cnn", "mtf", Half()), Method("cnn", "sigma_dn", WAVELET)]
    table = run(both, grid([sharp_kernel()], ["dcsn"], [5]), methods)
    assert (table.loc[table["quantity"] == "mtf", "estimate"] == 0.5).all()
    alone = run(both, grid([sharp_kernel()], ["dcsn"], [5]), methods[1:])
    assert table.loc[table["quantity"] == "sigma_dn", "estimate"].tolist() == alone["estimate"].tolist()
