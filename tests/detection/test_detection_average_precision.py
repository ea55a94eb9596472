"""Average precision: published digits, an independent writing of the paper's rules, two peers, and hand-made cases."""

from __future__ import annotations

import contextlib
import io
import math
import re
from pathlib import Path

import numpy as np
import pytest
from control_makers import judged_with
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.detection.average_precision import class_mean, evaluate, mean_average_precision, mean_over_classes
from pipeline.detection.base import Detections
from pipeline.detection.matching import GroundTruth
from pipeline.errors import InputError
from pipeline.streams import stream

Case = tuple[list[Detections], list[GroundTruth]]


def truth(*entries: tuple[str, float, float, float, float, bool]) -> GroundTruth:
    return GroundTruth(
        np.array([entry[1:5] for entry in entries], dtype=float).reshape(-1, 4),
        np.array([entry[0] for entry in entries], dtype=np.str_),
        np.array([entry[5] for entry in entries], dtype=bool),
    )


def found(*entries: tuple[str, float, float, float, float, float]) -> Detections:
    return Detections.of([e[2:] for e in entries], [e[1] for e in entries], [e[0] for e in entries])


@st.composite
def scenes(draw: st.DrawFn, ignored: bool = True) -> Case:
    """A few images with objects of two classes, some ignored, and detections on, beside and away from them.

    Corners are whole pixels and some scores are equal, so that ties occur.
    """
    numbers = np.random.Generator(np.random.Philox(draw(st.integers(0, 2**32))))
    detections, truths = [], []
    for _ in range(draw(st.integers(1, 5))):
        objects, claims = [], []
        for _ in range(draw(st.integers(0, 5))):
            x, y = numbers.integers(0, 60, 2)
            w, h = numbers.integers(8, 40, 2)
            label = "car" if numbers.random() < 0.7 else "person"
            objects.append((label, x, y, x + w, y + h, bool(ignored and numbers.random() < 0.3)))
            for _ in range(numbers.integers(0, 4)):
                dx, dy, dw, dh = numbers.integers(-8, 9, 4)
                score = round(float(numbers.random()), 2)
                metadata = label if numbers.random() < 0.9 else "car"
                claims.append((metadata, score, x + dx, y + dy, x + dx + max(3, w + dw), y + dy + max(3, h + dh)))
        for _ in range(draw(st.integers(0, 3))):
            x, y = numbers.integers(0, 90, 2)
            claims.append(("car", round(float(numbers.random()), 2), x, y, x + 12, y + 9))
        detections.append(found(*claims))
        truths.append(truth(*objects))
    return detections, truths


def cartucho(detections: list[Detections], truths: list[GroundTruth], label: str) -> float:
    """The paper's rules from their description, one detection after another (no ignored regions but 'difficult')."""
    claims = [
        (score, image, box)
        for image, entry in enumerate(detections)
        for score, box, word in zip(entry.score, entry.boxes, entry.label, strict=True)
        if word == label
    ]
    claims.sort(key=lambda claim: claim[0], reverse=True)
    used: set[tuple[int, int]] = set()
    hits = []
    for _, image, box in claims:
        best, owner = -1.0, -1
        for index, (other, word) in enumerate(zip(truths[image].boxes, truths[image].label, strict=True)):
            if word != label:
                continue
            w = min(box[2], other[2]) - max(box[0], other[0]) + 1
            h = min(box[3], other[3]) - max(box[1], other[1]) + 1
            if w > 0 and h > 0:
                union = (
                    (box[2] - box[0] + 1) * (box[3] - box[1] + 1)
                    + (other[2] - other[0] + 1) * (other[3] - other[1] + 1)
                    - w * h
                )
                if w * h / union > best:
                    best, owner = w * h / union, index
        right = best >= 0.5 and (image, owner) not in used
        if right:
            used.add((image, owner))
        hits.append(right)
    objects = sum(int(np.count_nonzero(entry.label == label)) for entry in truths)
    if objects == 0:
        return math.nan
    recall, precision, right = [0.0], [0.0], 0
    for count, hit in enumerate(hits, 1):
        right += hit
        recall.append(right / objects)
        precision.append(right / count)
    recall.append(1.0)
    precision.append(0.0)
    for index in range(len(precision) - 2, -1, -1):
        precision[index] = max(precision[index], precision[index + 1])
    return sum((recall[i] - recall[i - 1]) * precision[i] for i in range(1, len(recall)) if recall[i] != recall[i - 1])


