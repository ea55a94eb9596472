"""Weights that a record names: those that its estimators load, given or released, and no others."""

from __future__ import annotations

import hashlib
import inspect
import json
import shutil
from pathlib import Path

import pytest
from data_makers import make_folder

from pipeline import blur, noise
from pipeline.condition import ConditionMonitor
from pipeline.datasets import open_dataset
from pipeline.errors import InputError
from pipeline.experiments.settings import EstimatorSettings
from pipeline.recording.provenance import (
    blur_weights,
    configured_weights,
    content_sha256,
    inputs_of,
    monitor_weights,
    noise_weights,
)
from pipeline.weight_files import active_folder

WEIGHTS = Path(__file__).resolve().parents[2] / "data/weights"
SPECTRAL = ["mtf_spectral.safetensors", "mtf_spectral_processed.safetensors"]
TYPICAL = "mtf_spectral_typical.json"
BLUR = [
    ("spectral", {}, SPECTRAL),
    ("spectral", {"output": "relative"}, [*SPECTRAL, TYPICAL]),
    ("spectral", {"processed": False}, SPECTRAL[:1]),
    ("cnn", {}, ["mtf_cnn.safetensors"]),
    ("fused", {}, ["mtf_fusion.safetensors", "mtf_pixels.safetensors", *SPECTRAL]),
    ("pmp", {"mode": "fast"}, []),
    ("gbb", {}, []),
]
NOISE = [
    ("adaptive", {}, ["sigma_cellwise.safetensors", "sigma_correlated.safetensors"]),
    ("cellwise", {}, ["sigma_cellwise.safetensors"]),
    ("correlated", {}, ["sigma_correlated.safetensors"]),
    ("cnn", {}, ["sigma_cnn.safetensors"]),
    ("pca", {"stride": 2}, []),
    ("bf", {}, []),
    ("wavelet", {}, []),
    ("immerkaer", {}, []),
]


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def expected(names: list[str]) -> dict[str, str]:
    return {name: digest(WEIGHTS / name) for name in names}


@pytest.mark.parametrize(("kind", "options", "names"), BLUR)
def test_a_blur_estimator_names_what_it_loads(kind: str, options: dict, names: list[str]) -> None:
    assert blur_weights(kind, options) == expected(names)


@pytest.mark.parametrize(("kind", "options", "names"), NOISE)
def test_a_noise_estimator_names_what_it_loads(kind: str, options: dict, names: list[str]) -> None:
    assert noise_weights(kind, options) == expected(names)


def test_every_registered_estimator_and_every_option_for_weights_is_known() -> None:
    """A new estimator, or one with a further network, must not be left out of records."""
    assert {kind for kind, _, _ in BLUR} >= set(blur.REGISTRY.names())
    assert {kind for kind, _, _ in NOISE} >= set(noise.REGISTRY.names())
    for registry, weights in ((blur.REGISTRY, blur_weights), (noise.REGISTRY, noise_weights)):
        for kind in registry.names():
            options = [name for name in inspect.signature(registry.get(kind)).parameters if name.endswith("weights")]
            assert bool(options) == bool(weights(kind))
            for option in options:
                with pytest.raises(InputError, match="no file"):
                    weights(kind, {option: "/absent.safetensors"})


