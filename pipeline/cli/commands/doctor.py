"""``camera-monitor doctor``: what is installed, which weights and data are there, and what works with them."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from pipeline.cli.exit_codes import REFUSED

DATASETS = {"sim": "data/sim", "kitti": "data/raw/kitti", "udacity": "data/raw/udacity"}
MEASURED = {
    "expected precision in health": "data/control_surface/all.npz",
    "curves query": "data/curves",
    "report": "reports/index.html",
}


@click.command("doctor")
@click.option("--json", "as_json", is_flag=True, help="print one JSON object")
@click.option("--time", "timed", is_flag=True, help="also measure how long the default estimators take for a frame")
def command(as_json: bool, timed: bool) -> None:
    """State what is installed, which weights are released, which data are present, and what runs with them.

    Exit codes: 0; 2 where a required package or a released weight file is missing or damaged, or a name is registered
    twice.
    """
    from pipeline.cli.package_version import version
    from pipeline.executor import available_cores

    packages, weights = installed_packages(), weight_files()
    problems = [
        f"package {name} is missing" for name, row in packages.items() if row["required"] and not row["version"]
    ]
    problems += [f"{row['file']}: {row['problem']}" for row in weights if row["problem"]]
    clashes = [] if problems else clashing_names()  # the registries import packages
    cameras, without_cameras = stored_cameras()
    content: dict[str, Any] = {
        "version": version(), "python": sys.version.split()[0], "processors": available_cores(), "packages": packages,
        "weights": weights, "detector_weights": detector_weights(), "data": present(DATASETS),
        "measured": present(MEASURED), "cameras": cameras, "cameras_unknown": without_cameras, "stages": stages(),
        "problems": problems, "name_clashes": clashes,
    }  # fmt: skip
    if timed and not problems:
        content["milliseconds_per_frame"] = frame_time()
    if as_json:
        click.echo(json.dumps(content, indent=2, sort_keys=True))
    else:
        for line in lines(content):
            click.echo(line)
    if problems or clashes:
        raise SystemExit(REFUSED)


def installed_packages() -> dict[str, dict[str, Any]]:
    """Packages that this one declares: name -> ``version`` (empty if absent), ``required``, ``extras`` that need it."""
    import re
    from importlib import metadata

    from pipeline.cli.package_version import DISTRIBUTION, version

    try:
        declared = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        declared = []
    packages: dict[str, dict[str, Any]] = {}
    for text in declared:
        match = re.match(r"[A-Za-z0-9._-]+", text)
        if match is None:
            continue
        name = match.group(0)
        extra = re.search(r"extra\s*==\s*['\"]([^'\"]+)['\"]", text)
        row = packages.setdefault(name, {"version": version(name, absent=""), "required": False, "extras": []})
        if extra is None:
            row["required"] = True
        else:
            row["extras"].append(extra.group(1))
    return dict(sorted(packages.items()))


def weight_files() -> list[dict[str, Any]]:
    """Released weight files: ``file``, ``architecture``, ``released``, ``sha256``, and the ``problem`` or empty."""
    from pipeline.errors import InputError
    from pipeline.learning.weights import details as header_of
    from pipeline.learning.weights import is_released, load
    from pipeline.project_files import located
    from pipeline.store import file_sha256

    folder = located("data/weights/mtf_spectral.safetensors").parent
    rows = []
    for path in sorted(folder.glob("[!.]*.safetensors")):
        row: dict[str, Any] = {"file": path.name, "architecture": "", "released": False, "sha256": "", "problem": ""}
        try:
            header = header_of(path)
            load(path, header["architecture"])
            row["architecture"], row["released"] = header["architecture"], is_released(path, header)
            row["sha256"] = file_sha256(path)
        except InputError as error:
            row["problem"] = str(error)
        rows.append(row)
    if not rows:
        rows = [
            {"file": str(folder), "architecture": "", "released": False, "sha256": "", "problem": "no weight files"}
        ]
    return rows


def detector_weights() -> dict[str, bool]:
    """Published detector weights: name -> whether they have been downloaded."""
    from pipeline.cli.data_folders import DETECTOR_WEIGHTS
    from pipeline.detection.weights_table import TABLE

    return {name: (DETECTOR_WEIGHTS / entry.file).is_file() for name, entry in TABLE.items()}


def present(paths: dict[str, str]) -> dict[str, bool]:
    """Name -> whether its file or folder is there, in the current folder or the checkout, and not empty."""
    from pipeline.project_files import located

    def there(path: Path) -> bool:
        return any(path.iterdir()) if path.is_dir() else path.is_file()

    return {name: there(Path(path)) or there(located(path)) for name, path in paths.items()}


def stored_cameras() -> tuple[list[str], str]:
    """Names of the calibrated cameras, and why they are unknown; that is empty where they are known."""
    from pipeline.cli.calibration import camera_store
    from pipeline.errors import InputError

    try:
        return camera_store.names(), ""
    except InputError as error:
        return [], str(error)


def clashing_names() -> list[str]:
    """Sentences on names that installed packages register, but that are built in or another package's."""
    from pipeline.config.name_clashes import name_clashes
    from pipeline.config.references import REGISTRIES

    return [sentence for name in REGISTRIES.names() for sentence in name_clashes(REGISTRIES.get(name)).values()]


