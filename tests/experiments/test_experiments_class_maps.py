"""What labels mean to detectors: class maps are checked; words known but for case or plural are told."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any, ClassVar

import pytest
from data_makers import make_folder, make_kitti
from plug_in_makers import plug_in

from pipeline.datasets import REGISTRY, open_dataset
from pipeline.datasets.folder import Folder
from pipeline.datasets.frame import Box, Frame
from pipeline.errors import InputError
from pipeline.experiments.class_maps import class_map, mistaken_words, refuse_mistaken_words, role_of


@pytest.mark.parametrize(
    ("kind", "labels", "mistaken"),
    [
        ("folder", ["car", "person", "truck", "bus", "carriage", "people"], {}),
        ("folder", ["Car", "cars", "PERSONS"], {"Car": "car", "cars": "car", "PERSONS": "person"}),
        ("kitti", ["Car", "Van", "Person_sitting", "DontCare", "Misc"], {}),
        ("kitti", ["car", "Vans", "misc"], {"car": "Car", "Vans": "Van"}),
        ("udacity", ["car", "pedestrian", "trafficlight"], {}),
    ],
)
def test_words_that_differ_in_case_or_plural_only_are_told(kind, labels, mistaken):
    assert mistaken_words(labels, kind) == mistaken


def test_labels_with_such_words_are_refused_by_word_count_and_frame(tmp_path: Path) -> None:
    root = make_folder(tmp_path / "mine", frames=3)
    right = open_dataset("folder", "mine", root).frames()
    refuse_mistaken_words(right, "mine", "folder")  # a traffic light is none of it
    (root / "labels/frame-1.txt").write_text("car 10 10 90 90\nCars 20 20 60 90\nCars 30 20 60 90 difficult\n")
    frames = open_dataset("folder", "mine", root).frames()
    with pytest.raises(InputError, match=r"'mine': .*'Cars' for 'car' \(boxes: 2\), first in frame 'frame-1'"):
        refuse_mistaken_words(frames, "mine", "folder")
    refuse_mistaken_words(open_dataset("kitti", "kitti", make_kitti(tmp_path / "kitti")).frames(), "kitti", "kitti")


def test_a_label_that_is_no_text_is_named_with_its_frame() -> None:
    number: Any = 3
    frame = Frame("mine", "yard_1", Path("yard_1.png"), (Box("car", 0, 0, 9, 9), Box(number, 0, 0, 9, 9)))
    with pytest.raises(InputError, match="'mine': frame 'yard_1' has a box of label 3 of type int, expected text"):
        refuse_mistaken_words([frame], "mine", "folder")


def test_a_third_party_may_define_words_that_are_alike(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = """
from pipeline.datasets.folder import Folder


class Groups(Folder):
    kind = "groups"
    detector_classes = {"auto": "car"}
    classes = frozenset({"auto", "autos"})
"""
    plug_in(tmp_path, monkeypatch, "word_groups", text, datasets="groups = word_groups:Groups")
    assert mistaken_words(["auto", "autos", "Auto"], "groups") == {"Auto": "auto"}


def test_each_word_has_a_role() -> None:
    words, box, ignored = class_map("kitti"), Box("any", 0, 0, 9, 9), Box("any", 0, 0, 9, 9, True)
    roles = {word: role_of(word, [box], words) for word in ("Pedestrian", "Van", "Spaceship")}
    assert roles == {"Pedestrian": "object: person", "Van": "ignored for car", "Spaceship": "left out"}
    assert role_of("DontCare", [ignored], words) == "ignored"
    assert role_of("Spaceship", [ignored, box], words) == "left out"


def test_a_missing_class_map_is_named() -> None:
    with pytest.raises(InputError, match="kind 'photo'.*known: .*kitti"):
        class_map("photo")


def test_a_third_partys_dataset_brings_what_its_labels_mean(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = """
from pipeline.datasets.folder import Folder


class Drives(Folder):
    kind = "drives"
    detector_classes = {"auto": "car"}
    detector_neighbours = {"van": ("car",)}


class Bare(Folder):
    kind = "bare"
"""
    points = "drives = drives_of_mine:Drives\nbare = drives_of_mine:Bare"
    plug_in(tmp_path, monkeypatch, "drives_of_mine", text, datasets=points)
    words = class_map("drives")
    assert words.classes == ["car"] and dict(words.neighbours) == {"van": ("car",)}
    with pytest.raises(InputError, match="kind 'bare'.*detector_classes"):
        class_map("bare")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "detector_neighbours = {'van': 'car'}",
            r"detector_neighbours\['van'\] is 'car', expected a tuple of .*\(car\)",
        ),
        ("detector_neighbours = {'van': ('cars',)}", r"detector_neighbours\['van'\] is \('cars',\), expected a tuple"),
        ("detector_neighbours = {'van': ()}", r"detector_neighbours\['van'\] is \(\), expected a tuple"),
        ("detector_neighbours = {'auto': ('car',)}", "detector_neighbours: 'auto' stands for 'car'"),
        ("detector_neighbours = ('van',)", r"detector_neighbours is \('van',\), expected a mapping"),
        (
            "detector_classes = {'auto': ('car',)}",
            r"detector_classes\['auto'\] is \('car',\), expected the word of one",
        ),
        ("detector_classes = ('car',)", r"detector_classes is \('car',\), expected a mapping"),
    ],
)
def test_a_class_map_of_which_a_part_would_mean_nothing_is_refused(
    line: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Drives(Folder):
        kind = "drives"
        detector_classes: ClassVar = {"auto": "car"}

    monkeypatch.setattr(REGISTRY, "names", lambda: ["drives"])
    monkeypatch.setattr(REGISTRY, "get", lambda kind: Drives)
    key, _, value = line.partition(" = ")
    monkeypatch.setattr(Drives, key, ast.literal_eval(value))
    with pytest.raises(InputError, match=f"^datasets of kind 'drives': {words}"):
        class_map("drives")
