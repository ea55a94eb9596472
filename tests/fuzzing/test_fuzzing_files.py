"""Readers of pictures, videos, labels, stored results and weights raise nothing but the declared error.

The suite takes a small, repeatable sample. ``HYPOTHESIS_PROFILE=fuzz`` draws thousands anew.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import re
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from control_makers import performance
from data_makers import picture
from hypothesis import given
from hypothesis import strategies as st
from mutations import ARRAYS, JSON, LINES, archive, damaged, replaced
from PIL import Image

from pipeline.blur.camera_calibration import Calibration
from pipeline.blur.fusion.camera import FusionMap
from pipeline.camera.processing.codec import VIDEO, video_file
from pipeline.camera.psf.paper_kernels import read_psf
from pipeline.cli.calibration import camera_store
from pipeline.cli.commands.report import metrics
from pipeline.cli.frames.shot_settings import exif
from pipeline.control.performance import Performance
from pipeline.curves import Surface
from pipeline.datasets.decoding.pictures import read_picture
from pipeline.datasets.decoding.video import read_video
from pipeline.datasets.folder import read_box_labels
from pipeline.datasets.kitti import read_kitti_labels
from pipeline.datasets.sim import Sim
from pipeline.datasets.udacity import read_autti_labels, read_crowdai_labels
from pipeline.datasets.whitelist import read_whitelist
from pipeline.detection.onnx_model import OnnxModel
from pipeline.errors import InputError
from pipeline.learning import weights
from pipeline.store import read_arrays, read_json, read_published, read_table
from pipeline.tables import QUARANTINE

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(tempfile.mkdtemp(prefix="fuzzing-"))


@pytest.fixture(scope="module", autouse=True)
def _removed_at_the_end():
    yield
    import shutil

    shutil.rmtree(FOLDER, ignore_errors=True)


def attempt(read: Callable[[Path], object], name: str, content: bytes) -> None:
    """Read a file of this content; anything but an `InputError` of one line goes on to the test."""
    path = FOLDER / name
    path.write_bytes(content)
    with contextlib.suppress(InputError):
        try:
            read(path)
        except InputError as error:
            assert not re.search(r"[\r\n]", str(error)) and name in str(error), str(error)
            raise


def encoded(suffix: str, image: np.ndarray) -> bytes:
    done, content = cv2.imencode(suffix, image)
    assert done
    return content.tobytes()


def saved(image: Image.Image, kind: str, **options: object) -> bytes:
    path = FOLDER / "saved"
    image.save(path, kind, **options)
    return path.read_bytes()


GREY = picture("fuzzing", 40, 32)
COLOUR = cv2.cvtColor(GREY, cv2.COLOR_GRAY2BGR)
PICTURES = {
    "a.png": encoded(".png", GREY),
    "deep.png": encoded(".png", COLOUR.astype(np.uint16) * 257),
    "palette.png": saved(Image.fromarray(GREY).convert("P"), "PNG"),
    "interlaced.png": saved(Image.fromarray(GREY), "PNG", interlace=1),
    "a.jpg": encoded(".jpg", COLOUR),
    "a.tif": encoded(".tif", GREY),
    "float.tif": saved(Image.fromarray(GREY.astype(np.float32) / 255), "TIFF"),
    "a.bmp": encoded(".bmp", COLOUR),
    "a.webp": encoded(".webp", COLOUR),
    "a.pgm": encoded(".pgm", GREY),
    "cmyk.tif": saved(Image.fromarray(COLOUR).convert("CMYK"), "TIFF"),
}


@pytest.mark.parametrize("name", PICTURES)
@given(data=st.data())
def test_pictures(name, data):
    content = data.draw(damaged(PICTURES[name]))
    attempt(lambda path: read_picture(path).unit(), name, content)
    attempt(lambda path: read_psf(path), name, content)


@given(data=st.data())
def test_exif_data(data):
    tags = Image.Exif()
    tags.get_ifd(0x8769)[33434] = 0.008
    tags.get_ifd(0x8769)[34855] = 400
    attempt(exif, "exif.jpg", data.draw(damaged(saved(Image.fromarray(GREY), "JPEG", exif=tags))))


@cache
def _film(suffix: str, code: str) -> bytes:
    if code in VIDEO:  # x265 aborts on smaller pictures
        larger = np.repeat(picture("fuzzing", 128, 128)[..., None], 3, axis=2)
        return video_file([np.roll(larger, number, axis=1) for number in range(3)], code, 30)
    path = FOLDER / f"film{suffix}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 10, (40, 32))
    for number in range(3):
        writer.write(np.roll(COLOUR, number, axis=1))
    writer.release()
    return path.read_bytes()


@pytest.mark.parametrize(
    ("suffix", "code"), [(".avi", "MJPG"), (".mp4", "mp4v"), (".mkv", "hevc"), (".mkv", "h264"), (".webm", "vp9")]
)
@given(data=st.data())
def test_videos(suffix, code, data):
    content = data.draw(damaged(_film(suffix, code)))
    attempt(lambda path: list(itertools.islice(read_video(path), 20)), f"v{suffix}", content)


LABELS = {
    "folder": read_box_labels,
    "kitti": read_kitti_labels,
    "autti": read_autti_labels,
    "crowdai": read_crowdai_labels,
    "whitelist": read_whitelist,
}
LABEL_LINES = [
    "car 1 2 30 40 difficult",
    "Car 0.00 0 1.55 60.00 120.00 170.00 190.00 1.5 1.6 3.9 1.0 1.7 20.0 0.1",
    'a.jpg 1 2 30 40 0 "car" ""',
    "1,2,30,40,a.jpg,Car,http://example.org",
]


@pytest.mark.parametrize("kind", LABELS)
@given(
    content=st.one_of(
        LINES.map(lambda text: text.encode("utf-8", "surrogatepass")),
        st.sampled_from(LABEL_LINES).flatmap(lambda line: damaged(line.encode())),
        st.binary(max_size=60),
    )
)
def test_labels(kind, content):
    attempt(LABELS[kind], "labels.txt", content)


BOX = {"label": "car", "box": [1, 2, 30, 40], "visible_fraction": 0.9}


@given(content=st.one_of(replaced({"boxes": [BOX, BOX]}), JSON))
def test_labels_of_sim(content):
    sim = object.__new__(Sim)
    sim.min_height_px, sim.min_visible_fraction = 20.0, 0.3
    for name in ("min_height_px", "min_visible_fraction"):
        setattr(sim, name, 0.3)
    attempt(sim._boxes, "labels.json", json.dumps(content).encode())


CAMERA = {
    "name": "fuzzed", "kind": "sharp frames", "blur_estimator": "spectral", "weights_sha256": {}, "size_px": [208, 224],
    "frames": 3, "sharp_mtf": [[0.9] * 8, [0.8] * 8], "fit": None, "version": "0",
}  # fmt: skip
CALIBRATION = {
    "matrix": np.eye(16).tolist(), "offset": [0.0] * 16, "samples": 9, "widening": 1.0, "error_percent": [3.0, 2.0]
}  # fmt: skip


@given(content=st.one_of(replaced(CAMERA), replaced({**CAMERA, "sharp_mtf": None, "fit": CALIBRATION}), JSON))
def test_stored_cameras(content):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CAMERA_MONITOR_HOME", str(FOLDER))
        (FOLDER / "cameras").mkdir(exist_ok=True)
        attempt(lambda path: camera_store.load("fuzzed"), "cameras/fuzzed.json", json.dumps(content).encode())


@given(content=st.one_of(replaced(CALIBRATION), JSON))
def test_stored_calibrations(content):
    attempt(Calibration.load, "calibration.json", json.dumps(content).encode())
    attempt(
        FusionMap.load, "fused.json",
        json.dumps({"spectral": content, "gbb_sharp_mtf": [[0.9] * 8] * 2}).encode(),
    )  # fmt: skip


@given(content=st.one_of(JSON.map(lambda value: json.dumps(value).encode()), st.binary(max_size=60)))
def test_metrics(content):
    attempt(metrics, "metrics.json", content)
    attempt(read_json, "content.json", content)


def _surfaces() -> dict[str, bytes]:
    performance().save(FOLDER / "surface.npz")
    content = dict(np.load(FOLDER / "surface.npz"))
    cells = {name.removeprefix("cells_"): values for name, values in content.items() if name.startswith("cells_")}
    return {"control.npz": archive(content), "curves.npz": archive(cells)}


SURFACES = _surfaces()
READERS = {"control.npz": Performance.load, "curves.npz": Surface.load}


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
def test_surfaces(name, data):
    content = _arrays(SURFACES[name])
    if data.draw(st.booleans()):
        attempt(READERS[name], name, data.draw(damaged(SURFACES[name])))
        return
    for key in data.draw(st.lists(st.sampled_from(sorted(content)), min_size=1, max_size=2)):
        values = content[key]
        content[key] = data.draw(
            st.one_of(
                ARRAYS,
                st.sampled_from([np.nan, np.inf, -1.0, 0.0, 1e300]).map(
                    lambda value, of=values: np.full(of.shape, value)
                ),
                st.just(values[..., ::-1] if values.ndim else values),
            )
        )
    attempt(READERS[name], name, archive(content))


def _arrays(content: bytes) -> dict[str, np.ndarray]:
    path = FOLDER / "whole.npz"
    path.write_bytes(content)
    return read_arrays(path)


@given(data=st.data())
def test_weights(data):
    import torch

    path = FOLDER / "whole.safetensors"
    weights.save(path, {"a": torch.ones(3, 4), "b": torch.zeros(2)}, "fuzz-1", released=True)
    content = data.draw(damaged(path.read_bytes()))
    attempt(lambda file: weights.load(file, "fuzz-1"), "weights.safetensors", content)
    attempt(lambda file: weights.is_released(file, weights.details(file)), "weights.safetensors", content)


@given(data=st.data())
def test_tables(data):
    import pandas as pd

    path = FOLDER / "whole.parquet"
    pd.DataFrame({"dataset": ["a"], "file": ["b"], "reason": ["c"]}).to_parquet(path)
    attempt(lambda file: read_table(file, QUARANTINE), "table.parquet", data.draw(damaged(path.read_bytes())))
    attempt(
        lambda file: read_published(file, {"name": str, "value": float}), "published.csv",
        data.draw(st.one_of(damaged(b"name,value\nx,1.5\n"), LINES.map(lambda text: text.encode(errors="ignore")))),
    )  # fmt: skip


@given(data=st.data())
def test_networks(data):
    onnx = pytest.importorskip("onnx", reason="the extra dev, whose onnx makes the network that is damaged")
    helper = onnx.helper
    info = helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [1, 1, 8, 8])
    out = helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, [1, 1, 8, 8])
    graph = helper.make_graph([helper.make_node("Relu", ["x"], ["y"])], "g", [info], [out])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    attempt(OnnxModel, "network.onnx", data.draw(damaged(model.SerializeToString())))