@given(case=scenes(ignored=False))
def test_equals_the_papers_rules_written_out(case: Case) -> None:
    results = evaluate(*case, labels=["car", "person"])
    for label, result in results.items():
        np.testing.assert_allclose(result.average_precision, cartucho(*case, label), atol=1e-12)


def coco_peer(case: Case, label: str, package: str) -> float:
    """AP at intersection over union 0.5 by pycocotools or faster-coco-eval; ignored objects are its crowds."""
    if package == "pycocotools":
        coco_module = pytest.importorskip("pycocotools.coco")
        evaluator = pytest.importorskip("pycocotools.cocoeval").COCOeval
        coco_class = coco_module.COCO
    else:
        peer = pytest.importorskip("faster_coco_eval")
        evaluator, coco_class = peer.COCOeval_faster, peer.COCO
    detections, truths = case
    boxes, answers = [], []
    for image, (entry, wanted) in enumerate(zip(detections, truths, strict=True), 1):
        for box, word, ignore in zip(wanted.boxes, wanted.label, wanted.ignore, strict=True):
            if word == label:
                x, y, w, h = (float(v) for v in (*box[:2], *(box[2:] - box[:2])))
                boxes.append(
                    {"id": len(boxes) + 1, "image_id": image, "category_id": 1, "bbox": [x, y, w, h], "area": w * h}
                    | {"iscrowd": int(ignore), "ignore": int(ignore)}
                )
        for box, score, word in zip(entry.boxes, entry.score, entry.label, strict=True):
            if word == label:
                size = [float(v) for v in (*box[:2], *(box[2:] - box[:2]))]
                answers.append({"image_id": image, "category_id": 1, "bbox": size, "score": float(score)})
    if not answers:
        return math.nan if not any(not entry["iscrowd"] for entry in boxes) else 0.0
    images = [{"id": index + 1, "width": 200, "height": 200} for index in range(len(truths))]
    with contextlib.redirect_stdout(io.StringIO()):
        base = coco_class()
        base.dataset = {"images": images, "annotations": boxes, "categories": [{"id": 1, "name": label}], "info": {}}
        base.createIndex()
        run = evaluator(base, base.loadRes(answers), iouType="bbox")
        run.params.iouThrs = np.array([0.5])
        run.evaluate()
        run.accumulate()
    precision = run.eval["precision"][0, :, 0, 0, -1]
    return math.nan if (precision == -1).any() else float(precision.mean())


@pytest.mark.parametrize("package", ["pycocotools", "faster_coco_eval"])
@settings(max_examples=25)
@given(case=scenes())
def test_coco_rule_equals_peers(package: str, case: Case) -> None:
    results = evaluate(*case, labels=["car", "person"], rule="coco")
    for label, result in results.items():
        np.testing.assert_allclose(result.average_precision, coco_peer(case, label, package), atol=1e-6)


@pytest.mark.parametrize("package", ["pycocotools", "faster_coco_eval"])
def test_coco_rule_breaks_ties_as_peers_do(package: str) -> None:
    """The first detection overlaps both objects alike; only if it leaves the second one is the other right."""
    truths = [truth(("car", 0, 0, 10, 10, False), ("car", 4, 0, 14, 10, False))]
    case = [found(("car", 0.9, 2, 0, 12, 10), ("car", 0.8, 7, 0, 17, 10))], truths
    ours = evaluate(*case, rule="coco")["car"].average_precision
    assert ours == pytest.approx(coco_peer(case, "car", package), abs=1e-6)
    assert ours < 0.6


def read_detections(path: Path) -> Detections:
    """Detections of an image as Cartucho's mAP program reads them, ``class score x1 y1 x2 y2`` a line."""
    rows = [line.split() for line in path.read_text().splitlines() if line.strip()]
    numbers = [[float(word) for word in row[1:]] for row in rows]
    return Detections.of([row[1:] for row in numbers], [row[0] for row in numbers], [row[0] for row in rows])


