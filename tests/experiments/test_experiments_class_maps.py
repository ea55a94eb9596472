"""Words of labels that are a known one but for case or plural: they are found, and refused where objects count."""

from __future__ import annotations

from pathlib import Path

import pytest
from data_makers import make_folder, make_kitti
from plug_in_makers import plug_in

from pipeline.datasets import open_dataset
from pipeline.datasets.frame import Box
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
