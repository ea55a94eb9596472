"""What ``dvc.yaml`` expands into stages; derived from the other sections, not set by hand."""

from __future__ import annotations

from pipeline.settings import Name, Settings

ByKind = dict[Name, dict[Name, list[Name] | dict[Name, str]]]
"""Estimators and detectors by registry name, which ``dvc.yaml`` expands into stages with that name's dependencies.

Registry -> kind -> names of that kind (of detectors, name -> file that the stage `detector` depends on); ``other``
holds what third parties registered.
"""


class MatrixSettings(Settings):
    """Lists that ``dvc.yaml`` expands into stages."""

    datasets: list[Name]
    noise_estimators: list[Name]
    blur_estimators: list[Name]
    ablations: list[Name]
    detectors: list[Name]
    detection_datasets: list[Name]
    scenarios: list[Name]