def test_files_that_are_opened_are_those_that_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Weights are read through two functions only; what they open is what a record must name."""
    from pipeline.blur.camera_calibration import Calibration
    from pipeline.learning import weights as files

    opened: set[str] = set()
    load, loaded = files.load, Calibration.load

    def watched(path, *more, **options):
        opened.add(Path(path).name)
        return load(path, *more, **options)

    def watched_map(path):
        opened.add(Path(path).name)
        return loaded(path)

    monkeypatch.setattr(files, "load", watched)
    monkeypatch.setattr(Calibration, "load", staticmethod(watched_map))
    for cases, create in ((BLUR, blur.create), (NOISE, noise.create)):
        for kind, options, names in cases:
            opened.clear()
            create(kind, **options)
            assert opened == set(names), kind


def test_given_weights_take_the_place_of_the_released_ones(tmp_path: Path) -> None:
    mine = tmp_path / "mine.safetensors"
    mine.write_bytes(b"other")
    beside = expected(SPECTRAL[1:])
    assert blur_weights("spectral", {"weights": str(mine)}) == {"mine.safetensors": digest(mine), **beside}
    assert noise_weights("cnn", {"weights": mine}) == {"mine.safetensors": digest(mine)}
    assert noise_weights("adaptive", {"correlated_weights": mine}) == {
        "mine.safetensors": digest(mine),
        **expected(["sigma_cellwise.safetensors"]),
    }
    with pytest.raises(InputError, match="mine_typical.json"):
        blur_weights("spectral", {"weights": mine, "output": "relative"})


def test_weights_of_a_profile_are_named_while_it_runs(tmp_path: Path) -> None:
    (tmp_path / "mtf_cnn.safetensors").write_bytes(b"of the profile")
    with active_folder(tmp_path):
        assert blur_weights("cnn") == {"mtf_cnn.safetensors": digest(tmp_path / "mtf_cnn.safetensors")}
    assert blur_weights("cnn") == expected(["mtf_cnn.safetensors"])


def test_a_monitor_names_the_weights_it_was_given(tmp_path: Path) -> None:
    mine = tmp_path / "mine.safetensors"
    shutil.copy(WEIGHTS / "sigma_cellwise.safetensors", mine)
    monitor = ConditionMonitor("pmp", "cellwise", noise_options={"weights": mine})
    assert monitor_weights(monitor) == {"mine.safetensors": digest(mine)}


def test_estimators_of_an_experiment_by_name_without_those_that_have_none() -> None:
    of_blur = {"ours": EstimatorSettings(kind="cnn"), "theirs": EstimatorSettings(kind="pmp")}
    of_noise = {"pca": EstimatorSettings(kind="pca")}
    assert configured_weights(of_blur, of_noise) == {"blur": {"ours": expected(["mtf_cnn.safetensors"])}}
    assert configured_weights({}, of_noise) == {}


def test_one_hash_stands_for_all_pictures_labels_and_kernels(tmp_path: Path) -> None:
    """The same content anywhere has the same hash; a byte of a picture, a box or a kernel changes it."""

    def about(root: Path, **kernels: str) -> dict:
        return inputs_of(list(open_dataset("folder", "mine", root).frames()), kernels)

    root = make_folder(tmp_path / "mine", 2)
    shutil.copytree(root, tmp_path / "elsewhere")
    first = about(root, disc="0" * 64)
    assert set(first["frames"]) == set(first["labels"]) and len(first["frames"]) == 2
    assert first["frames"] == {path.stem: digest(path) for path in (root / "images").iterdir()}
    assert first == about(tmp_path / "elsewhere", disc="0" * 64) and first["inputs_sha256"] == content_sha256(first)
    hashes = {first["inputs_sha256"], about(root, disc="1" * 64)["inputs_sha256"], about(root)["inputs_sha256"]}
    label = next((root / "labels").iterdir())
    label.write_text(label.read_text() + "\ncar 10 10 40 40\n")
    hashes.add(about(root, disc="0" * 64)["inputs_sha256"])
    picture = next((root / "images").iterdir())
    picture.write_bytes(picture.read_bytes() + b"\0")
    hashes.add(about(root, disc="0" * 64)["inputs_sha256"])
    assert len(hashes) == 5


RECORDS = sorted((Path(__file__).resolve().parents[2] / "reports/recorded").glob("*/*provenance.json"))


@pytest.mark.parametrize("path", RECORDS, ids=lambda path: path.parent.name)
def test_every_record_holds_the_hash_of_what_was_measured(path: Path) -> None:
    about = json.loads(path.read_text(encoding="utf-8"))
    measured = [about[name] for name in ("frames", "datasets", "files") if name in about]
    assert about["inputs_sha256"] == content_sha256(about) and len(measured) == 1 and measured[0]
