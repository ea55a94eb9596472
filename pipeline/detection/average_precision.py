"""Average precision of one class over many images, with what it rests on.

With detections sorted by score, precision is the share of right ones among those so far, recall the share of objects
found. Average precision is the area under precision as a function of recall, after precision has been made monotone
(the best at this recall or beyond). ``rule="paper"`` takes the whole area; ``rule="coco"`` the mean at 101 recalls
0, 0.01 .. 1. See `pipeline.detection.matching` for what is right.

A class without a single object has no average precision: it is NaN, with a count of 0.

Intervals are those of a bootstrap over scenes (`pipeline.cluster_intervals`), wider where few of them hold an object.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.cluster_intervals import NO_INTERVAL, bias_corrected
from pipeline.detection.base import Detections
from pipeline.detection.matching import (
    COCO_MAX_DETECTIONS,
    FALSE_POSITIVE,
    IGNORED,
    RULES,
    TRUE_POSITIVE,
    GroundTruth,
    Rule,
    match,
)
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.detection.settings import EvaluationSettings

COCO_RECALLS = np.linspace(0.0, 1.0, 101)


@dataclass(frozen=True)
class ClassResult:
    """How well one class was found.

    Attributes:
        label: the class.
        average_precision: in [0, 1]; NaN where there is no object.
        low, high: bootstrap 95 % interval over images or groups of them; NaN where it was not asked for or fewer than
            two of them hold an object.
        images: images looked at.
        clusters: images, or groups of them, that hold an object: what the interval rests on.
        objects: objects to be found.
        objects_ignored: ignored objects and regions of this class.
        detections: all of this class (with ``coco``, the 100 best of each image).
        true_positives, false_positives, ignored: of these.
        score: (right + wrong,) scores, highest first.
        precision, recall: (right + wrong,) after each of these detections; recall is NaN where there is no object.
        draws: (draws,) average precision on resampled images, NaN where a draw holds no object; empty without a
            bootstrap. Equal generators resample the same images, so draws of several conditions belong together.
        resampled_from: state of the generator before them; empty without a bootstrap.
    """

    label: str
    average_precision: float
    low: float
    high: float
    images: int
    clusters: int
    objects: int
    objects_ignored: int
    detections: int
    true_positives: int
    false_positives: int
    ignored: int
    score: NDArray[np.float64]
    precision: NDArray[np.float64]
    recall: NDArray[np.float64]
    draws: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0), repr=False)
    resampled_from: str = field(default="", repr=False)


def evaluate(
    detections: Sequence[Detections],
    truths: Sequence[GroundTruth],
    labels: Iterable[str] | None = None,
    rule: Rule = "paper",
    iou_threshold: float = 0.5,
    generator: np.random.Generator | None = None,
    draws: int = 500,
    groups: Sequence[str] | None = None,
) -> dict[str, ClassResult]:
    """Average precision of each class.

    Args:
        detections: one entry per image.
        truths: one entry per image, in the same order.
        labels: classes to judge; None takes every class that has an object, as the paper's program does.
        rule: ``"paper"`` or ``"coco"``.
        iou_threshold: least intersection over union of a right detection, in (0, 1].
        generator: for the bootstrap over images; None leaves the intervals out. Classes draw from it in turn, so that
            each resamples other images; `class_mean` resamples the same.
        draws: resamples, at least 1; without effect where there is no generator.
        groups: one word per image; images of one group are no independent samples and are resampled together. None
            resamples images.

    Returns:
        results by class, in the order of the labels (sorted if None).

    Raises:
        InputError: the two lists differ in length, or an argument is out of range or of the wrong type.
    """
    _refuse_text(labels)
    if len(detections) != len(truths):
        raise InputError(f"detections for {len(detections)} images, truth for {len(truths)}; expected as many")
    if rule not in RULES:
        raise InputError(f"rule: expected one of {', '.join(RULES)}, not {rule!r}")
    if not 0.0 < iou_threshold <= 1.0:
        raise InputError(f"iou_threshold: expected a number in (0, 1], not {iou_threshold!r}")
    if groups is not None and len(groups) != len(truths):
        raise InputError(f"groups for {len(groups)} images, truth for {len(truths)}; expected as many")
    if generator is not None and not (isinstance(draws, Integral) and draws >= 1):
        raise InputError(f"draws: expected a whole number of at least 1, not {draws!r}; generator=None leaves them out")
    if labels is None:
        labels = sorted({str(word) for truth in truths for word in truth.label[~truth.ignore]})
    group_of = np.unique(np.asarray(groups if groups is not None else range(len(truths))), return_inverse=True)[1]
    rest = (detections, truths, rule, iou_threshold, generator, draws, group_of)
    return {label: _evaluate_class(label, *rest) for label in labels}


@dataclass(frozen=True, eq=False)
class MeanResult:
    """Average precision as a mean over classes.

    Attributes:
        ap_percent: mean over the classes that have an object, 0 to 100; NaN if none has.
        draws: (B,) percent, of the same resamples; a class without an object in a resample is left out of it.
        clusters: images, or groups of them, that hold an object, of the class with the fewest: what an interval rests
            on; 0 without any object.
        objects: to be found, of all classes.
    """

    ap_percent: float
    draws: NDArray[np.float64]
    clusters: int
    objects: int


def mean_over_classes(results: Collection[ClassResult]) -> MeanResult:
    """Mean of the average precision over the classes that have an object, with its bootstrap draws.

    Args:
        results: at least one, judged with equal generators, so that their draws are of the same images.

    Raises:
        InputError: there is no result, or the draws are of different images.
    """
    if not results:
        raise InputError("mean over classes: expected at least one class")
    if len({result.resampled_from for result in results}) > 1:
        labels = ", ".join(result.label for result in results)
        raise InputError(
            f"mean over classes ({labels}): resampled from different images; judge each class with a generator of its "
            "own, made by the same stream(...)"
        )
    known = [result for result in results if result.objects]
    draws = 100.0 * np.stack([result.draws for result in results])
    held = np.isfinite(draws)
    count, total = held.sum(axis=0), np.where(held, draws, 0.0).sum(axis=0)
    mean = float(np.mean([100.0 * result.average_precision for result in known])) if known else float("nan")
    return MeanResult(
        min(mean, 100.0) if known else mean,  # a sum of rounded shares may exceed 1 in the last digit
        np.clip(np.where(count > 0, total / np.maximum(count, 1), np.nan), 0.0, 100.0),
        min((result.clusters for result in known), default=0),
        sum(result.objects for result in known),
    )


def class_mean(
    detections: Sequence[Detections],
    truths: Sequence[GroundTruth],
    labels: Sequence[str],
    criteria: EvaluationSettings,
    generator: Callable[[], np.random.Generator],
    groups: Sequence[str],
) -> MeanResult:
    """Mean of the average precision over classes, each of the same resamples.

    Args:
        detections: one entry per image.
        truths: one entry per image, in the same order.
        labels: the classes.
        criteria: ``detection.evaluation`` of the configuration.
        generator: makes the generator of the bootstrap, an equal one at every call.
        groups: see `evaluate`.

    Raises:
        InputError: see `evaluate`.
    """
    _refuse_text(labels)
    by_class = [
        evaluate(
            detections, truths, [label], criteria.rule, criteria.iou_threshold, generator(), criteria.bootstrap_draws,
            groups,
        )[label]
        for label in labels
    ]  # fmt: skip
    return mean_over_classes(by_class)


def _refuse_text(labels: Iterable[str] | None) -> None:
    """Refuses one word in place of several: its letters would be taken for classes."""
    if isinstance(labels, str):
        raise InputError(f"labels: expected a sequence of classes, as [{labels!r}], not the text {labels!r}")


def mean_average_precision(results: Iterable[ClassResult]) -> float:
    """Mean over the classes that have an object; NaN if none has."""
    values = [result.average_precision for result in results if result.objects]
    return float(np.mean(values)) if values else float("nan")


def _evaluate_class(
    label: str,
    detections: Sequence[Detections],
    truths: Sequence[GroundTruth],
    rule: Rule,
    iou_threshold: float,
    generator: np.random.Generator | None,
    draws: int,
    group_of: NDArray[np.int64],
) -> ClassResult:
    scores: list[NDArray[np.float64]] = [np.zeros(0)]
    verdicts: list[NDArray[np.int8]] = [np.zeros(0, dtype=np.int8)]
    images: list[NDArray[np.int64]] = [np.zeros(0, dtype=np.int64)]
    objects = np.zeros(len(truths), dtype=np.int64)
    ignored = 0
    for image, (detected, truth) in enumerate(zip(detections, truths, strict=True)):
        wanted, mine = truth.called(label), detected.called(label)
        order = np.argsort(-mine.score, kind="stable")[: COCO_MAX_DETECTIONS if rule == "coco" else None]
        scores.append(mine.score[order])
        verdicts.append(match(mine.boxes[order], wanted, rule, iou_threshold))
        images.append(np.full(len(order), image, dtype=np.int64))
        objects[image] = np.count_nonzero(~wanted.ignore)
        ignored += int(np.count_nonzero(wanted.ignore))
    score, verdict, image_of = np.concatenate(scores), np.concatenate(verdicts), np.concatenate(images)
    counted = np.flatnonzero(verdict != IGNORED)
    order = counted[np.argsort(-score[counted], kind="stable")]
    hit, image_of = verdict[order] == TRUE_POSITIVE, image_of[order]
    total = int(objects.sum())
    found_so_far = np.cumsum(hit)
    share = float(area(hit[None].astype(float), np.ones((1, len(hit))), np.array([total]), rule)[0])
    clusters = len(np.unique(group_of[objects > 0]))
    drawn, (low, high), state = np.zeros(0), NO_INTERVAL, ""
    if generator is not None:
        state = repr(generator.bit_generator.state)
        drawn = _bootstrap(hit, image_of, objects, rule, generator, draws, group_of)
        low, high = bias_corrected(drawn, share, clusters, bounds=(0.0, 1.0))  # a draw may hold no object at all
    return ClassResult(
        label=label,
        average_precision=share,
        low=low,
        high=high,
        images=len(truths),
        clusters=clusters,
        objects=total,
        objects_ignored=ignored,
        detections=len(verdict),
        true_positives=int(hit.sum()),
        false_positives=int(np.count_nonzero(verdict == FALSE_POSITIVE)),
        ignored=int(np.count_nonzero(verdict == IGNORED)),
        score=score[order],
        precision=found_so_far / np.arange(1, len(hit) + 1),
        recall=found_so_far / total if total else np.full(len(hit), np.nan),
        draws=drawn,
        resampled_from=state,
    )


def area(
    true_positive: NDArray[np.float64], counted: NDArray[np.float64], objects: NDArray[np.integer], rule: Rule
) -> NDArray[np.float64]:
    """Area under monotone precision over recall, for several weightings of the same sorted detections.

    Args:
        true_positive: (B, D) weight of a detection if it is right, else 0; highest score first.
        counted: (B, D) weight of a detection.
        objects: (B,) objects, weighted.
        rule: ``"paper"`` for the whole area, ``"coco"`` for 101 recalls.

    Returns:
        (B,) average precision; NaN without objects.
    """
    result = np.full(len(true_positive), np.nan)
    present = np.asarray(objects) > 0
    if true_positive.shape[1] == 0:
        result[present] = 0.0
        return result
    true_positives, shown = np.cumsum(true_positive[present], axis=1), np.cumsum(counted[present], axis=1)
    precision = np.divide(true_positives, shown, out=np.zeros_like(true_positives), where=shown > 0)
    best = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
    recall = true_positives / np.asarray(objects)[present, None]
    if rule == "paper":
        result[present] = (np.diff(recall, axis=1, prepend=0.0) * best).sum(axis=1)
    else:
        padded = np.concatenate([best, np.zeros((len(best), 1))], axis=1)
        result[present] = [
            row[np.searchsorted(at, COCO_RECALLS)].mean() for row, at in zip(padded, recall, strict=True)
        ]
    return result


def _bootstrap(
    hit: NDArray[np.bool_],
    image_of: NDArray[np.int64],
    objects: NDArray[np.int64],
    rule: Rule,
    generator: np.random.Generator,
    draws: int,
    group_of: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Bootstrap over groups of images: one drawn twice counts twice, with its objects and its detections."""
    groups = int(group_of.max()) + 1 if len(group_of) else 0
    if not groups:
        return np.full(draws, np.nan)
    values = []
    block = max(1, 4_000_000 // max(1, len(hit), len(objects)))  # bounds memory
    for start in range(0, draws, block):
        rows = min(block, draws - start)
        times = generator.multinomial(groups, np.full(groups, 1.0 / groups), size=rows)[:, group_of]
        weight = times[:, image_of].astype(float)
        values.append(area(weight * hit, weight, times @ objects, rule))
    return np.concatenate(values)