@pytest.mark.shared
@pytest.mark.parametrize(
    ("detector", "percent", "right", "wrong"),
    [("faster-RCNN", "32.44", 12, 11), ("YOLOv4", "10.42", 5, 3)],
)
def test_published_detections_give_the_published_digits(
    shared: Path, detector: str, percent: str, right: int, wrong: int
) -> None:
    folder = shared / "vectors" / "detection"
    names = sorted(path.name for path in (folder / "GT").glob("*.txt"))
    truths = []
    for name in names:
        rows = [line.split() for line in (folder / "GT" / name).read_text().splitlines() if line.strip()]
        truths.append(truth(*[(row[0], *map(float, row[1:5]), False) for row in rows]))  # type: ignore[arg-type]
    detections = [read_detections(folder / detector / "GT" / name) for name in names]
    results = evaluate(detections, truths, generator=stream(0, "bootstrap"))
    assert list(results) == ["car"]
    car = results["car"]
    assert f"{100 * car.average_precision:.2f}" == percent
    assert (car.objects, car.true_positives, car.false_positives, car.images) == (30, right, wrong, 10)
    assert car.low < car.average_precision < car.high
    assert mean_average_precision(results.values()) == car.average_precision
    if detector == "faster-RCNN":
        stored = (folder / "faster_rcnn_map_output.txt").read_text()
        for word, ours in (("Precision", car.precision), ("Recall", car.recall)):
            line = next(line for line in stored.splitlines() if line.strip().startswith(word))
            assert [f"{value:.2f}" for value in ours] == re.findall(r"\d\.\d\d", line)


def test_hand_made_curve() -> None:
    """Right, wrong, right of three objects: precision 1, 1/2, 2/3 at recall 1/3, 1/3, 2/3."""
    truths = [truth(("car", 0, 0, 10, 10, False), ("car", 50, 0, 60, 10, False), ("car", 0, 50, 10, 60, False))]
    claims = [found(("car", 0.9, 0, 0, 10, 10), ("car", 0.8, 90, 90, 99, 99), ("car", 0.7, 50, 0, 60, 10))]
    paper, coco = (evaluate(claims, truths, rule=rule)["car"] for rule in ("paper", "coco"))  # type: ignore[arg-type]
    assert paper.average_precision == pytest.approx(1 / 3 + 2 / 3 / 3)
    assert coco.average_precision == pytest.approx((34 * 1 + 33 * 2 / 3) / 101)
    np.testing.assert_allclose(paper.precision, [1, 1 / 2, 2 / 3])
    np.testing.assert_allclose(paper.recall, [1 / 3, 1 / 3, 2 / 3])


def test_the_second_claim_on_an_object_is_wrong_or_goes_to_a_free_one() -> None:
    """The paper's rule looks at the best object only; COCO's takes the next free one."""
    truths = [truth(("car", 0, 0, 100, 100, False), ("car", 0, 0, 100, 60, False))]
    claims = [found(("car", 0.9, 0, 0, 100, 100), ("car", 0.8, 0, 0, 100, 90))]
    assert evaluate(claims, truths, rule="paper")["car"].true_positives == 1
    assert evaluate(claims, truths, rule="coco")["car"].true_positives == 2


@pytest.mark.parametrize("rule", ["paper", "coco"])
def test_ignored_regions_count_neither_way(rule: str) -> None:
    truths = [
        truth(("car", 0, 0, 20, 20, False), ("car", 100, 100, 200, 200, True), ("car", 300, 0, 320, 20, True)),
    ]
    claims = [
        found(
            ("car", 0.95, 0, 0, 20, 20),
            ("car", 0.9, 110, 110, 130, 130),  # small, wholly in the region
            ("car", 0.8, 92, 150, 108, 160),  # half of it inside
            ("car", 0.7, 88, 150, 106, 160),  # a third of it inside
            ("car", 0.6, 301, 0, 321, 20),  # an ignored object
        )
    ]
    result = evaluate(claims, truths, rule=rule)["car"]  # type: ignore[arg-type]
    assert (result.true_positives, result.false_positives, result.ignored) == (1, 1, 3)
    assert (result.objects, result.objects_ignored, result.detections) == (1, 2, 5)
    assert result.average_precision == 1.0


