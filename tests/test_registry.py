"""Registry: names, not import paths; typos get a hint."""

import pytest
from plug_in_makers import plug_in

from pipeline import blur, control, detection, noise
from pipeline.errors import InputError
from pipeline.registry import Registry

THINGS = Registry("thing", "pipeline.test_things", {"path": "pathlib:Path", "gone": "no_such_module_xyz:X"})


def test_known_names_are_imported_on_demand():
    from pathlib import Path

    assert THINGS.get("path") is Path
    assert THINGS.names() == ["gone", "path"]


@pytest.mark.parametrize("name", ["pat", "os:system", "pathlib:Path"])
def test_unknown_names_are_refused_with_a_hint(name):
    with pytest.raises(InputError, match="unknown thing.*path"):
        THINGS.get(name)


def test_a_missing_package_is_named():
    with pytest.raises(InputError, match="no_such_module_xyz"):
        THINGS.get("gone")


def test_a_wrong_option_is_named():
    registry = Registry("fraction", "pipeline.test_things", {"fraction": "fractions:Fraction"})
    with pytest.raises(InputError, match="fraction.*colour"):
        registry.create("fraction", colour=1)


class Faulty:
    """Its own mistake is no wrong option."""

    def __init__(self, size=1):
        self.size = size + "px"


def test_a_mistake_inside_a_constructor_is_not_taken_for_a_wrong_option():
    registry = Registry("thing", "pipeline.test_things", {"faulty": f"{__name__}:Faulty", "bare": "builtins:dict"})
    with pytest.raises(TypeError, match="unsupported operand"):
        registry.create("faulty", size=2)
    with pytest.raises(InputError, match="faulty.*colour"):
        registry.create("faulty", colour=1)
    assert registry.create("bare", colour=1) == {"colour": 1}  # which has no signature to compare with


def test_entry_points_of_third_parties_are_found(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text("class Mine:\n    pass\n")
    info = tmp_path / "mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pipeline.test_things]\nmine = mine:Mine\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert "mine" in THINGS.names()
    assert THINGS.create("mine").__class__.__name__ == "Mine"


def test_a_class_that_a_module_lacks_is_named_with_its_entry_point(tmp_path, monkeypatch):
    plug_in(tmp_path, monkeypatch, "renamed_things", "class New:\n    pass\n", test_things="old = renamed_things:Old")
    with pytest.raises(InputError, match="renamed_things has no 'Old'.*test_things: old = renamed_things:Old"):
        THINGS.get("old")
    assert not THINGS.is_builtin("old") and THINGS.is_builtin("path")


UNFINISHED = """
from abc import ABC, abstractmethod

from pipeline.blur.base import Estimator as Blur
from pipeline.control.iopc import IopcPolicy
from pipeline.control.policy import Policy as OfControl
from pipeline.noise.base import Estimator as Noise


class Measureless(Noise):
    pass


class Blind(Blur):
    pass


class Undecided(OfControl):
    pass


class Indifferent(IopcPolicy):
    pass


class Loading(ABC):
    def detect(self, images):
        return []

    @abstractmethod
    def load(self): ...


class Other:
    def __init__(self, size=1):
        self.detect = self.estimate = size
"""


def test_a_class_without_its_method_is_named(tmp_path, monkeypatch):
    points = {
        "noise": "unfinished = unfinished_parts:Measureless\nother = unfinished_parts:Other",
        "blur": "unfinished = unfinished_parts:Blind",
        "control": "unfinished = unfinished_parts:Undecided\nother = unfinished_parts:Indifferent",
        "detection": "unfinished = unfinished_parts:Loading\nother = unfinished_parts:Other",
    }
    plug_in(tmp_path, monkeypatch, "unfinished_parts", UNFINISHED, **points)
    for create, name, words in (
        (noise.create, "unfinished", r"noise estimator 'unfinished': Measureless lacks measure\(\); docs/extend.md"),
        (noise.create, "other", r"noise estimator 'other': Other lacks estimate\(\)"),
        (blur.create, "unfinished", r"blur estimator 'unfinished': Blind lacks measure\(\)"),
        (control.create, "unfinished", r"control policy 'unfinished': Undecided lacks decide\(\)"),
        (control.create, "other", r"control policy 'other': Indifferent lacks choose\(\)"),
        (detection.create, "unfinished", r"detector 'unfinished': Loading lacks load\(\)"),
        (detection.create, "other", r"detector 'other': Other lacks detect\(\)"),
    ):
        with pytest.raises(InputError, match=f"^{words}"):
            create(name)
    with pytest.raises(InputError, match="detector 'other': .*colour"):
        detection.create("other", colour=1)
