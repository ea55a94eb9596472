"""Lists that ``dvc.yaml`` expands into stages."""

from __future__ import annotations

from pipeline.config.schema_base import Name, Section


class MatrixSection(Section):
    """Lists that ``dvc.yaml`` expands into stages; derived from the sections above, not set by hand."""

    datasets: list[Name]
    noise_estimators: list[Name]
    blur_estimators: list[Name]
    ablations: list[Name]
    detectors: list[Name]
    detection_datasets: list[Name]
    scenarios: list[Name]


SECTION = MatrixSection
