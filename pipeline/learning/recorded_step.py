"""A training step that a GPU records once and then repeats by itself: a CUDA graph.

A step starts hundreds of small kernels; started one by one by the processor they take several times as long as they
run. Recorded are the loss, its gradient, the optimiser and the moving average. What differs between steps enters by
tensors that keep their place in memory: the batch, the learning rate, the share of the average.

PyTorch, "CUDA Graphs", https://docs.pytorch.org/docs/stable/notes/cuda.html#cuda-graphs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch

    Tensors = Mapping[str, torch.Tensor]

FIRST_STEPS = 3
"""Done before recording, so that libraries have chosen their kernels and the optimiser has its moments."""


class RecordedStep:
    """A step, recorded at its fourth call.

    Args:
        step: batch -> measures, tensors of one number. It must do the same work each time: the same shapes, nothing
            that waits for the GPU, nothing copied from the processor, and all that it changes changed in place.
        device: e.g. ``"cuda"``.
    """

    def __init__(self, step: Callable[[Tensors], Tensors], device: str) -> None:
        self.step, self.device = step, device
        self.count = 0
        self.graph: torch.cuda.CUDAGraph | None = None
        self.batch: dict[str, torch.Tensor] = {}
        self.measures: Tensors = {}

    def __call__(self, batch: Tensors) -> Tensors:
        """Do the step.

        Args:
            batch: tensors of the processor, of the same names, shapes and types at every call.

        Returns:
            the measures of this step; the next one overwrites them.

        Raises:
            RuntimeError: the step does what cannot be recorded, or the batch has another shape.
        """
        import torch

        if not self.batch:
            self.batch = {name: torch.empty_like(values, device=self.device) for name, values in batch.items()}
        for name, values in batch.items():
            self.batch[name].copy_(values)
        self.count += 1
        if self.graph is not None:
            self.graph.replay()
        elif self.count <= FIRST_STEPS:
            self.measures = self._aside()
        else:
            self.graph = torch.cuda.CUDAGraph()
            # producers' queues have threads of their own, which must not end the recording
            with torch.cuda.graph(self.graph, capture_error_mode="thread_local"):
                self.measures = self.step(self.batch)
            self.graph.replay()  # recording runs nothing
        return self.measures

    def _aside(self) -> Tensors:
        """A step as it is, in another stream than the default one, which cannot be recorded."""
        import torch

        stream = torch.cuda.Stream(self.device)
        stream.wait_stream(torch.cuda.current_stream(self.device))
        with torch.cuda.stream(stream):
            measures = self.step(self.batch)
        torch.cuda.current_stream(self.device).wait_stream(stream)
        return measures
