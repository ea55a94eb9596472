"""Sections of ``params.yaml`` by name, each with the settings of the package that owns them.

A stage imports those that it reads, so a change of another section's settings does not re-run it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

from pipeline.errors import InputError
from pipeline.registry import Registry

SECTIONS = Registry(
    "section",
    "pipeline.config.sections",
    {
        "profile": "pipeline.config.execution:Profile",
        "root": "pipeline.config.execution:Root",
        "executor": "pipeline.config.execution:ExecutorSettings",
        "seed": "pipeline.settings:Seed",
        "camera": "pipeline.camera.settings:CameraSettings",
        "psf": "pipeline.camera.settings:PsfSettings",
        "scenes": "pipeline.scenes.settings:ScenesSettings",
        "datasets": "pipeline.datasets.settings:Datasets",
        "corruption": "pipeline.experiments.settings:CorruptionSettings",
        "noise": "pipeline.experiments.settings:NoiseSettings",
        "real_noise": "pipeline.experiments.real_noise.settings:RealNoiseSettings",
        "blur": "pipeline.experiments.settings:BlurSettings",
        "combined": "pipeline.experiments.settings:CombinedSettings",
        "denoised_blur": "pipeline.experiments.settings:DenoisedBlurSettings",
        "detection": "pipeline.config.detection:DetectionSettings",
        "control": "pipeline.control.settings:ControlSettings",
        "train": "pipeline.config.train:TrainSettings",
        "ablation": "pipeline.blur.settings:AblationSettings",
        "report": "pipeline.report.settings:ReportSettings",
        "matrix": "pipeline.config.matrix:MatrixSettings",
        "by_kind": "pipeline.config.matrix:ByKind",
    },
)


def read(content: Mapping[str, Any], names: Iterable[str], where: str) -> Any:
    """Some sections of a configuration, checked and typed.

    Args:
        content: nested mapping, as read from YAML.
        names: of the sections; the others are not looked at.
        where: file named in messages.

    Returns:
        an object with one attribute per section.

    Raises:
        InputError: a section is missing or not what its schema allows.
    """
    from pydantic import TypeAdapter, ValidationError

    sections = SimpleNamespace()
    for name in names:
        if name not in content:
            raise InputError(f"{where}: '{name}' is missing; run 'python -m pipeline.config' to compile it from conf/")
        try:
            setattr(sections, name, TypeAdapter(SECTIONS.get(name)).validate_python(content[name]))
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(str(part) for part in (name, *first["loc"]))
            raise InputError(
                f"{where}: '{key}': {first['msg']}; 'python -m pipeline.config --check' lists every problem"
            ) from None
    return sections
