"""The strict schema of ``params.yaml``: what may be set, in which unit and range.

Sections are named as in ``conf/``; each package declares its own in its module ``settings``. An unknown key, a wrong
type or a value out of range is one line that names the key and, for a typo, the nearest key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError, model_validator

from pipeline.blur.settings import AblationSettings
from pipeline.camera.settings import CameraSettings, PsfSettings
from pipeline.config.detection import DetectionSettings
from pipeline.config.execution import ExecutorSettings, Profile, Root
from pipeline.config.matrix import ByKind, MatrixSettings, OptionFiles, PlugIns, ReadFiles
from pipeline.config.train import TrainSettings
from pipeline.control.settings import ControlSettings
from pipeline.datasets.settings import Datasets
from pipeline.errors import InputError, did_you_mean
from pipeline.experiments.real_noise.settings import RealNoiseSettings
from pipeline.experiments.settings import (
    BlurSettings,
    CombinedSettings,
    CorruptionSettings,
    DenoisedBlurSettings,
    NoiseSettings,
)
from pipeline.report.settings import ReportSettings
from pipeline.scenes.settings import ScenesSettings
from pipeline.settings import Seed, Settings


class Config(Settings):
    """The whole of ``params.yaml``."""

    profile: Profile
    seed: Seed
    root: Root
    camera: CameraSettings
    psf: PsfSettings
    scenes: ScenesSettings
    datasets: Datasets
    corruption: CorruptionSettings
    blur: BlurSettings
    combined: CombinedSettings
    denoised_blur: DenoisedBlurSettings
    detection: DetectionSettings
    control: ControlSettings
    train: TrainSettings
    ablation: AblationSettings
    noise: NoiseSettings
    real_noise: RealNoiseSettings
    executor: ExecutorSettings
    report: ReportSettings
    matrix: MatrixSettings
    by_kind: ByKind
    plug_ins: PlugIns
    option_files: OptionFiles
    read_files: ReadFiles

    @model_validator(mode="after")
    def _root_of_profile(self) -> Config:
        if (self.root == "") is not (self.profile == "default"):
            raise ValueError(
                f"root is '{self.root}' with profile '{self.profile}': only profile default writes into the project "
                "itself, since its weights and report are the released ones; expected a folder as runs/NAME/ for others"
            )
        return self

    @model_validator(mode="after")
    def _matrix_follows(self) -> Config:
        for key, listed, defined in (
            ("matrix.datasets", self.matrix.datasets, list(self.datasets)),
            ("matrix.noise_estimators", self.matrix.noise_estimators, list(self.noise.estimators)),
            ("matrix.blur_estimators", self.matrix.blur_estimators, list(self.blur.estimators)),
            ("matrix.detectors", self.matrix.detectors, list(self.detection.detectors)),
            ("matrix.detection_datasets", self.matrix.detection_datasets, list(self.detection.datasets)),
        ):
            if listed != defined:
                raise ValueError(f"{key} is {listed} but should follow {defined}; it is derived, do not set it")
        unknown = set(self.matrix.scenarios) - set(self.control.scenarios)
        if unknown:
            raise ValueError(f"matrix.scenarios: {sorted(unknown)} are not in control.scenarios")
        if self.control.detector not in self.detection.detectors:
            raise ValueError(f"control.detector '{self.control.detector}' is not among detection.detectors")
        unknown = set(self.matrix.ablations) - set(self.ablation.variants)
        if unknown:
            raise ValueError(f"matrix.ablations: {sorted(unknown)} are not in ablation.variants")
        for key, members in (
            ("noise", self.noise.estimators),
            ("blur", self.blur.estimators),
            ("detection", self.detection.detectors),
        ):
            listed_names = sorted(name for names in self.by_kind.get(key, {}).values() for name in names)
            if listed_names != sorted(members):
                raise ValueError(f"by_kind.{key} lists {listed_names}, expected {sorted(members)}; it is derived")
        return self


def validate(content: Mapping[str, Any], where: str = "params.yaml") -> Config:
    """Check a configuration.

    Args:
        content: nested mapping, as read from YAML.
        where: file or source named in the message.

    Returns:
        the typed configuration.

    Raises:
        InputError: one line per problem, each naming its key, what was expected and what was given.
    """
    if not isinstance(content, Mapping):
        raise InputError(f"{where}: expected a mapping of sections, got {type(content).__name__}")
    try:
        return Config.model_validate(dict(content))
    except ValidationError as error:
        raise InputError("\n".join(f"{where}: {line}" for line in _lines(error.errors()))) from None


def _lines(problems: Sequence[Any]) -> list[str]:
    """One line per problem; keys with the same wrong value, as those that follow ``seed``, share one."""
    alike: dict[str, list[Any]] = {}
    for problem in problems:
        alike.setdefault(repr((problem["type"], problem["msg"], problem.get("input"))), []).append(problem)
    lines = []
    for members in alike.values():
        if members[0]["type"] in ("missing", "extra_forbidden", "unexpected_keyword_argument"):
            lines += [_line(problem) for problem in members]
            continue
        more = f"; the same in {len(members) - 1} more keys" if len(members) > 1 else ""
        lines.append(f"{_line(members[0])}{more}")
    return lines


def _line(problem: Any) -> str:
    path = ".".join(str(part) for part in problem["loc"] if part != "[key]")
    if problem["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"unknown key '{path}'; {did_you_mean(str(problem['loc'][-1]), known_keys(problem['loc'][:-1]))}"
    if problem["type"] == "missing":
        return f"'{path}' is missing"
    given = problem.get("input")
    shown = f" (given: {given!r})" if isinstance(given, (str, int, float, bool, type(None))) else ""
    message = str(problem["msg"]).removeprefix("Value error, ")
    key = f"'{path}': " if path else ""
    return f"{key}{message[:1].lower()}{message[1:]}{shown if path else ''}"


def known_keys(path: Sequence[Any]) -> list[str]:
    """Keys the schema knows at a path; mapping members (datasets, estimators) count as one step."""
    model: Any = Config
    for part in path:
        known = _fields(model)
        annotation = known[part].annotation if part in known else model
        inner = [each for each in getattr(annotation, "__args__", ()) if _fields(each)]
        model = inner[0] if inner else annotation
    return list(_fields(model))


def _fields(model: Any) -> Mapping[str, Any]:
    """Fields of a pydantic model or dataclass by name; none of anything else."""
    return getattr(model, "__pydantic_fields__", {})
