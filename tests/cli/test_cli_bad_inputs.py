"""A corpus of inputs that nobody can use: every answer is one line that names the file or key, and an exit code.

``set aside`` lines name single files of several; the last line then counts them.
"""

from __future__ import annotations

import functools
import json
import re
from pathlib import Path
from typing import Any

import click
import cv2
import pytest
from bad_arguments import NUMBERS, SETTINGS, WORDS
from bad_labels import DATASETS
from bad_pictures import HEIGHT_PX, PICTURES, VIDEOS, WIDTH_PX, film_bytes
from bad_stored_files import ARCHIVES, CAMERAS, EDITED, HASHES, JSON, WEIGHTS
from click.testing import CliRunner
from control_makers import performance
from data_makers import make_kitti, picture

from pipeline.cli import COMMANDS, main
from pipeline.config.compose import compile_params
from pipeline.config.references import check_references
from pipeline.errors import InputError
from pipeline.recording.provenance import blur_weights

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.usefixtures("remembered_compositions")
PROGRESS = re.compile(r"[^\r\n]*\d+ frames \[[^\]]*\]|\r")  # shown when reading takes over two seconds
COUNT = re.compile(r"error: (\S+|\d+ files or frames, the first \S+,) could not be used, or not in full; see above")
ADVICE = ["--exposure", "4ms", "--iso", "100", "--surface", "{surface}"]
PICTURE_COMMANDS = {
    "health": ["health", "{bad}", "--blur", "spectral", "--noise", "pca"],
    "health sharp": ["health", "{good}", "--noise", "pca", "--sharp", "{bad}"],
    "noise": ["noise", "{bad}", "--estimator", "pca"],
    "corrupt": ["corrupt", "{bad}", "--out", "{absent}", "--sigma-dn", "3"],
    "corrupt pipeline": ["corrupt", "{bad}", "--out", "{absent}", "--pipeline", "phone", "--shots", "2"],
    "calibrate": ["calibrate", "mine", "{bad}"],
    "calibrate edge": ["calibrate", "mine", "{bad}", "--chart", "edge"],
    "calibrate star": ["calibrate", "mine", "{bad}", "--chart", "star", "--rays", "60"],
    "advise": ["advise", "{bad}", *ADVICE],
    "budget": ["budget", "{bad}", "--sensor", "paper", "--exposure", "4ms", "--iso", "100"],
    "record examples": [
        "record", "examples", "--real", "{bad}", "--mean", "{good}", "--frame", "{good}", "--source", "x",
        "--to", "{absent}",
    ],
    "dataset": ["dataset", "folder", "{folder of bad}"],
    "record sensor": [
        "record", "sensor", "--light", "{folder of bad}", "--dark", "{folder of bad}", "--source", "x",
        "--to", "{absent}",
    ],
}  # fmt: skip
VIDEO_COMMANDS = {
    name: PICTURE_COMMANDS[name]
    for name in ("health", "health sharp", "noise", "corrupt", "corrupt pipeline", "calibrate", "advise", "budget")
}
ARCHIVE_COMMANDS = {
    "curves query": ["curves", "query", "{bad}", "--sigma", "1", "--mtf", "0.5"],
    "health": ["health", "{good}", "--noise", "pca", "--surface", "{bad}"],
    "watch": ["watch", "{film}", "--noise", "pca", "--surface", "{bad}", "--frames", "1"],
    "advise": ["advise", "{good}", "--exposure", "4ms", "--iso", "100", "--surface", "{bad}"],
}
CAMERA_COMMANDS = {
    "health": ["health", "{good}", "--noise", "pca", "--camera", "mine"],
    "watch": ["watch", "{film}", "--noise", "pca", "--camera", "mine", "--frames", "1", "--no-wait"],
}
Case = tuple[list[str], str, str, str]  # command line, family of bad files, name in it, word of the answer


def _cases() -> dict[str, Case]:
    cases: dict[str, Case] = {}
    for family, commands, names in (
        ("picture", PICTURE_COMMANDS, PICTURES),
        ("video", VIDEO_COMMANDS, VIDEOS),
        ("archive", ARCHIVE_COMMANDS, ARCHIVES),
        ("edited", {"health": ARCHIVE_COMMANDS["health"]}, EDITED),
        ("camera", CAMERA_COMMANDS, CAMERAS),
        ("metrics", {"report diff": ["report", "diff", "{bad}", "{bad}"]}, JSON),
        ("weights", {"health": ["health", "{good}", "--noise", "pca"]}, WEIGHTS),
    ):
        for command, line in commands.items():
            for name in names:
                word = "mine" if family == "camera" else "{bad}"
                cases[f"{family}: {command}: {name}"] = (line, family, name, word)
    for name, (kind, _) in DATASETS.items():
        cases[f"dataset: {name}"] = (["dataset", kind, "{bad}"], "dataset", name, "")
    for start, options in NUMBERS.items():
        for option, values in options.items():
            for value in values:
                cases[f"{' '.join(start[:2])} {option} {value!r}"] = ([*start, option, value], "", "", option)
    for line, word in WORDS:
        cases[" ".join(line)] = (line, "", "", word)
    return cases


CASES = _cases()
CROSSED = ("picture: ", "video: ")
"""Families of which every command is given each file; without ``--full`` two files of five, others than the next."""


