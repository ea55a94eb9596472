"""Third parties' packages and users' files in the configuration: an edit changes what stages depend on."""

from __future__ import annotations

from pathlib import Path

import composed
import pytest
from plug_in_makers import plug_in
from yolox_makers import tiny_yolox, weights_apart

from pipeline import yaml_text
from pipeline.config.compose import compose, parse
from pipeline.config.hydra_plugins.builtin_names import builtin_names
from pipeline.config.hydra_plugins.named_files import hashes, weights_beside
from pipeline.config.hydra_plugins.plug_in_sources import digest
from pipeline.config.references import REGISTRIES, check_references
from pipeline.dependencies.stage_groups import groups
from pipeline.errors import InputError

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


def compiled(*overrides: str) -> dict:
    """Composed anew each time: files that overrides name change between."""
    content: dict = yaml_text.parse(compose(list(overrides)))
    return content


def test_an_edit_of_a_helper_module_changes_the_hash_of_every_member_of_the_package(package: Path) -> None:
    before = compiled(*MEMBERS)["plug_ins"]
    names = {section: list(members) for section, members in before.items()}
    measured = {"measured_sigma": ["columns"], "measured_mtf": ["flat"]}
    assert names == {section: ["mine"] for section in before} | measured
    assert compiled(*MEMBERS)["plug_ins"] == before
    (package / "inner/helper.py").write_text("SIZE = 2\n")
    after = compiled(*MEMBERS)["plug_ins"]
    assert all(after[section][name] != before[section][name] for section in names for name in names[section])


@pytest.mark.parametrize(
    ("section", "kind", "group"),
    [
        ("detection.detectors", "spots", "detection"),
        ("control.policies", "shorter", "control"),
        ("datasets", "drives", "datasets"),
    ],
)
def test_a_file_that_options_name_changes_the_hash_of_its_member_alone(
    package: Path, tmp_path: Path, section: str, kind: str, group: str
) -> None:
    """As the words of a detector, the table of a policy and the places of a dataset, in a list or a mapping too."""
    more = ", root: /drives, dvc_dependency: /drives" if section == "datasets" else ""
    named, other = tmp_path / "named.txt", f"+{section}.other={{kind: {kind}{more}}}"
    given = f'+{section}.mine={{kind: {kind}{more}, options: {{size: 3, words: {{first: [few, "{named}"]}}}}}}'
    absent = compiled(given, other)["plug_ins"][group]
    assert absent["mine"] == absent["other"] == digest(f"pipeline.{group}", kind)
    hashed = {absent["mine"]}
    for text in ("car", "person"):
        named.write_text(text)
        present = compiled(given, other)["plug_ins"][group]
        assert present["other"] == absent["other"]
        hashed.add(present["mine"])
    assert len(hashed) == 3


def test_a_file_that_only_options_of_a_sweep_name_changes_the_hash_of_their_dataset(
    package: Path, tmp_path: Path
) -> None:
    """One that both name counts for both."""
    words, scenes = tmp_path / "words.txt", tmp_path / "scenes.txt"
    section = "kind: drives, root: /drives, dvc_dependency: /drives"
    given = [
        f'+datasets.mine={{{section}, options: {{words: "{words}"}}}}', f"+datasets.other={{{section}}}",
        f'+detection.sweep.options.mine={{words: "{scenes}", moments: all}}',
    ]  # fmt: skip
    hashed, other = set(), set()
    for path in (tmp_path, words, scenes):
        if path is not tmp_path:
            path.write_text("car")
        datasets = compiled(*given)["plug_ins"]["datasets"]
        hashed.add(datasets["mine"])
        other.add(datasets["other"])
    scenes.write_text("person")
    hashed.add(compiled(*given)["plug_ins"]["datasets"]["mine"])
    assert len(hashed) == 4 and other == {digest("pipeline.datasets", "drives")}


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
    plug_ins = compiled()["plug_ins"]
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
    before = compiled(given)["option_files"]
    assert set(before["blur"]["mine"]) == {"weights"} and before["blur"]["spectral"] == {}
    assert compiled(given)["option_files"] == before
    weights.write_bytes(b"second")
    after = compiled(given)["option_files"]
    assert after["blur"]["mine"] != before["blur"]["mine"] and after["noise"] == before["noise"]


