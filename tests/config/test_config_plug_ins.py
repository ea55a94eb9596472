"""Third parties' packages and users' files in the configuration: an edit changes what stages depend on."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from pipeline.config.compose import compose
from pipeline.config.hydra_plugins.plug_in_sources import digest
from pipeline.dependencies.stage_groups import groups

ROOT = Path(__file__).resolve().parents[2]
POINTS = """
[pipeline.noise]
columns = things_of_mine.noise:Columns
[pipeline.blur]
flat = things_of_mine.blur:Flat
[pipeline.detection]
spots = things_of_mine.detector:Spots
[pipeline.control]
shorter = things_of_mine.policy:Shorter
[pipeline.datasets]
drives = things_of_mine.dataset:Drives
"""
MEMBERS = [
    "+noise.estimators.mine={kind: columns}",
    "+real_noise.estimators.mine={kind: columns}",
    "+blur.estimators.mine={kind: flat}",
    "+detection.detectors.mine={kind: spots}",
    "+control.policies.mine={kind: shorter}",
    "+datasets.mine={kind: drives, root: /drives, dvc_dependency: /drives, whitelist: /some.txt, "
    "options: {images: /pictures}}",
    "detection.measure.sigma=columns",
    "detection.measure.mtf=flat",
]


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A third party's package with a helper module, installed for the rest of a test; its folder."""
    folder = tmp_path / "things_of_mine"
    (folder / "inner").mkdir(parents=True)
    for name in ("__init__", "noise", "blur", "detector", "policy", "dataset", "inner/helper"):
        (folder / f"{name}.py").write_text("raise RuntimeError('imported')\n")
    info = tmp_path / "things_of_mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: things_of_mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(ROOT)
    return folder


def composed(*overrides: str) -> dict:
    content: dict = yaml.safe_load(compose(list(overrides)))
    return content


def test_an_edit_of_a_helper_module_changes_the_hash_of_every_member_of_the_package(package: Path) -> None:
    before = composed(*MEMBERS)["plug_ins"]
    names = {section: list(members) for section, members in before.items()}
    measured = {"measured_sigma": ["columns"], "measured_mtf": ["flat"]}
    assert names == {section: ["mine"] for section in before} | measured
    assert composed(*MEMBERS)["plug_ins"] == before
    (package / "inner/helper.py").write_text("SIZE = 2\n")
    after = composed(*MEMBERS)["plug_ins"]
    assert all(after[section][name] != before[section][name] for section in names for name in names[section])


def test_other_files_of_a_package_do_not_change_its_hash_and_names_do(package: Path) -> None:
    before = digest("pipeline.noise", "columns")
    (package / "notes.txt").write_text("nothing that is executed")
    assert digest("pipeline.noise", "columns") == before
    (package / "inner/helper.py").rename(package / "inner/other.py")
    assert digest("pipeline.noise", "columns") != before


def test_code_behind_a_linked_folder_of_a_package_counts_and_a_link_to_itself_ends(package: Path) -> None:
    plain = digest("pipeline.noise", "columns")
    (package / "inner").rename(package.parent / "elsewhere")
    (package / "inner").symlink_to(package.parent / "elsewhere")
    (package / "itself").symlink_to(package)
    assert digest("pipeline.noise", "columns") == plain
    (package.parent / "elsewhere/helper.py").write_text("SIZE = 2\n")
    assert digest("pipeline.noise", "columns") != plain


def test_a_module_without_package_counts_as_its_file(package: Path) -> None:
    (package.parent / "things_of_mine-1.0.dist-info/entry_points.txt").write_text(
        "[pipeline.noise]\na = lone_thing:A\n"
    )
    absent = digest("pipeline.noise", "a")
    (package.parent / "lone_thing.py").write_text("A = 1\n")
    before = digest("pipeline.noise", "a")
    (package.parent / "lone_thing.py").write_text("A = 2\n")
    assert len({absent, before, digest("pipeline.noise", "a")}) == 3


def test_without_third_parties_the_sections_are_empty() -> None:
    plug_ins = composed()["plug_ins"]
    assert plug_ins and not any(plug_ins.values())
    assert digest("pipeline.noise", "pca") is None


@pytest.fixture
def at_top(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.mark.usefixtures("at_top")
def test_another_file_behind_an_option_changes_what_its_stages_depend_on(tmp_path: Path) -> None:
    weights = tmp_path / "mine.safetensors"
    given = f'+blur.estimators.mine={{kind: spectral, options: {{weights: "{weights}", batch: 8, output: system}}}}'
    weights.write_bytes(b"first")
    before = composed(given)["option_files"]
    assert set(before["blur"]["mine"]) == {"weights"} and before["blur"]["spectral"] == {}
    assert composed(given)["option_files"] == before
    weights.write_bytes(b"second")
    after = composed(given)["option_files"]
    assert after["blur"]["mine"] != before["blur"]["mine"] and after["noise"] == before["noise"]


def test_stages_depend_on_whitelists_and_on_the_folder_of_kernels(package: Path, tmp_path: Path) -> None:
    graph = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))
    content = composed(*MEMBERS, "psf=paper", "psf.folder=/kernels")
    (index,) = (group for group in groups(graph, content) if group.name == "index")
    mine = next(item for item in index.items if item["key"] == "mine")
    assert {"${item.data}", "${item.whitelist}", "${item.images}"} <= set(index.body["deps"])
    assert [mine[f"item.{name}"] for name in ("data", "whitelist", "images")] == ["/drives", "/some.txt", "/pictures"]
    assert [item["key"] for item in index.items] == list(content["datasets"])
    assert "${read_files.psf}" in graph["stages"]["psf_bank"]["deps"]
    assert content["read_files"]["psf"] == "/kernels"
    assert composed()["read_files"]["psf"] == "data/raw/README.md"
