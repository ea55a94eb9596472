"""Estimators and policies of third parties that lack a method are refused as one line."""

import pytest
from plug_in_makers import plug_in

from pipeline import blur, control, noise
from pipeline.errors import InputError

UNFINISHED = """
from pipeline.blur.base import Estimator as Blur
from pipeline.control.policy import Policy as OfControl
from pipeline.noise.base import Estimator as Noise


class Measureless(Noise):
    pass


class Blind(Blur):
    pass


class Undecided(OfControl):
    pass


class Other:
    pass
"""


def test_a_class_without_its_method_is_named(tmp_path, monkeypatch):
    points = {
        "noise": "unfinished = unfinished_parts:Measureless\nother = unfinished_parts:Other",
        "blur": "unfinished = unfinished_parts:Blind",
        "control": "unfinished = unfinished_parts:Undecided",
    }
    plug_in(tmp_path, monkeypatch, "unfinished_parts", UNFINISHED, **points)
    for create, name, words in (
        (noise.create, "unfinished", r"noise estimator 'unfinished': Measureless lacks measure\(\)"),
        (noise.create, "other", r"noise estimator 'other': Other lacks estimate\(\)"),
        (blur.create, "unfinished", r"blur estimator 'unfinished': Blind lacks measure\(\)"),
        (control.create, "unfinished", r"control policy 'unfinished': Undecided lacks decide\(\)"),
    ):
        with pytest.raises(InputError, match=words):
            create(name)
