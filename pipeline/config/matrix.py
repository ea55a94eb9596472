"""What ``dvc.yaml`` expands into stages; derived from the other sections, not set by hand."""

from __future__ import annotations

from pipeline.settings import Name, Settings

ByKind = dict[Name, dict[Name, list[Name] | dict[Name, str]]]
"""Estimators and detectors by registry name, which ``dvc.yaml`` expands into stages with that name's dependencies.

Registry -> kind -> names of that kind (of detectors, name -> file that the stage `detector` depends on); ``other``
holds what third parties registered.
"""

PlugIns = dict[Name, dict[Name, str]]
"""SHA-256 of the source behind every member that a third party registered: what it is for -> member -> digits."""

OptionFiles = dict[Name, dict[Name, dict[Name, str]]]
"""SHA-256 of the files that options of estimators name, as of weights: what it is for -> member -> option -> digits."""


class DatasetFiles(Settings):
    """What the stage `index` of one dataset depends on.

    Attributes:
        data: a folder, or a file that changes with the data.
        whitelist: list of frames; a file that never changes where there is none.
        images: folder of pictures that lie elsewhere (option ``images``); likewise.
    """

    data: str
    whitelist: str
    images: str


class ReadFiles(Settings):
    """Files and folders that stages read and no stage makes.

    Attributes:
        datasets: dataset -> what its index depends on.
        psf: folder of stored kernels; a file that never changes where there is none.
    """

    datasets: dict[Name, DatasetFiles]
    psf: str


class MatrixSettings(Settings):
    """Lists that ``dvc.yaml`` expands into stages."""

    datasets: list[Name]
    noise_estimators: list[Name]
    blur_estimators: list[Name]
    ablations: list[Name]
    detectors: list[Name]
    detection_datasets: list[Name]
    scenarios: list[Name]
