"""Frames of a detection sweep with a reader's options: limits hold, and what is set aside or unreadable is not used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data_makers import make_folder, make_sim, write
from plug_in_makers import plug_in
from test_experiments_detect import configured
from yolox_makers import tiny_yolox

from pipeline import store
from pipeline.camera.psf.kernel import Kernel
from pipeline.config.schema import Config
from pipeline.datasets.frame import Frame
from pipeline.datasets.settings import DatasetSettings
from pipeline.errors import InputError
from pipeline.experiments import detect as sweep
from pipeline.experiments.sweep_frames import sweep_frames
from pipeline.stages import detect, index

SCENES = {"scene": ".+-"}
"""Options of the kind `folder`, with which it gives the same frames."""


def _configured(folder: Path, max_rejected_fraction: float = 0.5, limit: int | None = None) -> Config:
    config = configured(folder, name="folder")
    changes = {"max_rejected_fraction": max_rejected_fraction, "limit": limit}
    config.datasets["folder"] = config.datasets["folder"].model_copy(update=changes)
    config.detection.sweep.options["folder"] = SCENES
    config.detection.sweep.sizes_px[:], config.detection.sweep.target_sigmas_dn[:] = [0], [0.0]
    return config


def test_a_sweep_with_options_leaves_out_what_the_index_has_set_aside(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = make_folder(tmp_path / "folder", frames=6)
    damaged = root / "images/frame-1.png"
    damaged.write_bytes(damaged.read_bytes()[:3000])
    write(root / "images/frame-3.png", np.full((150, 150), 90, np.uint8))  # smaller than a patch
    (root / "labels/frame-4.txt").write_text("car 10 10 60\n")
    tiny_yolox(tmp_path / "tiny.onnx", "side")
    config, out = _configured(tmp_path), tmp_path / "out"
    index.run.run(config, {"dataset": "folder"}, out, out)
    detect.run.run(config, {"dataset": "folder", "detector": "tiny"}, out, out)
    looked = store.read_table(out / "data/detect/folder-tiny/looked.parquet", sweep.LOOKED)
    assert sorted(looked["frame"]) == ["frame-0", "frame-2", "frame-5"]
    assert "left out" not in capsys.readouterr().err  # the index has counted them


def test_a_limit_holds_with_options_too(tmp_path: Path) -> None:
    make_folder(tmp_path / "folder", frames=6)
    config = _configured(tmp_path, limit=3)
    index.run.run(config, {"dataset": "folder"}, tmp_path, tmp_path)
    folder, section = tmp_path / "data/index/folder", config.datasets["folder"]
    with_options, without = (
        [frame.name for frame in sweep_frames("folder", section, options, None, folder)] for options in (SCENES, {})
    )
    assert with_options == without == ["frame-0", "frame-2", "frame-4"]
    root = make_sim(tmp_path / "sim", viewpoints=4)
    sim = DatasetSettings(kind="sim", root=str(root), dvc_dependency="sim", limit=2, max_rejected_fraction=0.0)
    moments = sweep_frames("sim", sim, {"moments": "all"}, None, None)
    assert [frame.name[-6:] for frame in moments] == ["0000-0", "0002-0"]


def test_a_further_frame_that_cannot_be_read_is_named_and_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Moments before the last are in no index."""
    root = make_sim(tmp_path / "sim", viewpoints=2)
    first = root / "evaluation/evaluation-0001-0"
    first.with_suffix(".png").write_bytes(b"no picture")
    first.with_name("evaluation-0000-2.json").write_text("[")
    section = DatasetSettings(kind="sim", root=str(root), dvc_dependency="sim", max_rejected_fraction=0.25)
    every = sweep_frames("sim", section, {"moments": "all"}, None, None)
    assert [frame.name[-6:] for frame in every] == ["0000-0", "0000-1", "0000-3", "0001-1", "0001-2", "0001-3"]
    assert [frame.name[-6:] for frame in sweep_frames("sim", section, {"moments": "all"}, 2, None)] == [
        "0000-0", "0001-1",
    ]  # fmt: skip
    printed = capsys.readouterr().err
    assert "'sim': evaluation/evaluation-0001-0.png is left out: " in printed
    assert "evaluation-0000-2.png is left out: evaluation/evaluation-0000-2.json: not valid JSON" in printed
    strict = section.model_copy(update={"max_rejected_fraction": 0.0})
    with pytest.raises(InputError, match=r"'sim': 2 of 8 frames cannot be used.*datasets\.sim\.max_rejected_fraction"):
        sweep_frames("sim", strict, {"moments": "all"}, None, None)