def _in_turn() -> list[Any]:
    crossed = [case for case in CASES if case.startswith(CROSSED)]
    later = {case for number, case in enumerate(crossed) if number % 5 not in (0, 2)}
    return [
        pytest.param(case, marks=pytest.mark.full("360 more take 30 s")) if case in later else case for case in CASES
    ]


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> dict[str, Path]:
    """Files with nothing wrong, which the command lines refer to."""
    folder = tmp_path_factory.mktemp("sound")
    (folder / "pictures").mkdir()
    good, small, film = folder / "pictures/good.png", folder / "small.png", folder / "film.avi"
    assert cv2.imwrite(str(good), picture("good", WIDTH_PX, HEIGHT_PX))
    assert cv2.imwrite(str(small), picture("small", WIDTH_PX - 16, HEIGHT_PX - 8))
    film.write_bytes(film_bytes(folder, ".avi", "MJPG"))
    performance().save(folder / "surface.npz")
    return {
        "good": good, "small": small, "film": film, "pictures": folder / "pictures",
        "kitti": make_kitti(folder / "kitti", frames=1, previous=0), "surface": folder / "surface.npz",
    }  # fmt: skip


@functools.cache
def released_hashes() -> dict[str, str]:
    """Of the weights of the default blur estimator."""
    return blur_weights("spectral")


def _bad(family: str, name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write the bad file of a case; returns its path."""
    if family in ("picture", "video"):
        path = folder / "bad" / name
        path.parent.mkdir()
        (PICTURES if family == "picture" else VIDEOS)[name](path)
    elif family == "dataset":
        path = folder / name
        DATASETS[name][1](path)
    elif family == "camera":
        monkeypatch.setenv("CAMERA_MONITOR_HOME", str(folder))
        path = folder / "cameras/mine.json"
        path.parent.mkdir()
        CAMERAS[name](path)
        if path.is_file():
            content = path.read_bytes()
            path.write_bytes(content.replace(json.dumps(HASHES).encode(), json.dumps(released_hashes()).encode()))
    elif family == "weights":
        path = folder / "mtf_spectral.safetensors"
        WEIGHTS[name](path)
        monkeypatch.setenv("CAMERA_CONDITION_WEIGHTS", str(folder))
    else:
        path = folder / (f"{name}.json" if family == "metrics" else f"{name}.npz")
        {"metrics": JSON, "archive": ARCHIVES, "edited": EDITED}[family][name](path)
    return path


@pytest.mark.parametrize("case", _in_turn())
def test_the_answer_is_one_line_that_names_what_is_wrong(case, sound, tmp_path, monkeypatch, capfd):
    line, family, name, word = CASES[case]
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("CAMERA_MONITOR_HOME", str(tmp_path / "home"))
    (tmp_path / "empty").mkdir()
    places = {**sound, "dir": tmp_path / "empty", "absent": tmp_path / "absent"}
    if family:
        places["bad"] = _bad(family, name, tmp_path, monkeypatch)
        places["folder of bad"] = places["bad"].parent
    texts = {f"{{{key}}}": str(value) for key, value in places.items()}

    def filled(text: str) -> str:
        return re.sub(r"\{[a-z ]+\}", lambda match: texts[match[0]], text)

    done = CliRunner().invoke(main, [filled(part) for part in line])
    assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
    assert done.exit_code == 2, done.output
    lines = (text.strip() for text in PROGRESS.sub("", done.stderr).splitlines())
    answer = [text for text in lines if text and not COUNT.fullmatch(text)]
    assert len(answer) == 1, done.stderr
    named = filled(word) if not (family in ("picture", "video") and "{folder of bad}" in line) else name
    assert named in answer[0] or Path(named).name in answer[0], done.stderr
    leaked = capfd.readouterr()
    assert leaked.err == "" and leaked.out == ""  # what C libraries write past Python


@pytest.mark.full("sixty compositions take 40 s")
@pytest.mark.parametrize("override", SETTINGS)
def test_a_wrong_setting_is_refused_when_it_is_compiled(override, tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    filled = override.replace("{absent}", str(tmp_path / "absent"))
    with pytest.raises(InputError) as error:
        compile_params(filled.split(" "), tmp_path / "params.yaml", check_references)
    assert SETTINGS[override] in str(error.value) and len(str(error.value).splitlines()) == 1, error.value
    assert not (tmp_path / "params.yaml").exists()


def test_the_corpus_is_large_and_of_every_command():
    assert len(CASES) + len(SETTINGS) > 800
    assert {line[0] for line, *_ in CASES.values()} >= set(COMMANDS)


def paths_of(command: click.Command) -> list[click.Parameter]:
    """Arguments and options of a command, and of those below it, that are paths."""
    below = command.commands.values() if isinstance(command, click.Group) else []
    own = [one for one in command.params if isinstance(one.type, click.Path)]
    return own + [one for each in below for one in paths_of(each)]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_no_path_of_a_command_may_be_empty(name: str) -> None:
    """An unset shell variable ("$FOLDER") would name the current folder."""
    command = main.get_command(click.Context(main), name)
    for parameter in paths_of(command):
        with pytest.raises(click.UsageError, match="the path is empty"):
            parameter.type.convert("", parameter, click.Context(command))
