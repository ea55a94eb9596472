"""YAML in C gives what YAML in Python gives."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from pipeline import yaml_text

ROOT = Path(__file__).resolve().parents[1]
ODD = "a: [1, 1e-3, 1.5, .inf, yes, null, '1', 2001-01-01]\n"
ODD += 'b: &x {c: "é\\t"}\nd: *x\ng: |\n  lines\n  two\ne: 0o17\nf: 012\n'


@pytest.mark.parametrize("text", [ODD, "", (ROOT / "params.yaml").read_text(), (ROOT / "dvc.yaml").read_text()])
def test_the_content_is_that_of_the_parser_in_python(text):
    content = yaml_text.parse(text)
    assert content == yaml.safe_load(text) and repr(content) == repr(yaml.safe_load(text))


@pytest.mark.parametrize("text", ["a: [1", "a: !!python/object/apply:os.getcwd []", "- a\nb: 1"])
def test_what_is_no_plain_yaml_is_refused(text):
    with pytest.raises(yaml.YAMLError):
        yaml_text.parse(text)