def test_coco_counts_the_100_best_of_each_class_and_the_papers_rules_all() -> None:
    """Behind 120 wrong cars the person is the first of its class; the right car is past the hundredth of its own."""
    wrong = [("car", 0.9 - i / 1000, 0, 200 + 9 * i, 5, 205 + 9 * i) for i in range(120)]
    claims = found(*wrong, ("car", 0.5, 0, 0, 50, 50), ("person", 0.4, 60, 0, 80, 60))
    truths = [truth(("car", 0, 0, 50, 50, False), ("person", 60, 0, 80, 60, False))]
    paper, coco = (evaluate([claims], truths, rule=rule) for rule in ("paper", "coco"))
    assert [paper[label].detections for label in ("car", "person")] == [121, 1]
    assert [coco[label].detections for label in ("car", "person")] == [100, 1]
    assert paper["car"].average_precision == pytest.approx(1 / 121) and coco["car"].average_precision == 0
    assert paper["person"].average_precision == coco["person"].average_precision == 1


def test_a_class_without_objects_is_nan_with_a_count() -> None:
    claims = [found(("car", 0.9, 0, 0, 10, 10)), Detections.none()]
    truths = [truth(), truth(("car", 0, 0, 10, 10, True))]
    result = evaluate(claims, truths, ["car", "person"], generator=stream(0, "bootstrap"))
    assert np.isnan([result["car"].average_precision, result["car"].low, result["person"].high]).all()
    assert (result["car"].objects, result["car"].objects_ignored, result["car"].false_positives) == (0, 1, 1)
    assert np.isnan(result["car"].recall).all()
    assert np.isnan(mean_average_precision(result.values()))
    assert evaluate([], [], ["car"])["car"].images == 0


def test_a_mean_over_classes_leaves_out_those_without_objects() -> None:
    """A car in each of four images, found in all but one; a person in one of them, found; no truck."""
    cars, claims = [("car", 0, 0, 10, 10, False)], [("car", 0.9, 0, 0, 10, 10)]
    truths = [truth(*cars, ("person", 50, 0, 60, 10, False)), *(truth(*cars) for _ in range(3))]
    detections = [found(*claims, ("person", 0.8, 50, 0, 60, 10)), found(*claims), found(*claims), Detections.none()]

    def judged(labels: list[str]):
        return [
            evaluate(detections, truths, [label], generator=stream(0, "bootstrap"), draws=200)[label]
            for label in labels
        ]

    car, person, _ = classes = judged(["car", "person", "truck"])
    mean = mean_over_classes(classes)
    assert mean.ap_percent == pytest.approx(100 * (0.75 + 1) / 2) and (mean.objects, mean.clusters) == (5, 1)
    alone = np.isnan(person.draws)  # resamples without the person: the cars' alone
    assert alone.any() and not alone.all() and not np.isnan(mean.draws).any()
    np.testing.assert_allclose(mean.draws[alone], 100 * car.draws[alone])
    np.testing.assert_allclose(mean.draws[~alone], 50 * (car.draws + person.draws)[~alone])
    none = mean_over_classes(judged(["truck"]))
    assert np.isnan(none.ap_percent) and np.isnan(none.draws).all() and (none.objects, none.clusters) == (0, 0)


def test_a_mean_over_classes_of_different_resamples_is_refused() -> None:
    """Two classes alike in all: resampled alike their mean has the draws of either; one after the other it is none."""
    boxes = [("car", 0, 0, 10, 10, False), ("person", 0, 0, 10, 10, False)]
    hits = [("car", 0.9, 0, 0, 10, 10), ("person", 0.9, 0, 0, 10, 10)]
    truths, detections = [truth(*boxes)] * 8, [found(*hits)] * 4 + [Detections.none()] * 4
    each = [
        evaluate(detections, truths, [label], generator=stream(0, "bootstrap"))[label] for label in ("car", "person")
    ]
    np.testing.assert_allclose(mean_over_classes(each).draws, 100 * each[0].draws)
    in_turn = evaluate(detections, truths, ["car", "person"], generator=stream(0, "bootstrap"))
    assert not np.array_equal(in_turn["car"].draws, in_turn["person"].draws)
    with pytest.raises(InputError, match=r"mean over classes \(car, person\): .* a generator of its own"):
        mean_over_classes(in_turn.values())
    assert mean_over_classes(evaluate(detections, truths).values()).ap_percent == 50.0  # no draws, nothing to compare