def stages() -> dict[str, int]:
    """Stages of the study: ``recorded`` in ``dvc.lock`` of the checkout; empty outside of one."""
    from pipeline import yaml_text
    from pipeline.project_files import located

    lock = located("dvc.lock")
    if not lock.is_file():
        return {}
    return {"recorded": len(yaml_text.parse(lock.read_text(encoding="utf-8")).get("stages", {}))}


def frame_time(width_px: int = 1280, height_px: int = 720) -> float:
    """Milliseconds that the default estimators take for one frame on one thread, the faster of two runs.

    Args:
        width_px: of the frame, which is a picture of random structure.
        height_px: likewise.
    """
    import numpy as np

    from pipeline.condition import ConditionMonitor
    from pipeline.executor import one_thread
    from pipeline.streams import stream

    one_thread()
    generator = stream(0, "doctor", "frame")
    coarse = generator.random((-(-height_px // 16), -(-width_px // 16)))
    image = np.kron(coarse, np.ones((16, 16)))[:height_px, :width_px] * 0.7 + 0.1
    image = np.clip(image + generator.normal(0, 0.01, image.shape), 0, 1).astype(np.float32)
    monitor = ConditionMonitor()
    return round(min(monitor.frame(image).milliseconds for _ in range(2)), 1)


def lines(content: dict[str, Any]) -> list[str]:
    """The content as text."""
    packages = content["packages"]
    required = [row for row in packages.values() if row["required"]]
    text = [
        f"version {content['version']}, Python {content['python']}, {content['processors']} processors",
        f"packages: {sum(bool(row['version']) for row in required)} of {len(required)} required ones installed",
    ]
    extras = sorted({extra for row in packages.values() for extra in row["extras"]})
    for extra in extras:
        missing = [name for name, row in packages.items() if extra in row["extras"] and not row["version"]]
        text.append(f"  extra {extra:8} {'installed' if not missing else 'without ' + ', '.join(missing)}")
    text.append("weights:")
    for row in content["weights"]:
        state = row["problem"] or ("released" if row.get("released") else "NOT RELEASED")
        text.append(f"  {row['file']:38} {state:14} {row['sha256'][:12]}")
    absent = [name for name, there in content["detector_weights"].items() if not there]
    count = len(content["detector_weights"])
    text.append(
        f"published detectors: {count - len(absent)} of {count} downloaded"
        + (f"; camera-monitor weights get {absent[0]}" if absent else "")
    )
    for title, part in (("data", "data"), ("measured", "measured")):
        text.append(f"{title}:")
        text += [f"  {name:30} {'present' if there else 'absent'}" for name, there in content[part].items()]
    unknown = content["cameras_unknown"]
    text.append(f"calibrated cameras: {f'unknown; {unknown}' if unknown else ', '.join(content['cameras']) or 'none'}")
    if content["stages"]:
        text.append(
            f"study: {content['stages']['recorded']} stages recorded in dvc.lock; `dvc status` names those to run"
        )
    if "milliseconds_per_frame" in content:
        text.append(f"health: {content['milliseconds_per_frame']:.0f} ms for a frame of 1280 x 720 px on one thread")
    works = not content["problems"]
    text += [f"problem: {problem}" for problem in content["problems"] + content["name_clashes"]] or ["no problem"]
    text.append(f"health, watch, noise, corrupt, calibrate: {'ready' if works else 'not ready'}")
    return text
