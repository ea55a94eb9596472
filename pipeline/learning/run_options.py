"""How a training runs: on what, where it keeps what it made, with how many processes, what it reports on the way."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.executor import available_cores

Row = Mapping[str, float]  # of a learning curve: step, and measures by name
MOST_PRODUCERS = 8
"""Processes that make samples beside a training; five kept up with a GPU (44 steps a second of 96 samples each)."""


@dataclass(frozen=True)
class RunOptions:
    """How a training runs; nothing here changes the weights it ends with, but for their last digits on a GPU.

    Attributes:
        cache: folder for banks, frames and checkpoints, outside of any stage's outputs.
        folder: of the checkpoint; None names one in the cache by the fingerprint of settings and code.
        producers: processes that make samples ahead; 0 makes them in this one.
        device: that the network is trained on, ``"cpu"`` or ``"cuda"``.
        executor: arguments of `pipeline.executor.run_map`, for banks and frames, which are made first.
        report: called with every new row of the learning curve.
        stop_after: stop at this step as if interrupted (a checkpoint is written); None goes on to the end.
    """

    cache: Path = Path(".cache/training")
    folder: Path | None = None
    producers: int = 0
    device: str = "cpu"
    executor: Mapping[str, Any] = field(default_factory=dict)
    report: Callable[[dict[str, float]], None] | None = None
    stop_after: int | None = None

    @classmethod
    def reporting(cls, name: str, steps: int, workers: int, device: str = "cpu") -> RunOptions:
        """That of a stage: prints its progress and uses the processes there are.

        Args:
            name: of what is trained.
            steps: of the whole training.
            workers: processes; 0 takes one per core. With more than one, samples are made beside the training.
            device: see the class.

        Raises:
            InputError: there is no such device.
        """
        workers = workers or available_cores()
        return cls(
            producers=min(workers - 1, MOST_PRODUCERS),
            device=available(device),
            executor={"workers": workers},
            report=reporter(name, steps),
        )


def available(device: str) -> str:
    """The device, if torch sees it.

    Args:
        device: ``"cpu"``, ``"cuda"`` or ``"cuda:NUMBER"``.

    Raises:
        InputError: it does not.
    """
    if device == "cpu":
        return device
    import torch

    count = torch.cuda.device_count()
    if int(device.partition(":")[2] or 0) < count:
        return device
    raise InputError(
        f"executor.device is '{device}', but torch {torch.__version__} sees {count} CUDA devices; set it to 'cpu', "
        "or install a torch built for the GPU (pip install torch) and its driver"
    )


def reporter(name: str, steps: int) -> Callable[[Row], None]:
    """A function that prints each new row of a learning curve.

    Args:
        name: of what is trained.
        steps: of the whole training.
    """

    def report(row: Row) -> None:
        measures = "  ".join(f"{key} {value:.4g}" for key, value in row.items() if key != "step")
        print(f"{name} step {row['step']:.0f} of {steps}: {measures}", file=sys.stderr)

    return report
