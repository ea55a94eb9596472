"""Detectors that call objects otherwise than the classes are refused, or warned of: their AP would be 0 %."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from yolox_makers import tiny_yolox

from pipeline.detection import words
from pipeline.detection.words import check_words
from pipeline.errors import InputError

CLASSES = ("car", "person")


@pytest.fixture
def stating(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Makes the detector opened one with these ``labels``; without any by default."""

    def state(**parts: Any) -> None:
        monkeypatch.setattr(words, "opened", lambda kind, options: SimpleNamespace(**parts))

    state()
    return state


@pytest.mark.parametrize(
    ("seen", "warned"),
    [
        ((), []),
        (["car"], []),
        (["car", "person", "tree"], []),
        (["car", "tree"], ["'person'"]),
        (["0", "car"], ["'0'"]),
    ],
)
def test_what_a_third_partys_detections_are_called_tells_its_words(stating: Any, seen: Any, warned: Any) -> None:
    result = check_words("mine", "{}", CLASSES, seen, "drives")
    assert len(result) == len(warned) and all(word in result[0] for word in warned)


def test_a_third_partys_detector_of_none_of_the_classes_is_refused(stating: Any) -> None:
    with pytest.raises(InputError, match="'mine' on 'drives'.*'car' or 'person'; its words are '0', '1'.*_classes"):
        check_words("mine", "{}", CLASSES, ["1", "0"], "drives")
    many = [f"w{number:02d}" for number in range(20)]
    with pytest.raises(InputError, match=r"'w06', 'w07', \.\.\."):
        check_words("mine", "{}", CLASSES, many, "drives")


@pytest.mark.parametrize("word", ["Car", "cars", "CAR"])
def test_a_class_in_another_case_or_number_beside_itself_is_refused(stating: Any, word: str) -> None:
    for seen in ([word, "car", "person"], [word, "person"]):
        with pytest.raises(InputError, match=f"'mine' on 'drives': it calls detections '{word}' for 'car', which"):
            check_words("mine", "{}", CLASSES, seen, "drives")
    assert check_words("mine", "{}", (*CLASSES, word), [word, "car", "person"], "drives") == []  # a class as well


def test_words_that_a_third_partys_detector_states_excuse_it_and_never_accuse(stating: Any) -> None:
    """Few frames may show buses alone; an attribute of that name may be anything."""
    stating(labels=["car", "person", "bus"])
    assert check_words("mine", "{}", CLASSES, ["bus"], "drives") == []
    for labels in ([0, 1], "words", None, {"0": "car"}, lambda: None):
        stating(labels=labels)
        assert check_words("mine", "{}", CLASSES, ["car"], "drives") == []
        assert check_words("mine", "{}", CLASSES, [], "drives") == []


@pytest.mark.parametrize("name", ["compact", "compact_two_stage", "yolox"])
def test_detectors_of_this_package_are_told_before_the_first_frame(name: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {}
    if name == "yolox":
        options = {"weights": str(tiny_yolox(tmp_path / "t.onnx")), "labels": ["bicycle", "bus", "car"]}
    given = (name, json.dumps(options))
    assert check_words(*given, ("car",), (), "drives") == []
    (warning,) = check_words(*given, ("car", "pedestrian"), (), "drives")
    assert "no detection 'pedestrian'" in warning
    with pytest.raises(
        InputError, match=f"detector '{name}' on 'drives'.*'auto' or 'pedestrian'; its words are 'b.*'c"
    ):
        check_words(*given, ("auto", "pedestrian"), (), "drives")
