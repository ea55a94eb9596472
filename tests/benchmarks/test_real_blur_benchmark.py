"""The benchmark of blur on real pictures: what it compares with what, by an estimator whose answers are known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks import real_blur
from pipeline import store
from pipeline.blur.base import BlurEstimate
from pipeline.camera import mtf
from pipeline.camera.psf.defocus import create as disc
from pipeline.errors import InputError


class Brightness:
    """Answers with a patch's mean as its MTF everywhere, 0.1 less where calibrated; abstains from black patches."""

    def __init__(self, less: float = 0.0) -> None:
        self.less = less

    def calibrated(self, sharp_patches: np.ndarray) -> Brightness:
        assert sharp_patches.shape[1:] == (1, 192, 192)
        return Brightness(0.1)

    def estimate(self, patches: np.ndarray) -> BlurEstimate:
        mean = patches.mean(axis=(1, 2, 3))
        values = np.where(mean > 0, mean - self.less, np.nan)[:, None, None] * np.ones((1, 2, 8))
        reason = np.where(mean > 0, "", "flat")
        return BlurEstimate(values, mean == 0, reason, low=values - 0.02, high=values + 0.02)


@pytest.fixture(autouse=True)
def known_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real_blur.blur, "create", lambda *_, **__: Brightness())


def grey(value: int, side: int = 255) -> np.ndarray:
    return np.full((side, side), value / 255)


def test_a_photograph_is_covered_by_windows() -> None:
    picture = np.linspace(0, 1, 255 * 255).reshape(255, 255)
    windows = real_blur.windows(picture)
    assert windows.shape == (4, 1, 192, 192)
    assert windows[0, 0, 0, 0] == 0 and windows[3, 0, -1, -1] == 1
    np.testing.assert_array_equal(windows * 255, np.rint(windows * 255))


def test_shake_is_judged_by_the_measured_kernel(tmp_path: Path) -> None:
    kernels = {"a": disc(5.0), "b": disc(9.0)}
    for scene in ("one", "two"):
        for name, kernel in kernels.items():
            savemat(tmp_path / f"{scene}_{name}.mat", {"x": grey(200), "y": grey(102), "f": kernel})
    record = real_blur.shake(tmp_path)
    truth = {name: mtf.sample(kernel) for name, kernel in kernels.items()}
    assert len(record["photographs"]) == 4
    for row in record["photographs"]:
        known = truth[row["kernel"]]
        other = truth["b" if row["kernel"] == "a" else "a"]
        assert row["error_percent"]["pmp"] == pytest.approx(100 * np.abs(0.4 - known).mean(), abs=1e-2)
        assert row["error_percent"]["fused_other"] == pytest.approx(100 * np.abs(0.3 - known).mean(), abs=1e-2)
        assert row["error_percent"]["null"] == pytest.approx(100 * np.abs(other - known).mean(), abs=1e-2)
    pmp = [row["error_percent"]["pmp"] for row in record["photographs"]]
    assert record["summary"]["pmp"]["mean_percent"] == pytest.approx(np.mean(pmp), abs=1e-2)
    assert record["summary"]["pmp"]["greatest_percent"] == max(pmp)
    # Both scenes have the same two kernels: resamples of kernels are one, the other, or both.
    by_kernel = sorted(np.mean([pmp[0], pmp[2]]) + step * (np.mean([pmp[1], pmp[3]]) - np.mean([pmp[0], pmp[2]]))
                       for step in (0, 1))  # fmt: skip
    low, high = (record["summary"]["pmp"][f"{end}_percent"] for end in ("low", "high"))
    assert 0 <= low <= by_kernel[0] + 1e-2 and high >= by_kernel[1] - 1e-2


def test_one_scene_leaves_no_other_to_calibrate_to(tmp_path: Path) -> None:
    savemat(tmp_path / "one_a.mat", {"x": grey(200), "y": grey(102), "f": disc(5.0)})
    with pytest.raises(InputError, match="of 1 scenes; expected two at least"):
        real_blur.shake(tmp_path)


def test_pairs_are_compared_where_both_answer(tmp_path: Path) -> None:
    folder = tmp_path / "pairs"
    levels = {"near": (100, 103), "far": (100, 120), "dark": (0, 100)}
    for name, (real, mean) in levels.items():
        for ending, level in (("real", real), ("mean", mean)):
            store.write_image(folder / f"{name}_{ending}.png", np.full((200, 200), level, np.uint8))
    out = tmp_path / "record.json"
    real_blur.main(["--pairs", f"cc={folder}", "--out", str(out)])
    result = json.loads(out.read_text())["pairs"]["cc"]
    assert result["pictures"] == 3
    spectral = result["spectral"]
    assert (spectral["patches"], spectral["answered"]) == (12, 8)
    assert spectral["difference_percent"] == pytest.approx(100 * (3 + 20) / 2 / 255, abs=1e-2)
    assert spectral["held_fraction"] == pytest.approx(0.5)
    assert spectral["low_percent"] <= spectral["difference_percent"] <= spectral["high_percent"]


def test_nothing_to_measure_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        real_blur.main([])
    assert ended.value.code == 2
    assert "give --shake or --pairs" in capsys.readouterr().err
