"""What a command cannot use is named at once, and again in its error."""

from __future__ import annotations

import pytest

from pipeline.cli.frames.set_aside import SetAside
from pipeline.errors import InputError


def test_nothing_set_aside_is_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    SetAside().refuse()
    assert capsys.readouterr() == ("", "")


def test_each_is_named_with_its_reason_and_the_error_names_the_first(capsys: pytest.CaptureFixture[str]) -> None:
    aside = SetAside()
    aside.add("a.png", InputError("empty file"))
    assert capsys.readouterr().err == "set aside: a.png: empty file\n"
    with pytest.raises(InputError, match=r"^a\.png could not be used, or not in full; see above$"):
        aside.refuse()
    aside.add("b.mp4", InputError("b.mp4: cut short; encode it anew"))
    assert capsys.readouterr().err == "set aside: b.mp4: cut short; encode it anew\n"
    with pytest.raises(
        InputError, match=r"^2 files or frames, the first a\.png, could not be used, or not in full; see above$"
    ):
        aside.refuse()
    assert aside.reasons == ["a.png: empty file", "b.mp4: cut short; encode it anew"]