DARKER = """
from dataclasses import dataclass, fields
from pathlib import Path

from pipeline.datasets.folder import Folder
from pipeline.datasets.frame import Frame


@dataclass(frozen=True)
class Scaled(Frame):
    factor: float = 1.0

    def image(self):
        return super().image() * self.factor


class Darker(Folder):
    kind = "darker"
    detector_classes = {"car": "car"}

    def __init__(self, name, root, *, factor, power=1, whitelist=None, limit=None):
        super().__init__(name, root, whitelist=whitelist, limit=limit)
        self.factor = float(Path(factor).read_text()) ** power

    def frames(self):
        columns = [{f.name: getattr(frame, f.name) for f in fields(frame)} for frame in super().frames()]
        return [Scaled(**given, factor=self.factor) for given in columns]
"""
"""A third party's reader, whose pictures depend on a file that an option names."""


@pytest.mark.parametrize("edited", ["section", "sweep", "value"])
def test_another_file_or_value_of_a_readers_option_begins_a_killed_sweep_anew(
    edited: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plug_in(tmp_path, monkeypatch, "darker_of_mine", DARKER, datasets="darker = darker_of_mine:Darker")
    make_folder(tmp_path / "folder", frames=2)
    tiny_yolox(tmp_path / "tiny.onnx", "side")
    paths = {name: tmp_path / f"{name}.txt" for name in ("section", "sweep")}
    options = {name: {"factor": str(path)} for name, path in paths.items()}
    for path in paths.values():
        path.write_text("0.5")
    config = _configured(tmp_path)
    section = {"kind": "darker", "options": options["section"]}
    config.datasets["folder"] = config.datasets["folder"].model_copy(update=section)
    config.detection.sweep.options["folder"] = options["sweep"] if edited == "sweep" else {"power": 1}
    index.run.run(config, {"dataset": "folder"}, tmp_path, tmp_path)

    def mean(self: sweep.Sweep, frame: Frame, kernel: Kernel) -> dict[str, Any]:
        if frame.name == "frame-1" and len(killed) == 0:
            killed.append(True)
            raise KeyboardInterrupt
        made.append(float(frame.image().mean()))
        one = {"level": np.zeros(1), "boxes": np.array([[0.0, 0, 9, 9]]), "score": np.array(made[-1:])}
        return {**one, "label": np.array(["car"]), "other": np.array([], np.str_)}

    made: list[float] = []
    killed: list[bool] = []
    monkeypatch.setattr(sweep.Sweep, "detect", mean)
    job = {"dataset": "folder", "detector": "tiny"}
    with pytest.raises(KeyboardInterrupt):
        detect.run.run(config, job, tmp_path, tmp_path)
    if edited == "value":
        config.detection.sweep.options["folder"] = {"power": 2}
    else:
        paths[edited].write_text("0.25")
    reader = tmp_path / "data/index/folder/reader.json"
    before = reader.read_bytes()
    index.run.run(config, {"dataset": "folder"}, tmp_path, tmp_path)
    assert (reader.read_bytes() == before) is (edited == "value")  # stages that depend on the index notice a file
    detect.run.run(config, job, tmp_path, tmp_path)
    table = store.read_table(tmp_path / "data/detect/folder-tiny/detections.parquet", sweep.DETECTIONS)
    assert len(made) == 3 and made[1] == pytest.approx(made[0] / 2)
    assert table["score"].tolist() == made[1:]
