"""The compact detectors: samples, networks, training, weight files, detections."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
import torch

from pipeline import detection, store
from pipeline.detection.compact import one_stage, samples, training, trunk, two_stage
from pipeline.detection.compact.detector import Compact
from pipeline.detection.settings import CropRecipe, DetectorTraining
from pipeline.detection.sim_frames import SimFrames, fingerprint, sim_frames
from pipeline.errors import InputError
from pipeline.learning.initial import initialise
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import Schedule
from pipeline.streams import stream

NETWORKS = training.NETWORKS.names()
SIZE = (96, 128)


def frame(number: int) -> tuple[np.ndarray, list[dict]]:
    """A dark frame with one bright upright and one bright lying rectangle."""
    generator = np.random.default_rng(number)
    image = generator.integers(20, 60, SIZE).astype(np.uint8)
    x, y = generator.integers(4, 40, 2)
    image[y : y + 40, x : x + 16] = 220
    image[60:90, 70:120] = 160
    rows = [
        {"box": [int(x), int(y), int(x) + 16, int(y) + 40], "label": "person", "visible_fraction": 1.0},
        {"box": [70, 60, 120, 90], "label": "car", "visible_fraction": 1.0},
    ]
    return image, rows


def settings(steps: int = 6, **changes) -> DetectorTraining:
    schedule = Schedule(steps, 2e-3, warm_up=2, checkpoint_every=2, report_every=2, ema_decay=0.9)
    recipe = CropRecipe(size_px=96, count=2, scale=(0.9, 1.2))
    values = {
        "frames": 3,
        "validation_frames": 1,
        "rays": 1,
        "width_px": SIZE[1],
        "height_px": SIZE[0],
        "replay_window": 4,
    }
    return DetectorTraining(schedule=schedule, recipe=recipe, **{**values, **changes})


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    """A cache in which the frames lie already, so that nothing is rendered."""
    folder = tmp_path / f"sim-{fingerprint()}-1-1-{SIZE[1]}x{SIZE[0]}"
    for number in range(4):
        image, rows = frame(number)
        store.write_image(folder / f"{number:05d}.png", image)
        store.write_json(folder / f"{number:05d}.json", {"boxes": rows})
    return tmp_path


def weight_file(folder: Path, name: str, seed: int = 3) -> Path:
    from pipeline.learning import weights

    model = training.NETWORKS.create(name)
    initialise(model, seed, name)
    path = folder / f"{name}.safetensors"
    weights.save(path, model.state_dict(), training.program(name).ARCHITECTURE)
    return path


@pytest.mark.parametrize("seed", range(8))
def test_boxes_follow_the_picture(seed: int) -> None:
    image = np.full((200, 240), 114, np.uint8)  # like what lies outside of a frame
    image[60:120, 80:110] = 255
    frames = SimFrames(
        image[None], [np.array([[80, 60, 110, 120]], np.float32)], [np.array(["person"])], [np.ones(1, np.float32)]
    )
    generator = np.random.default_rng(seed)
    recipe = CropRecipe(size_px=160, count=1, scale=(0.5, 1.8), at_object=1.0)
    cut, box, kind = samples.crop(frames, generator, recipe)
    assert (kind >= 0).sum() + (kind == samples.IGNORED).sum() == 1
    rows, columns = np.nonzero(cut > 0.5 * (int(cut.max()) + int(cut.min())))
    assert box[0] == pytest.approx([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1], abs=1.5)


def test_small_and_hidden_objects_are_neither_wanted_nor_wrong() -> None:
    boxes = np.array([[10, 10, 60, 60], [100, 10, 110, 18], [10, 100, 60, 160]], np.float32)
    frames = SimFrames(
        np.zeros((1, 200, 200), np.uint8),
        [boxes],
        [np.array(["car", "car", "bicycle"])],
        [np.array([1.0, 1.0, 0.1], np.float32)],
    )
    recipe = CropRecipe(size_px=192, count=1, scale=(0.96, 0.9601), at_object=0.0)
    _, placed, kind = samples.crop(frames, np.random.default_rng(0), recipe)
    assert [int(one) for one in kind[:3]] == [samples.IGNORED, 0, samples.IGNORED]  # largest first: the bicycle
    assert (kind[3:] == samples.ABSENT).all()
    assert (placed[:3] >= 0).all()
    assert (placed <= 192).all()


@pytest.mark.parametrize("shape", [(2, 3, 24, 28), (1, 1, 1, 7), (1, 2, 3, 1)])
def test_context_at_inference_is_that_of_training(shape: tuple[int, ...]) -> None:
    maps = torch.from_numpy(stream(5, "maxima").normal(size=shape).astype(np.float32))
    expected = torch.nn.functional.max_pool2d(maps, 5, 1, 2)
    assert torch.equal(trunk._largest(maps), expected)
    network = trunk.Context(shape[1] * 2)
    network.before = network.after = torch.nn.Identity()
    assert torch.equal(network.train()(maps), network.eval()(maps))


def test_regions_are_read_where_they_are() -> None:
    """On a map that holds each cell's own position, RoIAlign gives the positions of a region's parts."""
    maps = []
    for stride in (8, 16, 32):
        rows, columns = torch.meshgrid(torch.arange(256 // stride), torch.arange(256 // stride), indexing="ij")
        position = torch.stack([columns + 0.5, rows + 0.5]).float() * stride
        maps.append(torch.cat([position, torch.zeros(62, *rows.shape)])[None])
    regions = torch.tensor([[[40.0, 56.0, 82.0, 98.0], [32.0, 48.0, 158.0, 160.0], [30.0, 30.0, 220.0, 226.0]]])
    seen = two_stage.pooled(maps, regions)[0]
    for region, values in zip(regions[0], seen, strict=True):
        x = region[0] + (torch.arange(7) + 0.5) / 7 * (region[2] - region[0])
        y = region[1] + (torch.arange(7) + 0.5) / 7 * (region[3] - region[1])
        assert torch.allclose(values[0], x.expand(7, 7), atol=1e-2)
        assert torch.allclose(values[1], y[:, None].expand(7, 7), atol=1e-2)


def test_proposals_are_the_best_and_apart() -> None:
    model = two_stage.TwoStage()
    initialise(model, 1, "test")
    result = model.eval()(torch.rand(2, 1, 96, 128, generator=torch.Generator().manual_seed(1)))
    regions, score = two_stage.proposals(result, 12)
    assert regions.shape == (2, 12, 4)
    assert float(score[0, 0]) == pytest.approx(float(result.logit[0].detach().sigmoid().max()))
    from pipeline.detection.compact.boxes import overlap

    kept = overlap(regions[0], regions[0])[:4, :4] - torch.eye(4)
    assert float(kept.max()) <= 0.7 + 1e-6


@pytest.mark.parametrize("name", NETWORKS)
def test_training_learns_and_goes_on_bit_for_bit(cache: Path, tmp_path: Path, name: str) -> None:
    whole = training.train(name, settings(), RunOptions(cache, tmp_path / "whole"))
    training.train(name, settings(), RunOptions(cache, tmp_path / "cut", stop_after=3))
    resumed = training.train(name, settings(), RunOptions(cache, tmp_path / "cut"))
    assert whole.curve[-1]["loss"] < 0.95 * whole.curve[0]["loss"]
    for key, value in whole.model.state_dict().items():
        assert torch.equal(value, resumed.model.state_dict()[key]), key
    training.save(tmp_path / "weights.safetensors", name, whole, settings())
    training.save(tmp_path / "again.safetensors", name, resumed, settings())
    assert (tmp_path / "weights.safetensors").read_bytes() == (tmp_path / "again.safetensors").read_bytes()
    detector = detection.create(name, weights=tmp_path / "weights.safetensors")
    assert len(detector.detect([frame(0)[0].astype(np.float32) / 255])) == 1


def test_training_frames_and_validation_frames_are_different_places(cache: Path) -> None:
    wanted = settings()
    held_back = sim_frames(**training.frame_source(wanted, cache, validation=True))
    trained_on = sim_frames(**training.frame_source(wanted, cache))
    assert len(trained_on) == 3
    assert len(held_back) == 1
    assert not any(np.array_equal(held_back.images[0], image) for image in trained_on.images)


def test_a_broken_picture_in_the_cache_is_named(cache: Path) -> None:
    path = next(cache.rglob("00001.png"))
    path.write_bytes(path.read_bytes()[:30])
    with pytest.raises(InputError, match="00001.png: not a readable picture; delete it"):
        sim_frames(**training.frame_source(settings(), cache))


@pytest.mark.full("rendering three times takes 14 s")
def test_a_frame_is_rendered_once_and_is_the_same_again(tmp_path: Path) -> None:
    options = {"seed": 1, "samples": 1, "width_px": 64, "height_px": 64}
    one = sim_frames(1, cache=tmp_path / "one", first=2, **options)
    path = next((tmp_path / "one").rglob("*.png"))
    before = path.stat().st_mtime_ns
    sim_frames(1, cache=tmp_path / "one", first=2, **options)
    assert path.stat().st_mtime_ns == before
    path.with_suffix(".json").unlink()  # the advice where it is broken
    again = sim_frames(1, cache=tmp_path / "one", first=2, **options)
    assert np.array_equal(one.images, again.images) and np.array_equal(one.boxes[0], again.boxes[0])
    other = sim_frames(1, cache=tmp_path / "other", first=2, **options)
    assert np.array_equal(one.images, other.images)
    assert one.images.std() > 5


@pytest.mark.parametrize("name", NETWORKS)
def test_detections_are_inside_sorted_and_apart(tmp_path: Path, name: str) -> None:
    detector = detection.create(name, weights=weight_file(tmp_path, name), score_floor=0.0, max_detections=20)
    image = np.random.default_rng(0).random((75, 101)).astype(np.float32)
    selected = detector.detect([image])[0]
    assert 1 <= len(selected) <= 20
    assert (np.diff(selected.score) <= 0).all()
    assert (selected.boxes >= 0).all()
    assert (selected.boxes <= [101, 75, 101, 75]).all()
    again = pickle.loads(pickle.dumps(detector)).detect([image])[0]
    assert np.array_equal(selected.boxes, again.boxes)
    assert len(detection.create(name, weights=weight_file(tmp_path, name), score_floor=1.0).detect([image])[0]) == 0


def test_scale_sees_a_larger_picture_and_answers_in_its_own_pixels(tmp_path: Path) -> None:
    import cv2

    path = weight_file(tmp_path, "compact")
    image = np.random.default_rng(0).random((64, 96)).astype(np.float32)
    large = cv2.resize(image, (192, 128), interpolation=cv2.INTER_LINEAR)
    selected = Compact(path, scale=2.0, score_floor=0.0, max_detections=5).detect([image])[0]
    expected = Compact(path, score_floor=0.0, max_detections=5).detect([large])[0]
    assert selected.boxes == pytest.approx(expected.boxes / 2, abs=1e-3)


def test_bad_files_and_options_are_refused(tmp_path: Path) -> None:
    path = weight_file(tmp_path, "compact")
    with pytest.raises(InputError, match="expected 'detector-compact-two-stage-1'"):
        detection.create("compact_two_stage", weights=path)
    cut = tmp_path / "cut.safetensors"
    cut.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match="cut.safetensors"):
        detection.create("compact", weights=cut)
    with pytest.raises(InputError, match="no such weight file"):
        detection.create("compact", weights=tmp_path / "none.safetensors")
    for key, value in {"score_floor": 2, "iou_threshold": -1, "max_detections": 0, "scale": 0}.items():
        with pytest.raises(InputError, match=key):
            detection.create("compact", weights=path, **{key: value})


def test_parameters_of_the_networks() -> None:
    counts = [sum(p.numel() for p in model.parameters()) for model in (one_stage.OneStage(), two_stage.TwoStage())]
    assert counts == [1_191_893, 1_832_407]
