"""Published weights: the table, the configured detectors that read them, and the file that tests use."""

from __future__ import annotations

import inspect
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml

from pipeline import detection
from pipeline.cli.data_folders import DETECTOR_WEIGHTS
from pipeline.detection.settings import DetectorSettings
from pipeline.detection.weights_table import TABLE
from pipeline.errors import InputError
from pipeline.store import file_sha256

ROOT = Path(__file__).resolve().parents[2]


def test_the_table_is_pinned_and_names_real_detectors() -> None:
    for name, row in TABLE.items():
        assert row.detector in detection.REGISTRY.names(), name
        assert all(urlsplit(url).scheme == "https" for url in row.urls) and row.urls
        assert "/main/" not in " ".join(row.urls) and "/master/" not in " ".join(row.urls), "not a fixed revision"
        assert row.sha256 is None or (len(row.sha256) == 64 and int(row.sha256, 16))
    assert len({row.file for row in TABLE.values()}) == len(TABLE)


@pytest.mark.parametrize("path", sorted((ROOT / "conf" / "detector").glob("*.yaml")), ids=lambda path: path.stem)
def test_configured_detectors_take_their_options(path: Path) -> None:
    """Options are the class's own; the file is one that ``weights get`` brings (or its export), or a released one."""
    # The root of the default profile is empty.
    content = yaml.safe_load(path.read_text(encoding="utf-8").replace("${root}", ""))
    section = DetectorSettings(**{**content, "dvc_dependency": content["weights"]})
    assert section.kind == path.stem
    taken = inspect.signature(detection.REGISTRY.get(section.kind)).parameters
    assert {"weights", *section.options} <= set(taken)
    file = Path(section.weights)
    if section.fetch_command.startswith("dvc repro train_detector_"):
        assert (ROOT / file).is_file()
        detection.create(section.kind, weights=ROOT / file, **section.options)
    else:
        assert file.parent == DETECTOR_WEIGHTS
        row = next(row for row in TABLE.values() if row.detector == section.kind)
        assert file.stem == Path(row.file).stem and file.suffix == ".onnx"
        assert "camera-monitor weights get" in section.fetch_command
    with pytest.raises(InputError, match="no such (model|weight) file"):
        detection.create(section.kind, **{**section.options, "weights": "absent"})


@pytest.mark.shared
def test_the_reference_file_is_the_one_in_the_table(shared: Path) -> None:
    path = shared / "weights" / "yolox_nano.onnx"
    if not path.is_file():
        pytest.skip("reference data absent: ../shared/weights/yolox_nano.onnx")
    row = TABLE["yolox_nano_reexport"]
    assert (file_sha256(path), path.stat().st_size) == (row.sha256, row.size_bytes)
