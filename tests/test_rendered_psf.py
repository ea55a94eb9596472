"""Rendered optics of the benchmark of unseen kernels: what wave and geometric optics say they must be."""

from __future__ import annotations

import importlib.util
import itertools
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pipeline.camera import mtf
from pipeline.camera.psf.kernel import centroid_px
from pipeline.streams import stream

SCRIPT = Path(__file__).resolve().parents[1] / "benchmarks/rendered_psf.py"


@pytest.fixture(scope="module")
def optics() -> ModuleType:
    spec = importlib.util.spec_from_file_location("rendered_psf", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where dataclasses look for their annotations
    spec.loader.exec_module(module)
    return module


def light(optics: ModuleType, **lens: float) -> np.ndarray:
    return optics.Light.of(optics.Optics("probe", optics.FOCUS, optics.Lens(**lens)), 0).at()


def centred(whole: np.ndarray, half: int = 24) -> np.ndarray:
    """The middle of a rendered square, odd and about its own [n // 2, n // 2]."""
    middle = len(whole) // 2
    return whole[middle - half : middle + half + 1, middle - half : middle + half + 1]


def test_every_kernel_is_a_centred_psf_of_unit_sum(optics: ModuleType) -> None:
    bank = optics.bank(1)
    assert len({kernel.name for kernel in bank}) == len(bank) >= 16
    assert {kernel.kind for kernel in bank} == set(optics.GROUPS)
    for kernel in bank:
        assert kernel.psf.dtype == np.float32 and kernel.psf.min() >= 0
        assert kernel.psf.shape[0] == kernel.psf.shape[1] <= 33 and kernel.psf.shape[0] % 2 == 1
        assert kernel.psf.sum(dtype=np.float64) == pytest.approx(1, abs=1e-6)
        assert max(map(abs, centroid_px(kernel.psf))) < 0.05, kernel.name
    sizes = [kernel.size_px for kernel in bank]
    assert min(sizes) < 4 and 20 < max(sizes) < 33
    curves = [mtf.sample(kernel.psf) for kernel in bank]  # sixteen blurs, not a few of them again
    assert min(mtf.amae(one, other) for one, other in itertools.combinations(curves, 2)) > 1


@pytest.mark.parametrize("f_number", [16.0, 22.0])
def test_a_clear_aperture_has_the_diffraction_limited_mtf(optics: ModuleType, f_number: float) -> None:
    whole = light(optics, f_number=f_number)
    # Stopped down so far that the lens passes next to nothing beyond Nyquist, so that sampling adds nothing.
    frequencies = np.arange(1, len(whole) // 4) / len(whole)
    expected = optics.diffraction_mtf(f_number, frequencies) * np.sinc(frequencies)
    assert expected.min() < 0.5
    assert np.abs(mtf.curve(whole, 2 * frequencies) - expected).max() < 0.006


def test_a_round_pupil_out_of_focus_approaches_the_uniform_disc(optics: ModuleType) -> None:
    frequencies = np.linspace(0, 0.4, 33)
    disc = mtf.disc(15, 2 * frequencies) * np.sinc(frequencies)
    away = [
        np.abs(mtf.curve(light(optics, f_number=n, defocus_px=15.0), 2 * frequencies) - disc).max()
        for n in (5.6, 2.8, 1.4)
    ]
    assert away == sorted(away, reverse=True)
    assert away[-1] < 0.02 < 0.04 < away[0]


def test_the_pupils_shape_is_seen_out_of_focus(optics: ModuleType) -> None:
    """Far out of focus a lens draws its pupil: as large in area, with its hole and its corners."""
    clear = light(optics, f_number=2.8, defocus_px=18.0)
    mirror = light(optics, f_number=2.8, defocus_px=18.0, obstruction=0.5)
    # but for the spot in the very middle, where all rays round the hole meet in phase (Poisson's)
    position = np.arange(len(clear)) - len(clear) // 2
    hole = (np.hypot(position[:, None], position) < 3.5) & (np.hypot(position[:, None], position) > 1.5)
    assert mirror[hole].mean() < 0.25 * clear[hole].mean()
    square = centred(light(optics, f_number=2.8, defocus_px=18.0, blades=4, iris_deg=45))
    rows, columns = np.nonzero(square > 0.3 * np.median(square[square > 0.1 * square.max()]))
    # corners on the axes at the radius of the disc, edges half the square root of two nearer
    assert np.ptp(columns) + 1 == pytest.approx(18, abs=2.5) and np.ptp(rows) + 1 == pytest.approx(18, abs=2.5)
    assert np.ptp(rows + columns) / np.sqrt(2) == pytest.approx(18 / np.sqrt(2), abs=2.5)
    cut = centred(light(optics, f_number=2.8, defocus_px=18.0, vignetting=0.8))
    spread = [np.sqrt((cut.sum(axis=axis) * (np.arange(49) - centred_at) ** 2).sum()) for axis, centred_at in
              ((0, 24 + centroid_px(cut)[0]), (1, 24 + centroid_px(cut)[1]))]  # fmt: skip
    assert spread[0] < 0.75 * spread[1]


def test_aberrations_cost_contrast_and_coma_throws_light_to_its_side(optics: ModuleType) -> None:
    clear = mtf.sample(light(optics, f_number=4.0)).mean()
    for name in ("astigmatism", "coma", "spherical"):
        assert mtf.sample(light(optics, f_number=4.0, **{name: 0.3})).mean() < clear - 0.02, name
    tails = []
    for direction in (0.0, 180.0):
        profile = centred(light(optics, f_number=2.0, coma=0.8, coma_deg=direction)).sum(axis=0)
        position = np.arange(len(profile)) - (profile * np.arange(len(profile))).sum() / profile.sum()
        tails.append((profile * position**3).sum())
    assert tails[0] == pytest.approx(-tails[1], rel=0.01) and abs(tails[0]) > 1


def test_a_shaken_kernel_is_the_lens_times_the_path(optics: ModuleType) -> None:
    lens, shake = optics.Lens(2.8, defocus_px=4.0), optics.Shake(9.0, 0.25)
    still = optics.Light.of(optics.Optics("hand", optics.SHAKEN, lens), 3)
    shaken = optics.Light.of(optics.Optics("hand", optics.SHAKEN, lens, shake), 3)
    path = optics.shake_path(shake, stream(3, "hand shake", "hand"))
    assert max(np.ptp(path.real), np.ptp(path.imag)) == pytest.approx(9)
    turning = np.count_nonzero(np.diff(np.sign(np.diff(path.real)))) + np.count_nonzero(
        np.diff(np.sign(np.diff(path.imag)))
    )
    assert turning >= 2  # bent
    frequencies = mtf.FREQUENCIES / 2
    along = [np.abs(np.exp(-2j * np.pi * np.outer(frequencies, part)).mean(axis=1)) for part in (path.real, path.imag)]
    lens_mtf = mtf.sample(still.at())
    assert np.abs(mtf.sample(shaken.at()) - lens_mtf * np.stack(along)).max() < 0.01


def test_the_same_seed_gives_the_same_bytes(optics: ModuleType) -> None:
    few = tuple(one for one in optics.BANK if one.name in ("corner", "shaken corner"))
    first, again, other = (optics.bank(seed, few) for seed in (1, 1, 2))
    assert [kernel.psf.tobytes() for kernel in first] == [kernel.psf.tobytes() for kernel in again]
    same = {a.name: a.psf.tobytes() == b.psf.tobytes() for a, b in zip(first, other, strict=True)}
    assert same == {"corner": True, "shaken corner": False}
