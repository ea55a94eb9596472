"""The benchmark of words about blur: what it counts is what the monitor states, and its record what docs say."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from benchmarks import blur_words, common
from pipeline.camera.mtf import FREQUENCIES
from pipeline.errors import InputError


def condition_of(patches: np.ndarray) -> SimpleNamespace:
    """A condition by the MTF (N, 2, 8) of patches, whose intervals have no width."""
    middle = np.median(patches, axis=0)
    estimate = SimpleNamespace(mtf=patches, low=patches, high=patches)
    return SimpleNamespace(
        blur=SimpleNamespace(estimate=estimate), mtf=SimpleNamespace(value=middle, low=middle, high=middle)
    )


def curve(mtf50: float) -> np.ndarray:
    return 0.5 ** (FREQUENCIES / mtf50)


def test_words_of_a_frame_are_counted() -> None:
    sharp, soft = np.tile(curve(1.0), (2, 1)), np.tile(curve(0.15), (2, 1))
    moved = np.stack([curve(0.15), curve(1.0)])
    clean = blur_words.words(condition_of(np.stack([sharp] * 5)))
    assert clean == dict.fromkeys(blur_words.COUNTED, 0) | {"pictures": 1}
    partly = blur_words.words(condition_of(np.stack([sharp, sharp, sharp, soft, soft])))
    assert partly == clean | {"partly": 1, "noticed": 1}
    defocused = blur_words.words(condition_of(np.stack([soft] * 5)), "horizontal")
    assert defocused == clean | {"certain": 1, "noticed": 1, "other_cause": 1}
    motion = blur_words.words(condition_of(np.stack([moved] * 5)), "horizontal")
    assert motion == clean | {"certain": 1, "noticed": 1, "direction": 1, "right_direction": 1, "motion": 1}
    assert blur_words.words(condition_of(np.stack([moved] * 5)), "vertical") == motion | {"right_direction": 0}


def test_parts_are_half_a_disc_and_all_of_the_frame() -> None:
    left, disc, whole = (blur_words.mask((100, 160), part, "a") for part in blur_words.PARTS)
    assert left.mean() == pytest.approx(0.5, abs=0.01) and left[:, 0].all() and not left[:, -1].any()
    assert disc.mean() == pytest.approx(np.pi * 35**2 / 16000, rel=0.02) and whole.all()


def test_every_condition_has_a_picture_of_its_frame() -> None:
    frame = np.tile(np.linspace(0.2, 0.8, 64, dtype=np.float32), (48, 1))
    colours = np.repeat(frame[..., None], 3, axis=2)
    pictures = dict(blur_words.sharp(frame, colours, "a"))
    assert len(pictures) == 2 * len(blur_words.WHITE_DN) + len(blur_words.ISO)
    assert np.std(pictures["10 DN"] - frame) * 255 == pytest.approx(10, rel=0.1)
    softened = dict(blur_words.blurred(frame, colours, "a", "vertical"))
    assert len(softened) == len(blur_words.PARTS) * 2 * 3 * (len(blur_words.BLURRED_DN) + 1)
    assert all(picture.shape == frame.shape and picture.dtype == np.float32 for picture in softened.values())
    assert np.abs(softened["whole, linear_motion 9 px, 0 DN"] - frame).max() < 0.003  # along columns nothing changes
    assert np.abs(softened["whole, defocus 15 px, 0 DN"] - frame).max() > 0.01


def test_pictures_are_an_even_selection_and_a_folder_without_any_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--realdata .*: no pictures; expected one of kitti/"):
        blur_words.sharp_pictures(tmp_path, 3)
    (tmp_path / "cc_noise").mkdir()
    for name in ("a_mean", "a_real", "b_mean", "c_mean", "d_mean"):
        cv2.imwrite(str(tmp_path / "cc_noise" / f"{name}.png"), np.zeros((8, 8), np.uint8))
    chosen = blur_words.sharp_pictures(tmp_path, 2)
    assert {name: [path.name for path in paths] for name, paths in chosen.items()} == {
        "cc": ["a_mean.png", "c_mean.png"]
    }


def test_the_record_is_the_sum_of_its_datasets() -> None:
    record = json.loads((common.RESULTS / "blur_words.json").read_text(encoding="utf-8"))
    assert blur_words.summed(record["results"]) == record["totals"]
    assert sorted(record["datasets"]) == sorted(record["results"]) == sorted(blur_words.PICTURES)


def test_docs_state_what_the_record_has() -> None:
    """Wrong words of sharp frames, and blur of 9 and 15 px that is noticed, by white noise and by the telephone."""
    totals = json.loads((common.RESULTS / "blur_words.json").read_text(encoding="utf-8"))["totals"]
    text = " ".join((common.ROOT / "docs/limits.md").read_text(encoding="utf-8").split())

    def count(key: str, *parts: str, without: str = " 5 px", group: str = "blurred") -> int:
        conditions = totals[group].items()
        return sum(row[key] for name, row in conditions if all(part in name for part in parts) and without not in name)

    def of_both(key: str, *parts: str) -> list[int]:
        every, delivered = count(key, *parts), count(key, *parts, "phone")
        return [every - delivered, delivered]

    wrong = {key: count(key, group="sharp") for key in blur_words.COUNTED}
    assert f"{wrong['partly']} of {wrong['pictures']} are said to be *partly blurred*" in text
    assert f"{wrong['direction']} have a direction, none has a cause or a certain grade" in text
    assert wrong["certain"] == wrong["motion"] == wrong["other_cause"] == 0
    noticed, pictures = of_both("noticed", "left"), of_both("pictures", "left")
    assert f"{noticed[0]} of {pictures[0]} are noticed" in text and f"{noticed[1]} of {pictures[1]} through" in text
    assert "only {} of 600 and {} of 200".format(*of_both("noticed", "disc")) in text
    moved = ("whole", "linear_motion")
    assert "named in {} of 300 and {} of 100".format(*of_both("right_direction", *moved)) in text
    assert of_both("direction", *moved) == of_both("right_direction", *moved)
    assert "in {} and {}: where".format(*of_both("motion", *moved)) in text
