"""The sweep of a third party's detector: it enters the study, its options are checked, an edit of it is noticed."""

from __future__ import annotations

import contextlib
import hashlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import composed
import pytest
from data_makers import make_kitti
from plug_in_makers import SPOTS, plug_in
from test_experiments_detect import KERNELS, LEVELS, ROOT, configured
from yolox_makers import weights_apart

from pipeline import store
from pipeline.config.references import check_references
from pipeline.config.schema import Config, validate
from pipeline.detection import checkpoint
from pipeline.errors import InputError
from pipeline.experiments import detect as sweep
from pipeline.stages import detect, detector, index


@contextlib.contextmanager
def _killed_after(pieces: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Inside, a sweep is killed once it has kept so many pieces of its work, and must be."""
    made, load_or_compute = [], checkpoint.load_or_compute

    def killed(*arguments: Any) -> Any:
        if len(made) == pieces:
            raise KeyboardInterrupt
        made.append(load_or_compute(*arguments))
        return made[-1]

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(checkpoint, "load_or_compute", killed)
        yield


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    make_kitti(folder / "kitti", frames=2)
    return folder


def _with_own(data: Path, section: str = "{kind: spots}") -> Config:
    """As `configured`, with a third party's detector in the place of the tiny one."""
    override = f"+detection.detectors.mine={section}"
    content = composed.content("profile=smoke", "executor.workers=1", override)
    given = configured(data).model_dump(by_alias=True)
    content["datasets"], content["detection"]["sweep"] = given["datasets"], given["detection"]["sweep"]
    content["detection"] |= {"detectors": {"mine": content["detection"]["detectors"]["mine"]}, "datasets": ["kitti"]}
    content["matrix"] |= {"datasets": ["kitti"], "detectors": ["mine"], "detection_datasets": ["kitti"]}
    content["control"]["detector"] = "mine"
    content["by_kind"]["detection"] = {"other": content["by_kind"]["detection"]["other"]}
    return validate(content)


def test_a_third_partys_detector_without_weights_enters_the_study(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = plug_in(tmp_path, monkeypatch, "spots_of_mine", SPOTS, detection="spots = spots_of_mine:Spots")
    config = _with_own(data)
    assert config.by_kind["detection"]["other"] == {"mine": str(module)}  # so that DVC notices an edit of it
    index.run.run(config, {"dataset": "kitti"}, tmp_path, tmp_path)
    detector.run.run(config, {"detector": "mine"}, tmp_path, tmp_path)
    about = store.read_json(tmp_path / "data/detector/mine/detector.json")
    assert about["sha256"] == hashlib.sha256(module.read_bytes()).hexdigest() and about["source"] == module.name
    detect.run.run(config, {"dataset": "kitti", "detector": "mine"}, tmp_path, tmp_path)
    table = store.read_table(tmp_path / "data/detect/kitti-mine/detections.parquet", sweep.DETECTIONS)
    assert len(table) == 2 * KERNELS * len(LEVELS) and set(table["x2"]) == {30.0}


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("+detection.detectors.mine={kind: spots, options: {side_px: 9}}", ""),
        ("+detection.detectors.mine={kind: spots, weights: a.onnx}", "mine.weights: 'spots' takes no weights"),
        ("+detection.detectors.mine={kind: spots, options: {side: 9}}", "options.side: unknown option of 'spots'"),
    ],
)
def test_weights_and_options_of_a_third_partys_detector_are_checked_when_compiling(
    override: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plug_in(tmp_path, monkeypatch, "spots_of_mine", SPOTS, detection="spots = spots_of_mine:Spots")
    config = composed.config(override)
    monkeypatch.chdir(ROOT)
    if not words:
        return check_references(config)
    with pytest.raises(InputError, match=words):
        check_references(config)
    return None


def test_after_an_edit_of_a_helper_module_a_killed_sweep_begins_anew(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its pieces of before the edit would be mixed with those of after it."""
    helper = tmp_path / "edited_spots/helper.py"
    helper.parent.mkdir()
    helper.write_text("SIDE = 30\n")
    text = SPOTS.replace("side_px=30", "side_px=None").replace("self.side_px = side_px", "self.side_px = SIDE")
    (helper.parent / "__init__.py").write_text(f"from edited_spots.helper import SIDE\n{text}")
    plug_in(tmp_path, monkeypatch, "edited_spots_module", "", detection="spots = edited_spots:Spots")
    config = _with_own(data)

    def run_again() -> None:
        for name in [name for name in sys.modules if name.startswith("edited_spots")]:
            del sys.modules[name]
        sweep.opened.cache_clear()
        detect.run.run(config, {"dataset": "kitti", "detector": "mine"}, tmp_path, tmp_path)

    index.run.run(config, {"dataset": "kitti"}, tmp_path, tmp_path)
    detector.run.run(config, {"detector": "mine"}, tmp_path, tmp_path)
    before = store.read_json(tmp_path / "data/detector/mine/detector.json")
    with _killed_after(3, monkeypatch):
        run_again()
    helper.write_text("SIDE = 50\n\n")
    run_again()
    table = store.read_table(tmp_path / "data/detect/kitti-mine/detections.parquet", sweep.DETECTIONS)
    assert set(table["x2"]) == {50.0}
    detector.run.run(config, {"detector": "mine"}, tmp_path, tmp_path)  # so that what depends on it runs again
    assert store.read_json(tmp_path / "data/detector/mine/detector.json") != before


SIZED = """
from pathlib import Path


class Sized(Spots):
    def __init__(self, weights):
        super().__init__(int(Path(weights).read_text()))
"""
"""A detector with weights, after `SPOTS`: the side of what it detects."""


def test_work_kept_goes_by_the_weights_as_they_are_and_so_does_what_is_stated(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stage `detector` may have opened others: a stage that is run by itself does not ask it."""
    plug_in(tmp_path, monkeypatch, "sized_spots", SPOTS + SIZED, detection="sized = sized_spots:Sized")
    weights = tmp_path / "side.txt"
    weights.write_text("30")
    config = _with_own(data, f"{{kind: sized, weights: {weights}}}")
    index.run.run(config, {"dataset": "kitti"}, tmp_path, tmp_path)
    detector.run.run(config, {"detector": "mine"}, tmp_path, tmp_path)
    with _killed_after(3, monkeypatch):
        detect.run.run(config, {"dataset": "kitti", "detector": "mine"}, tmp_path, tmp_path)
    weights.write_text("50")
    sweep.opened.cache_clear()  # another process
    detect.run.run(config, {"dataset": "kitti", "detector": "mine"}, tmp_path, tmp_path)
    table = store.read_table(tmp_path / "data/detect/kitti-mine/detections.parquet", sweep.DETECTIONS)
    assert set(table["x2"]) == {50.0}
    about = store.read_json(tmp_path / "data/detect/kitti-mine/about.json")
    assert about["sha256"] == hashlib.sha256(b"50").hexdigest() and about["weights"] == "side.txt"


def test_another_file_behind_an_option_is_another_detector_and_weights_in_two_files_are_refused(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is kept of a killed sweep goes by the hash, too."""
    plug_in(tmp_path, monkeypatch, "spots_of_mine", SPOTS, detection="spots = spots_of_mine:Spots")
    words, seen = tmp_path / "words.txt", set()
    for text in ("30", "50"):
        words.write_text(text)
        detector.run.run(
            _with_own(data, f'{{kind: spots, options: {{side_px: "{words}"}}}}'), {"detector": "mine"}, data, tmp_path
        )
        seen.add(store.read_json(tmp_path / "data/detector/mine/detector.json")["sha256"])
    assert len(seen) == 2
    weights_apart(tmp_path)
    with pytest.raises(InputError, match=r"detection.detectors.tiny.weights=.*in tiny.onnx.data.*one file"):
        detector.run.run(configured(tmp_path), {"detector": "tiny"}, data, tmp_path)


CALLING = """
import numpy as np
from pipeline.detection.base import Detections, each_image


class Calling:
    def __init__(self, words):
        self.words = words

    def detect(self, images):
        count = len(self.words)
        return [Detections.of(np.tile([0.0, 0, 9, 9], (count, 1)), np.full(count, 0.5), self.words) for _ in images]
"""


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("[Car, Pedestrian]", ""),
        ("[car, Pedestrian]", "warning: detector 'calling' on 'kitti': it calls no detection 'person'; its words are"),
        ("[car]", None),
    ],
)
def test_a_sweep_tells_classes_that_a_detector_calls_otherwise(
    words: str, told: str | None, data: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    plug_in(tmp_path, monkeypatch, "calling_of_mine", CALLING, detection="calling = calling_of_mine:Calling")
    config = _with_own(data, f"{{kind: calling, options: {{words: {words}}}}}")
    index.run.run(config, {"dataset": "kitti"}, tmp_path, tmp_path)
    detector.run.run(config, {"detector": "mine"}, tmp_path, tmp_path)
    job = {"dataset": "kitti", "detector": "mine"}
    if told == "":
        expected = "'calling' on 'kitti'.* no detection 'car' or 'person'; its words are 'Car', 'Pedestrian'.*_classes"
        with pytest.raises(InputError, match=expected):
            detect.run.run(config, job, tmp_path, tmp_path)
    else:
        detect.run.run(config, job, tmp_path, tmp_path)
        printed = capsys.readouterr().err
        assert told in printed if told else "warning" not in printed
