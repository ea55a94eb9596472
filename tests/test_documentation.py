"""README and docs run as printed: Python is executed, commands are parsed by the programs they call, TOML is read."""

from __future__ import annotations

import re
import shlex
import tomllib
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import composed
import numpy as np
import pytest
from data_makers import picture
from dvc.cli import DvcParserError, parse_args

from pipeline import yaml_text
from pipeline.blur import camera_calibration, spectral
from pipeline.cli import main
from pipeline.config.compose import CONF
from pipeline.config.overrides import check_overrides
from pipeline.config.schema import validate
from pipeline.dependencies import stage_groups
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), ROOT / "data/raw/README.md"]
NOT_EXECUTED: dict[str, str] = {  # a line of a Python block that is not executed here -> the reason
    "table_one.measure(": "executed with its result checked in tests/experiments/test_experiments_table_one.py",
}


@dataclass(frozen=True)
class Block:
    """A fenced code block of a document."""

    document: Path
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.document.relative_to(ROOT)}:{self.line}"


def blocks(document: Path) -> list[Block]:
    text = document.read_text(encoding="utf-8") if document.exists() else ""
    fences = re.finditer(r"^```(\w*)[^\n]*\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return [Block(document, text[: m.start()].count("\n") + 2, m.group(1), m.group(2)) for m in fences]


BLOCKS = [block for document in DOCUMENTS for block in blocks(document)]
SHELL = [block for block in BLOCKS if block.language in ("sh", "bash", "console")]
WITH_PYTHON = sorted({block.document for block in BLOCKS if block.language == "python"})


def test_documents_have_blocks_of_each_kind():
    assert {"python", "sh", "toml"} <= {block.language for block in BLOCKS}


@pytest.mark.slow
@pytest.mark.parametrize("document", WITH_PYTHON, ids=lambda path: path.name)
def test_python_runs_as_printed(document, tmp_path, monkeypatch):
    """All blocks of a document, top to bottom, given the reader's own patches and frame."""
    monkeypatch.chdir(tmp_path)
    for module, name in ((spectral, "fit_map"), (camera_calibration, "calibrate")):
        monkeypatch.setattr(module, name, partial(getattr(module, name), samples=300))  # sooner
    image = picture("documentation", 448, 320).astype(np.float32) / np.float32(255)
    patches = np.stack([image[None, y : y + 192, x : x + 192] for y in (0, 128) for x in (0, 128, 256)])
    names = {"patches": patches, "sharp_patches": patches, "image": image}
    for block in blocks(document):
        if block.language != "python":
            continue
        reasons = [reason for line, reason in NOT_EXECUTED.items() if line in block.text]
        if reasons:
            continue
        try:
            exec(compile(block.text, str(block), "exec"), names)
        except Exception as error:  # whatever it is, name the block
            raise AssertionError(f"{block}: {type(error).__name__}: {error}") from error


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.language == "toml"], ids=str)
def test_toml_is_valid(block):
    assert tomllib.loads(block.text)


@pytest.mark.full("compositions of all commands with overrides take 20 s")
@pytest.mark.parametrize("block", SHELL, ids=str)
def test_commands_exist_with_their_options(block, monkeypatch):
    monkeypatch.chdir(ROOT)
    for line in re.sub(r"\\\n\s*", " ", block.text).splitlines():
        for words in commands(line.removeprefix("$ ")):
            check_command(words)


def commands(line: str) -> list[list[str]]:
    """Commands of a line, each as its words, without comments."""
    words = shlex.split(line, comments=True)
    result: list[list[str]] = [[]]
    for word in words:
        if word in ("&&", "||", "|", ";"):
            result.append([])
        else:
            result[-1].append(word)
    return [command for command in result if command]


def check_command(words: list[str]) -> None:
    program, *rest = words
    if program == "camera-monitor":
        parse_click(main, rest)
    elif program == "dvc":
        check_dvc(rest)
    elif program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert all(word in targets for word in rest if "=" not in word), words
    elif program == "python" and rest[0] == "-m":
        module = ROOT / Path(*rest[1].split("."))
        assert module.with_suffix(".py").is_file() or (module / "__main__.py").is_file() or rest[1] in ("venv", "pip")
        if rest[1].startswith("pipeline.stages."):
            check_overrides(rest[2:], CONF)
        elif rest[1] == "pipeline.dvc":
            check_dvc(rest[2:])
    elif program == "python":
        assert (ROOT / rest[0]).is_file(), words
    else:
        assert program in ("git", "pip", "source", "cd", "mkdir", "dask", "unzip", "tar", "curl", "wget"), words


def check_dvc(words: list[str]) -> None:
    """Parse the words as DVC does, compose their overrides, and look up the stages that they name."""
    given = vars(parse_args(words))
    overrides = given.get("set_param") or []
    if any(re.search(r"=[^\[{]*,", override) for override in overrides):
        check_overrides(overrides, CONF)
        return
    content = composed.content(*overrides)
    validate(content, "conf/")
    if words[0] in ("repro", "status", "exp"):
        assert set(given.get("targets") or []) <= stages(content), words


def stages(content: dict[str, Any]) -> set[str]:
    """Groups and members of the graph, as DVC names them, under a configuration."""
    graph = yaml_text.parse((ROOT / "dvc.yaml").read_text(encoding="utf-8"))
    names = set()
    for group in stage_groups.groups(graph, content):
        names.add(group.name)
        for item in group.items:
            members = [item["key"]] if "key" in item else [value for name, value in item.items() if name != "item"]
            names.add(f"{group.name}@{'-'.join(members)}")
    return names


@pytest.mark.parametrize(
    "line",
    [
        "dvc repro reprot",
        "dvc exp run -S profile=smok report",
        *(
            pytest.param(line, marks=pytest.mark.full("one more takes 3 s"))
            for line in (
                "dvc repro --froce report",
                "dvc exp run -S '+noise.estimators.difference={kind: pca}' noise_other@photos-difference",
                "dvc stauts",
                "python -m pipeline.dvc repro detect_yolox@sim-yolox",
            )
        ),
    ],
)
def test_a_wrong_command_of_dvc_is_noticed(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    with pytest.raises((AssertionError, DvcParserError, InputError)):
        check_command(shlex.split(line))
    for right in ("dvc repro -f train_mtf_spectral", "dvc repro index@sim", "dvc queue status"):
        check_command(shlex.split(right))


def parse_click(command: click.Command, words: list[str]) -> None:
    """Parse the words as the program does, without running it."""
    with command.make_context("camera-monitor", list(words), resilient_parsing=True) as context:
        if isinstance(command, click.Group):
            rest = [*context._protected_args, *context.args]
            name, inner, arguments = command.resolve_command(context, rest)
            assert inner is not None, name
            parse_inner(inner, str(name), arguments)


def parse_inner(command: click.Command, name: str, words: list[str]) -> None:
    if isinstance(command, click.Group):
        parse_click(command, words)
    else:
        command.make_context(name, list(words))  # unknown options and values out of range raise here