@pytest.mark.usefixtures("at_top")
def test_an_option_that_a_policy_of_ones_own_does_not_take_is_refused_when_compiling(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "class Shorter:\n    def __init__(self, camera, performance, factor=0.5): ...\n"
    plug_in(tmp_path, monkeypatch, "shortening_policy", text, control="shorter = shortening_policy:Shorter")
    for given, words in (("facto", "did you mean 'factor'"), ("camera", "known: factor")):
        override = f"+control.policies.mine={{kind: shorter, options: {{{given}: 1}}}}"
        with pytest.raises(InputError, match=f"control.policies.mine.options.{given}: unknown option .*{words}"):
            check_references(parse(compose([override]), "conf/"))


@pytest.mark.parametrize("package", REGISTRIES.names())
def test_built_in_names_are_those_of_the_registries(package: str) -> None:
    registry = REGISTRIES.get(package)
    assert builtin_names(registry.group) == {name for name in registry.names() if registry.is_builtin(name)} != set()


@pytest.mark.usefixtures("at_top")
def test_a_name_that_is_built_in_has_no_hash_of_a_third_party_and_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The registry takes the built-in class: a third party's of the same name is never asked."""
    text = "class Mine: ...\n"
    plug_in(tmp_path, monkeypatch, "wavelets", text, noise="wavelet = wavelets:Mine", blur="gbb = wavelets:Mine")
    content = compose([])
    plug_ins = yaml_text.parse(content)["plug_ins"]
    assert plug_ins["noise"] == plug_ins["real_noise"] == plug_ins["blur"] == {}
    with pytest.raises(InputError) as refused:
        check_references(parse(content, "conf/"))
    noise, blur = str(refused.value).splitlines()
    assert noise == (
        "noise estimator 'wavelet' is pipeline.noise.wavelet:WaveletMedian of this package, and "
        "wavelets:Mine of wavelets is never used; rename its entry point of pipeline.noise, or uninstall it"
    )
    assert blur.startswith("blur estimator 'gbb' is pipeline.blur.gbb:GraphBlindDeblurring of this package")


@pytest.mark.usefixtures("at_top")
def test_a_name_of_two_packages_is_refused_where_it_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, name in enumerate(("first", "second")):
        folder = tmp_path / str(number)
        folder.mkdir()
        plug_in(folder, monkeypatch, f"{name}_package", "class Mine: ...\n", noise=f"mine = {name}_package:Mine")
    check_references(parse(compose([]), "conf/"))
    with pytest.raises(InputError) as refused:
        check_references(parse(compose(["+noise.estimators.x={kind: mine}"]), "conf/"))
    (line,) = str(refused.value).splitlines()
    assert line.startswith("noise estimator 'mine' is registered twice, as ") and "rename one entry point" in line
    assert "first_package:Mine of first_package" in line and "second_package:Mine of second_package" in line


@pytest.mark.usefixtures("at_top")
def test_options_may_hold_lists_of_files_and_long_texts(tmp_path: Path) -> None:
    parts = [tmp_path / "first", tmp_path / "second"]
    for path in parts:
        path.write_bytes(b"part")
    listed = ", ".join(f'"{path}"' for path in parts)
    given = f"+noise.estimators.mine={{kind: pca, options: {{parts: [{listed}], text: {'long ' * 100}}}}}"
    before = compiled(given)["option_files"]["noise"]["mine"]
    assert set(before) == {"parts"}
    parts[1].write_bytes(b"other")
    assert compiled(given)["option_files"]["noise"]["mine"] != before


@pytest.mark.usefixtures("at_top")
def test_weights_that_a_network_keeps_in_a_file_beside_it_count_where_options_name_it(tmp_path: Path) -> None:
    """As PyTorch writes them: trained anew, the network's own file stays the same."""
    network = weights_apart(tmp_path)
    before, own = hashes({"weights": str(network)}), network.read_bytes()
    (beside,) = weights_beside(network)
    assert beside == tmp_path / "tiny.onnx.data"
    beside.write_bytes(bytes(beside.stat().st_size))
    assert network.read_bytes() == own and hashes({"weights": str(network)}) != before
    assert not weights_beside(tiny_yolox(tmp_path / "whole.onnx"))


@pytest.mark.usefixtures("at_top")
def test_weights_of_a_detector_in_a_file_beside_its_own_are_refused(tmp_path: Path) -> None:
    override = f'+detection.detectors.mine={{kind: yolox, weights: "{weights_apart(tmp_path)}"}}'
    with pytest.raises(InputError, match=r"mine.weights=.*tiny.onnx: keeps its weights in tiny.onnx.data.*one file"):
        check_references(parse(compose([override]), "conf/"))


def test_stages_depend_on_whitelists_and_on_the_folder_of_kernels(package: Path, tmp_path: Path) -> None:
    graph = composed.graph()
    content = compiled(*MEMBERS, "psf=paper", "psf.folder=/kernels")
    (index,) = (group for group in groups(graph, content) if group.name == "index")
    mine = next(item for item in index.items if item["key"] == "mine")
    assert {"${item.data}", "${item.whitelist}", "${item.images}"} <= set(index.body["deps"])
    assert [mine[f"item.{name}"] for name in ("data", "whitelist", "images")] == ["/drives", "/some.txt", "/pictures"]
    assert [item["key"] for item in index.items] == list(content["datasets"])
    assert "${read_files.psf}" in graph["stages"]["psf_bank"]["deps"]
    assert content["read_files"]["psf"] == "/kernels"
    assert compiled()["read_files"]["psf"] == "data/raw/README.md"
