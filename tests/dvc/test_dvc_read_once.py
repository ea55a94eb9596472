"""What is kept about a file is given up with any change of it, and is what DVC reads."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from dvc.dependency.param import read_param_file
from dvc.repo import Repo
from dvc.stage.exceptions import StageFileDoesNotExistError
from dvc.utils.serialize import parse_yaml

from pipeline.dvc import read_once


def test_an_answer_is_kept_until_the_file_changes(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("one")
    asked = []

    def answer():
        asked.append(path.read_text())
        return asked[-1]

    kept = read_once.Kept()
    assert [kept.get(str(path), "text", answer) for _ in range(3)] == ["one"] * 3
    assert kept.get(str(path), "another question", answer) == "one"
    assert len(asked) == 2
    path.write_text("two")
    os.utime(path, ns=(1, 1))  # a clock of coarse steps
    assert kept.get(str(path), "text", answer) == "two"
    other = tmp_path / "b.txt"
    other.write_text("six")
    os.utime(other, ns=(1, 1))
    other.replace(path)  # same length, same time: another inode
    assert kept.get(str(path), "text", answer) == "six"
    path.unlink()
    with pytest.raises(FileNotFoundError):
        kept.get(str(path), "text", answer)


@pytest.mark.parametrize(
    "key", ["a.b", "a.b.c", "a.list", "a.none", "a-b", "a.missing", "missing", "a.list.0", "a.b*", "n.1"]
)
def test_parameters_are_those_of_dvc(tmp_path, key):
    path = tmp_path / "params.yaml"
    path.write_text(
        yaml.safe_dump({"a": {"b": {"c": 1.5}, "list": [1, {"d": 2}], "none": None}, "a-b": "x", "n": {1: 2}})
    )
    fs = Repo.init(tmp_path, no_scm=True).fs
    quick = read_once._read_param_file(read_param_file)
    for _ in range(2):
        assert quick(fs, str(path), ["a.list", key], flatten=True) == read_param_file(
            fs, str(path), ["a.list", key], flatten=True
        )


def test_answers_are_not_shared_between_stages(tmp_path):
    path = tmp_path / "params.yaml"
    path.write_text("a: {b: [1]}")
    fs = Repo.init(tmp_path, no_scm=True).fs
    quick = read_once._read_param_file(read_param_file)
    quick(fs, str(path), ["a"], flatten=True)["a"]["b"].append(2)
    assert quick(fs, str(path), ["a"], flatten=True) == {"a": {"b": [1]}}


def test_hashes_of_single_files_are_kept_and_of_folders_and_stored_files_not():
    calls = []

    def original(output, odb, path, fs, name, **options):
        from dvc_data.hashfile.hash_info import HashInfo
        from dvc_data.hashfile.meta import Meta
        from dvc_data.hashfile.obj import HashFile

        calls.append(path)
        return "staging", Meta(size=3), HashFile(path, fs, HashInfo("md5", "abc"))

    build = read_once._build(original)
    local = SimpleNamespace(protocol="local")
    first, second = (build(None, None, __file__, local, "md5", dry_run=True) for _ in range(2))
    assert len(calls) == 1
    assert first[1] == second[1] and first[1] is not second[1]
    assert first[2].hash_info == second[2].hash_info and first[2].hash_info is not second[2].hash_info
    for path, options in ((str(Path(__file__).parent), {"dry_run": True}), (__file__, {})):
        before = len(calls)
        for _ in range(2):
            build(None, None, path, local, "md5", **options)
        assert len(calls) == before + 2


def test_what_a_large_text_holds_is_kept_for_the_next_process(tmp_path):
    content = {f"stage{number}": {"cmd": "echo", "on": ["1e-3", 1e-3, None, True, 12]} for number in range(2000)}
    text, parsed = yaml.safe_dump(content), []

    def original(text, path, typ="safe"):
        parsed.append(typ)
        return parse_yaml(text, path, typ=typ)

    first, second = (read_once.ParsedTexts(tmp_path / "parsed", original).parse(text, "dvc.lock") for _ in range(2))
    content = parse_yaml(text, "dvc.lock")
    assert first == second == content
    assert parsed == ["safe"]
    texts = read_once.ParsedTexts(tmp_path / "parsed", original)
    changed = text.replace("stage0:", "stage_0:")
    assert list(texts.parse(changed, "dvc.lock")) == list(parse_yaml(changed, "dvc.lock"))
    assert len(parsed) == 2
    texts.parse("a: 1", "params.yaml")
    texts.parse(text, "dvc.lock", typ="rt")
    assert parsed[2:] == ["safe", "rt"]
    (kept,) = (tmp_path / "parsed").iterdir()
    for damaged in ("", "[]", "{", '{"sha256": 1}'):
        kept.write_text(damaged)
        assert texts.parse(text, "dvc.lock") == content


def test_what_json_cannot_hold_is_parsed_each_time(tmp_path):
    text = f"1: integer\ndate: 2020-01-01\ntext: {'x' * read_once.LEAST_KEPT}\n"
    for _ in range(2):
        content = read_once.ParsedTexts(tmp_path / "parsed", parse_yaml).parse(text, "dvc.lock")
        assert content == parse_yaml(text, "dvc.lock")
    assert not (tmp_path / "parsed").exists()


STAGES = """
stages:
  first: {cmd: "echo 1 > first", deps: [given], params: [n], outs: [first]}
  many:
    matrix: {n: [1, 2]}
    cmd: echo ${item.n} > many-${item.n}
    deps: [first]
    outs: ["many-${item.n}"]
