"""The compact two-stage detector as everyone calls it; see `pipeline.detection.compact.detector`."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pipeline.detection.compact.detector import Compact
from pipeline.scenes.labels import LABELS

if TYPE_CHECKING:
    import torch

    from pipeline.detection.compact.detector import Candidates


class CompactTwoStage(Compact):
    """Two-stage detector; arguments as for `Compact`."""

    released_file: ClassVar[str] = "data/weights/detector_compact_two_stage.safetensors"

    def _network(self) -> tuple[torch.nn.Module, str, Candidates]:
        from pipeline.detection.compact import two_stage

        return two_stage.TwoStage(len(LABELS)), two_stage.ARCHITECTURE, two_stage.candidates
