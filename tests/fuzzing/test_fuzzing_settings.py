"""The configuration and the words of the command line: refused in one line each, or taken; never a crash."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from mutations import WORDS, damaged, replaced

from pipeline import yaml_text
from pipeline.cli import COMMANDS, main
from pipeline.cli.frames.shot_settings import seconds
from pipeline.config.compose import parse
from pipeline.config.references import check_references
from pipeline.config.schema import validate
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "params.yaml").read_text(encoding="utf-8")
PARAMS = yaml_text.parse(TEXT)


@given(content=replaced(PARAMS))
def test_settings(content):
    with contextlib.suppress(InputError):
        check_references(validate(content))


@given(content=st.one_of(damaged(TEXT[:3000].encode()), st.binary(max_size=80)))
def test_text_of_settings(content):
    with contextlib.suppress(InputError):
        parse(content.decode("utf-8", "replace"), "params.yaml")


@given(text=st.one_of(WORDS, st.from_regex(r"[0-9./]{1,6} ?(us|ms|s)", fullmatch=True)))
def test_times(text):
    with contextlib.suppress(InputError):
        assert seconds(text, "--exposure") > 0


OPTIONS = {
    name: [option for parameter in main.get_command(None, name).params for option in parameter.opts]
    for name in COMMANDS
    if not hasattr(main.get_command(None, name), "commands")
}


@pytest.mark.parametrize("name", sorted(set(OPTIONS) - {"doctor", "watch", "init", "render"}))
@given(data=st.data())
def test_command_lines(name, data):
    """Words that name nothing: each line of this kind is refused before anything is computed or written."""
    values = WORDS.filter(lambda word: word not in ("-h", "--help") and "/" not in word and "\0" not in word)
    words = data.draw(st.lists(st.one_of(st.sampled_from(OPTIONS[name]), values), max_size=6))
    with CliRunner().isolated_filesystem():
        done = CliRunner().invoke(main, [name, *(word for word in words if word != "--help")])
        assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
        assert done.exit_code in (0, 2) and len(done.stderr.splitlines()) <= 2
        assert not [path for path in Path().iterdir() if path.suffix in (".json", ".png")]
