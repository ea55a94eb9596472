"""What the configuration stands for, names, paths, scenarios: checked when it is compiled, not hours later.

The schema knows types and ranges. Whether an estimator of that name is registered, an option taken by
its class, a folder there, or a scenario one that can be driven, is checked here. Classes are looked up in the
registries, which are imported by name only when this check runs.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.camera.sensor import SENSORS
from pipeline.config.hydra_plugins.named_files import in_one_file
from pipeline.config.name_clashes import name_clashes
from pipeline.errors import InputError, did_you_mean
from pipeline.executor import ADDRESS_PATTERN
from pipeline.experiments.class_maps import class_map
from pipeline.registry import Registry

REGISTRIES = Registry(
    "registry",
    "pipeline.config.references",
    {
        "datasets": "pipeline.datasets:REGISTRY",
        "noise": "pipeline.noise:REGISTRY",
        "blur": "pipeline.blur:REGISTRY",
        "detection": "pipeline.detection:REGISTRY",
        "control": "pipeline.control:REGISTRY",
    },
)
"""Where names in the configuration are looked up, imported only by the check."""
FROM_THE_LOOP = ("camera", "performance")
"""What the control loop gives every policy, none of its options."""
STAGE_FOLDER = Path("data")  # below it stages write: what is absent there may still be made
USER_FOLDER = Path("data/raw")


def check_references(config: Any) -> None:
    """Check everything a configuration refers to.

    Args:
        config: a valid `pipeline.config.schema.Config`.

    Raises:
        InputError: one line per problem, each naming its key, what was expected and what was given.
    """
    problems = list(_problems(config))
    if problems:
        raise InputError("\n".join(problems))


def _problems(config: Any) -> Iterator[str]:
    for key, group, entries in (
        ("datasets", "datasets", config.datasets),
        ("noise.estimators", "noise", config.noise.estimators),
        ("real_noise.estimators", "noise", config.real_noise.estimators),
        ("blur.estimators", "blur", config.blur.estimators),
        ("detection.detectors", "detection", config.detection.detectors),
        ("control.policies", "control", config.control.policies),
    ):
        for name, entry in entries.items():
            yield from _kind(f"{key}.{name}", group, entry)
    yield from _registered_twice(config)
    yield from _names(config)
    yield from _reader_options(config)
    yield from _labels(config)
    yield from _paths(config)
    yield from _control(config.control)
    address, backend = config.executor.address, config.executor.backend
    if backend == "dask" and not (address and re.fullmatch(ADDRESS_PATTERN, address)):
        yield f"executor.address={address}: expected the scheduler's address, e.g. tcp://127.0.0.1:8786"
    if backend != "dask" and address:
        yield f"executor.address={address}: only executor.backend=dask uses it (backend is '{backend}')"
    if config.camera.kind != "physical" and config.camera.poisson != "exact":
        method = config.camera.poisson
        yield f"camera.poisson={method}: only camera.kind=physical uses it (kind is '{config.camera.kind}')"


def _kind(key: str, package: str, entry: Any) -> Iterator[str]:
    """The problems of one entry of a mapping of sections with a ``kind`` and ``options``."""
    registry: Registry = REGISTRIES.get(package)
    if not registry.is_builtin(entry.kind) and entry.kind not in registry.names():  # which reads every package's file
        yield f"{key}.kind: unknown {registry.kind} '{entry.kind}'; {did_you_mean(entry.kind, registry.names())}"
        return
    detector = package == "detection"
    if not entry.options and not (detector and (entry.weights is None or not registry.is_builtin(entry.kind))):
        return
    try:
        parameters = dict(inspect.signature(registry.get(entry.kind)).parameters)
    except InputError as error:
        yield f"{key}: {error}"
        return
    if package == "control":
        parameters = {name: each for name, each in parameters.items() if name not in FROM_THE_LOOP}
    weights = parameters.get("weights")
    if detector and entry.weights is None and weights is not None and weights.default is inspect.Parameter.empty:
        yield f"{key}.weights: '{entry.kind}' needs a file; 'camera-monitor weights list' shows what there is"
    if detector and entry.weights is not None and weights is None and not _takes_any(parameters):
        yield f"{key}.weights: '{entry.kind}' takes no weights; leave the key out"
    yield from _unknown(f"{key}.options", entry.kind, entry.options, parameters)


def _registered_twice(config: Any) -> Iterator[str]:
    """Names in use that stand for more than one class: which one a stage would run is not what is written."""
    measure = config.detection.measure
    used = {
        "datasets": _kinds(config.datasets),
        "noise": {*_kinds(config.noise.estimators), *_kinds(config.real_noise.estimators), measure.sigma},
        "blur": {*_kinds(config.blur.estimators), measure.mtf},
        "detection": _kinds(config.detection.detectors),
        "control": _kinds(config.control.policies),
    }
    for package, names in used.items():
        yield from name_clashes(REGISTRIES.get(package), names).values()


def _kinds(entries: Mapping[str, Any]) -> set[str]:
    return {entry.kind for entry in entries.values()}


def _unknown(key: str, kind: str, options: Iterable[str], parameters: Mapping[str, inspect.Parameter]) -> Iterator[str]:
    """Options that a class of this signature does not take."""
    for option in options:
        if option not in parameters and not _takes_any(parameters):
            yield f"{key}.{option}: unknown option of '{kind}'; {did_you_mean(option, parameters)}"


def _takes_any(parameters: Mapping[str, inspect.Parameter]) -> bool:
    return any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in parameters.values())


def _reader_options(config: Any) -> Iterator[str]:
    """Options of a dataset's reader that are keys of its section instead, which the reader would be given twice.

    Of those with which a sweep has it read anew also names that it does not take; `_kind` has checked the section's.
    """
    sections = [(f"datasets.{name}.options", name, section.options) for name, section in config.datasets.items()]
    sweep = {name: given for name, given in config.detection.sweep.options.items() if name in config.datasets}
    sections += [(f"detection.sweep.options.{name}", name, given) for name, given in sweep.items()]
    for key, name, options in sections:
        for option in ("root", "whitelist", "limit"):
            if option in options:
                yield f"{key}.{option}: not among options; set datasets.{name}.{option}"
        if "name" in options:
            yield f"{key}.name: a dataset is called as its section, '{name}'; leave the option out"
    registry: Registry = REGISTRIES.get("datasets")
    for name, given in sweep.items():
        key, kind = f"detection.sweep.options.{name}", config.datasets[name].kind
        if "images" in given:  # stages depend on the folder that the section names
            yield f"{key}.images: a sweep takes the pictures of its dataset; set datasets.{name}.options.images"
        others = [option for option in given if option not in ("root", "whitelist", "limit", "name", "images")]
        if others and kind in registry.names():
            try:
                parameters = inspect.signature(registry.get(kind)).parameters
            except InputError as error:
                yield f"{key}: {error}"
            else:
                yield from _unknown(key, kind, others, parameters)


def _names(config: Any) -> Iterator[str]:
    """Names that must be keys of another section."""
    noise, blur = config.noise.estimators, config.blur.estimators
    combined, detection = config.combined, config.detection
    raw = {name: section for name, section in blur.items() if section.calibration_samples is None}
    uncalibrated = "blur.estimators without calibration_samples"
    listed: list[tuple[str, Iterable[str], Collection[str], str]] = [
        ("combined.noise_estimators", combined.noise_estimators, noise, "noise.estimators"),
        ("combined.blur_estimators", combined.blur_estimators, raw, uncalibrated),
        ("combined.denoise.sigma_by", [combined.denoise.sigma_by], noise, "noise.estimators"),
        ("denoised_blur.blur_estimators", config.denoised_blur.blur_estimators, raw, uncalibrated),
        ("detection.datasets", detection.datasets, config.datasets, "datasets"),
        ("detection.sweep.options", detection.sweep.options, config.datasets, "datasets"),
        ("detection.measure.mtf", [detection.measure.mtf], REGISTRIES.get("blur").names(), "blur estimators"),
        ("detection.measure.sigma", [detection.measure.sigma], REGISTRIES.get("noise").names(), "noise estimators"),
        ("control.camera.sensor", [config.control.camera.sensor], SENSORS, "sensors"),
    ]
    for name, part in combined.blur_estimators.items():
        key = f"combined.blur_estimators.{name}.experiments"
        listed.append((key, part.experiments or (), combined.experiments, "combined.experiments"))
    for key, names, known, where in listed:
        for name in names:
            if name not in known:
                yield f"{key}: '{name}' is not among {where}; {did_you_mean(name, known)}"


def _labels(config: Any) -> Iterator[str]:
    """Datasets for detection whose labels mean nothing to a detector."""
    known = REGISTRIES.get("datasets").names()
    for name in config.detection.datasets:
        dataset = config.datasets.get(name)
        if dataset is not None and dataset.kind in known:
            try:
                class_map(dataset.kind)
            except InputError as error:
                yield f"detection.datasets: '{name}': {error}"


def _paths(config: Any) -> Iterator[str]:
    for name, dataset in config.datasets.items():
        root = dataset.root
        if root is not None and not _may_be_made(root, config.root) and not Path(root).is_dir():
            yield f"datasets.{name}.root={root}: no such folder; see data/raw/README.md for what goes where"
        images = dataset.options.get("images")
        if images is not None and not Path(images).is_dir():
            yield f"datasets.{name}.options.images={images}: no such folder"
        if dataset.whitelist is not None and not Path(dataset.whitelist).is_file():
            yield f"datasets.{name}.whitelist={dataset.whitelist}: no such file"
    for name, recording in config.real_noise.recordings.items():
        if recording.folder is not None and not Path(recording.folder).is_dir():
            yield f"real_noise.recordings.{name}.folder={recording.folder}: no such folder; null leaves it out"
    for name, detector in config.detection.detectors.items():
        weights, key = detector.weights, f"detection.detectors.{name}.weights"
        if weights and not _may_be_made(weights, config.root) and not Path(weights).is_file():
            yield f"{key}={weights}: no such file; 'camera-monitor weights list' shows what there is to get"
        elif weights and Path(weights).is_file() and (sentence := in_one_file(key, Path(weights))):
            yield sentence
    for section, estimators in (
        ("noise", config.noise.estimators),
        ("real_noise", config.real_noise.estimators),
        ("blur", config.blur.estimators),
    ):
        for name, estimator in estimators.items():
            for option, value in estimator.options.items():
                absent = option.endswith("weights") and isinstance(value, str) and not Path(value).is_file()
                if absent and not _may_be_made(value, config.root):
                    yield f"{section}.estimators.{name}.options.{option}={value}: no such file"
    if config.psf.source == "paper" and not Path(config.psf.folder).is_dir():
        yield f"psf.folder={config.psf.folder}: no such folder of the paper's kernels"


def _control(section: Any) -> Iterator[str]:
    """What the loop cannot make of its section, and settings of scenarios without effect."""
    from pipeline.control import setup

    made: list[tuple[str, Callable[[], object]]] = [("", partial(setup.designs, section.surface))]
    try:
        limits = setup.limits(section.camera.limits)
    except InputError as error:
        limits = None
        yield f"control.camera.limits: {error}"
    for name, drive in section.scenarios.items():
        key, silent = f"control.scenarios.{name}", drive.fault.silent
        made.append((f"{key}: ", partial(_begins, name, drive, limits)))
        if silent is not None and not silent[0] <= silent[1] < drive.steps:
            yield f"{key}.fault.silent={list(silent)}: expected first and last step, of {drive.steps} from 0"
        if bool(drive.flicker_hz) is not bool(drive.flicker_depth):
            yield f"{key}: flicker_hz={drive.flicker_hz:g} with flicker_depth={drive.flicker_depth:g}, expected both"
    for name, policy in section.policies.items():
        made.append((f"control.policies.{name}.options: ", partial(_takes_options, policy, limits)))
    for prefix, make in made:
        try:
            make()
        except InputError as error:
            yield f"{prefix}{error}"
    for level in section.surface.darker.target_levels:
        if level >= section.surface.target_level:
            yield (
                f"control.surface.darker.target_levels: {level:g} is not darker than target_level, "
                f"{section.surface.target_level:g}"
            )


def _begins(name: str, drive: Any, limits: Any) -> None:
    """Makes a scenario and its first settings; ``limits`` None leaves these out."""
    from pipeline.control import setup

    scenario = setup.scenario(name, drive)
    if limits is not None:
        scenario.first_state(limits)


def _takes_options(policy: Any, limits: Any) -> None:
    """Makes a built-in policy for its checks of options; unknown names are reported by `_kind`."""
    from pipeline.control.policy import ControlledCamera
    from pipeline.control.simulation.loop import make_policy

    registry: Registry = REGISTRIES.get("control")
    if limits is None or not registry.is_builtin(policy.kind):
        return
    known = set(inspect.signature(registry.get(policy.kind)).parameters) - set(FROM_THE_LOOP)
    if set(policy.options) <= known:
        surface: Any = object()  # is not measured yet; no built-in policy asks it before a frame
        make_policy(policy.kind, policy.options, ControlledCamera(limits), surface)


def _may_be_made(path: str, root: str) -> bool:
    """Whether a stage may make a path: below ``data/`` of the profile's root and not below ``data/raw``."""
    parts = Path(path)
    return parts.is_relative_to(Path(root) / STAGE_FOLDER) and not parts.is_relative_to(USER_FOLDER)