def test_objects_without_detections_are_zero() -> None:
    one, again = truth(("car", 0, 0, 10, 10, False)), stream(0, "bootstrap")
    result = evaluate([Detections.none()] * 2, [one] * 2, generator=again)["car"]
    assert (result.average_precision, result.low, result.high, result.clusters) == (0.0, 0.0, 0.0, 2)


def test_one_group_with_objects_gives_no_interval() -> None:
    hit, one = found(("car", 0.9, 0, 0, 10, 10)), truth(("car", 0, 0, 10, 10, False))
    detections, truths = [hit, hit, Detections.none()], [one, one, truth()]
    result = evaluate(detections, truths, generator=stream(0, "bootstrap"), groups=["a", "a", "b"])["car"]
    assert result.clusters == 1 and result.average_precision == 1.0 and math.isnan(result.low + result.high)


@given(case=scenes(), shift=st.integers(-50, 50))
def test_order_of_images_place_and_score_scale_do_not_matter(case: Case, shift: int) -> None:
    detections, truths = case
    for index, entry in enumerate(detections):  # distinct scores: equal ones are ranked by image order, as in the paper
        numbers = np.arange(len(entry)) + 100 * index
        detections[index] = Detections(entry.boxes, entry.score * 0.5 + numbers * 1e-6, entry.label)
    before = evaluate(detections, truths, ["car"])["car"].average_precision
    moved = [Detections(e.boxes + shift, np.sqrt(e.score), e.label) for e in reversed(detections)]
    there = [GroundTruth(t.boxes + shift, t.label, t.ignore) for t in reversed(truths)]
    np.testing.assert_allclose(evaluate(moved, there, ["car"])["car"].average_precision, before, atol=1e-12)


@given(case=scenes())
def test_more_wrong_detections_never_help_and_bounds_hold(case: Case) -> None:
    detections, truths = case
    before = evaluate(detections, truths, ["car"])["car"]
    extra = [
        Detections.of(np.vstack([entry.boxes, [[900, 900, 950, 950]]]), [*entry.score, 1.0], [*entry.label, "car"])
        for entry in detections
    ]
    after = evaluate(extra, truths, ["car"])["car"]
    assert after.false_positives == before.false_positives + len(detections)
    if before.objects:
        assert 0.0 <= after.average_precision <= before.average_precision <= 1.0
    assert before.true_positives + before.false_positives + before.ignored == before.detections
    assert before.true_positives <= before.objects


def test_interval_shrinks_with_more_images_and_repeats() -> None:
    """Half of the images are found, half are not: the AP is 1/2 with a standard error of 1/2 / sqrt(n)."""
    hit, miss = found(("car", 0.9, 0, 0, 10, 10)), Detections.none()
    one = truth(("car", 0, 0, 10, 10, False))
    widths = []
    for images in (40, 640):
        result = evaluate([hit, miss] * (images // 2), [one] * images, generator=stream(3, "bootstrap"))["car"]
        again = evaluate([hit, miss] * (images // 2), [one] * images, generator=stream(3, "bootstrap"))["car"]
        assert (result.low, result.high) == (again.low, again.high)
        assert result.average_precision == 0.5
        widths.append(result.high - result.low)
        assert widths[-1] == pytest.approx(2 * 1.96 * 0.5 / math.sqrt(images), rel=0.2)
    assert widths[1] < widths[0] / 3


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(InputError, match="1 images, truth for 0"):
        evaluate([Detections.none()], [])
    with pytest.raises(InputError, match="rule"):
        evaluate([], [], rule="voc")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="iou_threshold"):
        evaluate([], [], iou_threshold=0.0)
    with pytest.raises(InputError, match=r"labels: expected a sequence of classes, as \['car'\], not the text 'car'"):
        evaluate([], [], "car")
    with pytest.raises(InputError, match="labels: expected a sequence"):
        class_mean([], [], "car", judged_with(), lambda: stream(0, "bootstrap"), [])
    with pytest.raises(InputError, match="mean over classes: expected at least one class"):
        mean_over_classes([])
    for draws in (0, -1, 2.5):
        with pytest.raises(InputError, match="draws: expected a whole number of at least 1, not"):
            evaluate([], [], generator=stream(0, "bootstrap"), draws=draws)  # type: ignore[arg-type]
