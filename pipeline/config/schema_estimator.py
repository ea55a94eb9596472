"""An estimator as configured: its registry name and options."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from pipeline.config.schema_base import Count, Name, Section


class EstimatorSection(Section):
    """One estimator by its registry name, with the options its class takes."""

    kind: Name
    options: dict[str, Any] = Field(default_factory=dict)
    per_frame: Count | None = None
    """Patches or tiles of a frame that a slow one is run on, where that is fewer than all are."""
    camera_samples: Annotated[int, Field(ge=100, le=100_000)] | None = None
    """Blurred sharp patches that a blur estimator is fitted to each dataset's camera on; null leaves it as it is."""

    @property
    def answers_added(self) -> bool:
        """Whether a blur estimator tells what was added to sharp frames, this camera's or a typical one's."""
        return self.camera_samples is not None or self.options.get("answer") == "added"