"""


def test_stages_and_places_of_files_are_those_of_dvc(tmp_path, monkeypatch):
    """Whatever the targets; without a ``dvc.yaml`` the error is that of DVC."""
    from dvc import output
    from dvc.repo import reproduce

    (tmp_path / "dvc.yaml").write_text(STAGES)
    (tmp_path / "params.yaml").write_text("n: 1")
    monkeypatch.chdir(tmp_path)
    collected = read_once._collect_stages(reproduce.collect_stages)
    looked_up = []

    def get_cloud_fs(config, **options):
        looked_up.append(options)
        return original(config, **options)

    original = output.get_cloud_fs
    monkeypatch.setattr(output, "get_cloud_fs", read_once._get_cloud_fs(get_cloud_fs))
    for targets in (["dvc.yaml"], ["many"], ["many@1", "first"]):
        quick = collected(Repo.init(tmp_path, no_scm=True, force=True), targets, recursive=False, glob=False)
        assert len(looked_up) == 1
        monkeypatch.setattr(output, "get_cloud_fs", original)
        plain = reproduce.collect_stages(Repo(tmp_path), targets)
        monkeypatch.setattr(output, "get_cloud_fs", read_once._get_cloud_fs(get_cloud_fs))
        looked_up.clear()
        assert [stage.addressing for stage in quick] == [stage.addressing for stage in plain]
        for ours, theirs in zip(quick, plain, strict=True):
            assert [entry.fs_path for entry in ours.deps] == [entry.fs_path for entry in theirs.deps]
            assert [entry.def_path for entry in ours.outs] == [entry.def_path for entry in theirs.outs]
            assert {type(entry.fs) for entry in ours.deps} == {type(entry.fs) for entry in theirs.deps}
    (tmp_path / "dvc.yaml").unlink()
    with pytest.raises(StageFileDoesNotExistError):
        collected(Repo(tmp_path), ["dvc.yaml"])


def test_addresses_are_looked_up_each_time():
    asked = []
    quick = read_once._get_cloud_fs(lambda config, **options: asked.append(options) or ("class", {}, "path"))
    config = {"core": {}}
    for _ in range(2):
        assert quick(config, url="s3://bucket/a") == ("class", {}, "path")
        quick(config, url="a", version_aware=True)
    assert len(asked) == 4
