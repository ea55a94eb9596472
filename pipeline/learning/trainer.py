"""The training loop: AdamW or Adam, cosine schedule, moving average of the weights, checkpoints, resume.

Learning rate at step t of T:   lr(t) = lr min(1, (t + 1) / warm-up) (e + (1 - e) (1 + cos(pi s)) / 2),
                                s = max(0, t / T - h) / (1 - h),   h = `constant_lr_fraction`
Averaged weights:               w' <- d w' + (1 - d) w,   d = min(decay, (1 + t) / (10 + t))

A run that is stopped and started again goes on from its last checkpoint and ends with the same weights, bit for bit
(one thread, same libraries): batches are a function of the step, and nothing else is random. In single precision
another processor ends with the same weights too (`pipeline.processor`). A run that diverges, its loss or score no
longer finite, is an error; the last good checkpoint stays.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

from pipeline.errors import InputError
from pipeline.learning import weights
from pipeline.learning.chunk_loader import ChunkLoader
from pipeline.learning.settings import Schedule

if TYPE_CHECKING:
    import torch

    from pipeline.learning.recorded_step import Tensors

CHECKPOINT = "checkpoint.safetensors"
ARCHITECTURE = "training-checkpoint-1"


@dataclass
class Trained:
    """The outcome.

    Attributes:
        model: with the averaged weights of the step that validated best (the last, without validation).
        curve: one row every so many steps: step, learning rate, mean of each measure since the row before, and
            validation measures where there are some (prefix ``validation_``).
        best_step: which step that was.
        device: that it was trained on.
    """

    model: torch.nn.Module
    curve: list[dict[str, float]]
    best_step: int
    device: str = "cpu"


@dataclass
class _State:
    """Everything that a checkpoint keeps."""

    model: torch.nn.Module
    optimiser: torch.optim.Optimizer
    average: dict[str, torch.Tensor]
    device: str = "cpu"
    best: dict[str, torch.Tensor] = field(default_factory=dict)
    best_score: float = math.inf
    best_step: int = 0
    step: int = 0
    curve: list[dict[str, float]] = field(default_factory=list)
    sums: dict[str, Number] = field(default_factory=dict)


Number = Union[float, "torch.Tensor"]
Loss = Callable[["torch.nn.Module", Mapping[str, Any]], tuple["torch.Tensor", Mapping[str, Number]]]


def train(
    model: torch.nn.Module,
    loss: Loss,
    loader: ChunkLoader,
    schedule: Schedule,
    *,
    folder: Path | None = None,
    validate: Callable[[torch.nn.Module], dict[str, float]] | None = None,
    score: str = "",
    device: str = "cpu",
    recordable: bool = False,
    report: Callable[[dict[str, float]], None] | None = None,
    stop_after: int | None = None,
) -> Trained:
    """Train a network, or go on training it.

    Args:
        model: freshly initialised, in the same way on every start.
        loss: (model, batch) -> loss to minimise, and measures to record; the batch holds the feed's arrays as tensors.
            A measure is a number, or a tensor of one, which a GPU need not be waited for.
        loader: batches by step.
        schedule: how.
        folder: where checkpoints are kept; None keeps none.
        validate: measures of a model, taken at checkpoints on the averaged weights.
        score: which of them selects the best checkpoint (smallest); "" takes the last.
        device: that the network is trained on; it comes back on the processor.
        recordable: whether the loss is one that a GPU can record (`pipeline.learning.recorded_step`): batches of one
            shape, measures as tensors, nothing waited for. A GPU then takes a fraction of the time.
        report: called with every new row of the curve.
        stop_after: stop at this step as if interrupted (a checkpoint is written).

    Raises:
        InputError: the checkpoint is broken or belongs to another training; or the loss or the score is no longer
            finite, where the checkpoint before stays.
    """
    import torch

    model.to(device)
    recorded = recordable and device != "cpu"
    state = _State(model, _optimiser(model, schedule, device, recorded), _weights(model), device)
    path = None if folder is None else Path(folder) / CHECKPOINT
    if path is not None and path.is_file():
        _restore(path, state, schedule)
    model.train()
    learn = _recorded(state, loss, schedule) if recorded else _unrecorded(state, loss, schedule)
    last = schedule.steps if stop_after is None else min(stop_after, schedule.steps)
    while state.step < last:
        measures = learn({name: torch.from_numpy(values) for name, values in loader.batch(state.step).items()})
        state.step += 1
        for name, number in measures.items():
            state.sums[name] = state.sums.get(name, 0.0) + _double(number)
        row = _row(state, schedule)
        due = state.step == schedule.steps or state.step % schedule.checkpoint_every == 0
        if not schedule.ema_decay and (due or state.step == stop_after):
            state.average = _weights(model)
        if due:
            result = _validated(state, validate, score)
            if row is not None:
                row |= result
            if path is not None:
                _keep(path, state, schedule)
        if row is not None and report is not None:
            report(row)
    if state.step < schedule.steps and path is not None:  # stopped
        _keep(path, state, schedule)
    model.load_state_dict(state.best or state.average)
    return Trained(model.cpu().eval(), state.curve, state.best_step or state.step, device)


def _optimiser(model: torch.nn.Module, schedule: Schedule, device: str, recorded: bool) -> torch.optim.Optimizer:
    """The optimiser of a schedule; of a recorded step, the learning rate is a tensor that the recording reads."""
    import torch

    rate = torch.tensor(schedule.learning_rate, device=device) if recorded else schedule.learning_rate
    options: dict[str, Any] = {"lr": rate, "betas": schedule.betas, "eps": schedule.epsilon, "capturable": recorded}
    options["fused"] = True  # its square root is the same on any processor, that of the other forms is MKL's
    kinds = {"adamw": torch.optim.AdamW, "adam": torch.optim.Adam}
    return kinds[schedule.optimiser](model.parameters(), weight_decay=schedule.weight_decay, **options)


def _weights(model: torch.nn.Module) -> dict[str, torch.Tensor]:
    """A copy of the weights as they are now."""
    return {name: value.clone() for name, value in model.state_dict().items()}


def _unrecorded(state: _State, loss: Loss, schedule: Schedule) -> Callable[[Tensors], Mapping[str, Number]]:
    """A step, batch -> measures, that is run operation by operation."""

    def step(batch: Tensors) -> Mapping[str, Number]:
        for group in state.optimiser.param_groups:
            group["lr"] = schedule.rate(state.step)
        there = {name: values.to(state.device) for name, values in batch.items()}
        return _descend(state, loss, there, schedule, 1 - _kept_share(state.step, schedule))

    return step


def _recorded(state: _State, loss: Loss, schedule: Schedule) -> Callable[[Tensors], Mapping[str, Number]]:
    """The same, recorded by a GPU; rate and share of the average are written to where the recording reads them."""
    import torch

    from pipeline.learning.recorded_step import RecordedStep

    taken = torch.empty((), device=state.device)
    recorded = RecordedStep(lambda batch: _descend(state, loss, batch, schedule, taken), state.device)

    def step(batch: Tensors) -> Mapping[str, Number]:
        for group in state.optimiser.param_groups:
            group["lr"].fill_(schedule.rate(state.step))
        taken.fill_(1 - _kept_share(state.step, schedule))
        return recorded(batch)

    return step


def _kept_share(step: int, schedule: Schedule) -> float:
    """What the averaged weights keep of themselves at a step, d of the module."""
    return min(schedule.ema_decay, (1 + step) / (10 + step))


def _descend(state: _State, loss: Loss, batch: Tensors, schedule: Schedule, taken: Number) -> dict[str, Any]:
    """Loss, gradient, optimiser, moving average; returns the loss and its measures."""
    import torch

    value, measures = loss(state.model, batch)
    state.optimiser.zero_grad(set_to_none=True)
    value.backward()
    if schedule.max_grad_norm is not None:
        torch.nn.utils.clip_grad_norm_(state.model.parameters(), schedule.max_grad_norm)
    state.optimiser.step()
    if schedule.ema_decay:
        with torch.no_grad():
            for name, tensor in state.model.state_dict().items():
                if tensor.dtype.is_floating_point:
                    state.average[name].lerp_(tensor, taken)
                else:
                    state.average[name].copy_(tensor)
    return {"loss": value.detach(), **measures}


def _double(number: Number) -> Number:
    """A number, or a tensor of one where it is, in double precision."""
    return number if isinstance(number, float) else number.detach().double()


def _row(state: _State, schedule: Schedule) -> dict[str, float] | None:
    """A new row of the curve, where one is due."""
    if state.step % schedule.report_every and state.step != schedule.steps:
        return None
    # a training that was prolonged has a row at the end of its first length, wherever that lies
    count = state.step - (int(state.curve[-1]["step"]) if state.curve else 0)
    row = {"step": float(state.step), "learning_rate": schedule.rate(state.step - 1)}
    row |= {name: float(total) / count for name, total in state.sums.items()}
    _refuse_divergence("loss", row["loss"], state.step)
    state.sums = {}
    state.curve.append(row)
    return row


def _refuse_divergence(quantity: str, value: float, step: int) -> None:
    """Raises InputError for a loss or score that is NaN or infinite: no later step makes such weights good again."""
    if not math.isfinite(value):
        raise InputError(f"training: the {quantity} is not finite at step {step}; lower schedule.learning_rate")


def _validated(state: _State, validate: Callable[..., dict[str, float]] | None, score: str) -> dict[str, float]:
    """Measures of the averaged weights; remembers the best."""
    import torch

    if validate is None:
        return {}
    kept = _weights(state.model)
    state.model.load_state_dict(state.average)
    state.model.eval()
    with torch.no_grad():
        result = validate(state.model)
    if score:
        _refuse_divergence(f"validation's {score}", result[score], state.step)
    if score and result[score] < state.best_score:
        state.best_score, state.best_step = result[score], state.step
        state.best = {name: value.clone() for name, value in state.average.items()}
    state.model.load_state_dict(kept)
    state.model.train()
    return {f"validation_{name}": value for name, value in result.items()}


def _identity(schedule: Schedule) -> dict[str, Any]:
    """A schedule as a checkpoint remembers it, but for how often one is kept."""
    content = asdict(schedule)
    del content["checkpoint_every"]
    return json.loads(json.dumps(content))


def _continues(kept: dict[str, Any], schedule: Schedule, step: int) -> bool:
    """Whether a run of one schedule, stopped at a step, may go on with another.

    They must be the same, but for the length as long as the rate has not begun to fall in either (it may never).
    """
    identity = _identity(schedule)
    lengths = kept.pop("steps", 0), identity.pop("steps")
    even = 1.0 if schedule.final_lr_ratio == 1 else schedule.constant_lr_fraction
    return kept == identity and (lengths[0] == lengths[1] or step <= even * min(lengths))


def _keep(path: Path, state: _State, schedule: Schedule) -> None:
    """Write a checkpoint; the one before stays until this one is complete."""
    import torch

    sums = {name: float(total) for name, total in state.sums.items()}
    _refuse_divergence("loss", sums.get("loss", 0.0), state.step)
    tensors = {f"model.{name}": value for name, value in state.model.state_dict().items()}
    tensors |= {f"average.{name}": value for name, value in state.average.items()}
    tensors |= {f"best.{name}": value for name, value in state.best.items()}
    prefix = weights.OPTIMISER_PREFIX
    for index, moments in state.optimiser.state_dict()["state"].items():
        tensors |= {f"{prefix}{index}.{name}": torch.as_tensor(value) for name, value in moments.items()}
    weights.save(
        path,
        tensors,
        ARCHITECTURE,
        schedule=_identity(schedule),
        step=state.step,
        curve=state.curve,
        sums=sums,
        best_score=None if math.isinf(state.best_score) else state.best_score,
        best_step=state.best_step,
    )


def _restore(path: Path, state: _State, schedule: Schedule) -> None:
    try:
        tensors, header = weights.load(path, ARCHITECTURE)
    except InputError as error:  # its remedies are for weights, which are restored or trained
        raise InputError(f"{str(error).rpartition('; ')[0]}; delete its folder to begin anew") from None
    if not _continues(header["schedule"], schedule, header["step"]):
        raise InputError(f"{path}: belongs to a training with another schedule; delete its folder to begin anew")

    def part(prefix: str) -> dict[str, torch.Tensor]:
        named = ((name, value.to(state.device)) for name, value in tensors.items() if name.startswith(prefix))
        return {name.removeprefix(prefix): value for name, value in named}

    try:
        state.model.load_state_dict(part("model."))
    except RuntimeError:
        raise InputError(f"{path}: belongs to another network; delete its folder to begin anew") from None
    parameters = [parameter for group in state.optimiser.param_groups for parameter in group["params"]]
    moments: dict[int, dict[str, torch.Tensor]] = {}
    for name, value in part(weights.OPTIMISER_PREFIX).items():
        index, _, kind = name.partition(".")
        moments.setdefault(int(index), {})[kind] = _laid_out_as(parameters[int(index)], value)
    state.optimiser.load_state_dict({"state": moments, "param_groups": state.optimiser.state_dict()["param_groups"]})
    state.average, state.best = part("average."), part("best.")
    state.step, state.curve, state.sums = header["step"], header["curve"], header["sums"]
    state.best_step = header["best_step"]
    state.best_score = math.inf if header["best_score"] is None else header["best_score"]


def _laid_out_as(parameter: torch.Tensor, value: torch.Tensor) -> torch.Tensor:
    """A moment of a parameter in that parameter's order in memory, by which a fused optimiser pairs them.

    Files hold tensors row by row; the networks' own are channels-last.
    """
    import torch

    return torch.empty_like(parameter).copy_(value) if value.shape == parameter.shape else value
