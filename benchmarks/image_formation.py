"""Forming one corrupted frame: this package beside its peers and the paper's program, one thread.

    python benchmarks/image_formation.py [--out FILE] [--repeats N] [--authors FOLDER] [--note TEXT]

Three comparisons on one 1242 x 375 frame:

* ``equal physics``: 21 px disc with mirrored borders, then Poisson and normal noise, then 8 bit. Everyone's frame must
  have the mean and the variance that theory gives before it is timed; who differs in physics is timed and marked.
* ``full chain``: photon noise, 21 px disc, dark current, readout, scaled to 10 DN, 8 bit, beside the paper's program
  (all noises, then the blur), from a checkout of its repository given by ``--authors``.
* ``sources``: each of the paper's effects alone, without blur, beside the same program.

Times are least and median of the turns, on the clock and of the processor. Ratios are peer over ours by least processor
time; below 1 we lose. Peers that are not installed are named as absent. ``recorded`` holds times of the paper's program
on another machine: no ratio is formed with them. All run in one process, after the memory
setting of `pipeline.camera.blocks`, from which peers gain as well.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline.camera import chain, corruption  # noqa: E402
from pipeline.camera.blur import blur  # noqa: E402
from pipeline.camera.photon import photon_shot  # noqa: E402
from pipeline.camera.psf import create  # noqa: E402
from pipeline.camera.quantise import digitise, full_range  # noqa: E402
from pipeline.camera.readout import read_noise  # noqa: E402
from pipeline.camera.sensor import Sensor  # noqa: E402
from pipeline.streams import stream, torch_stream  # noqa: E402

SHAPE = (375, 1242)
SIZE_PX = 21
TEMPERATURE_K = 330.0
SIGMA_DN = 10.0
RECORDED_MS = {"photon": 65.0, "dcsn": 92.0, "readout": 201.0, "combined": 305.0, "blur": 10.0}
RECORDED_FULL_CHAIN_MS = 315.0
Call = Callable[[], np.ndarray]


def scene() -> np.ndarray:
    """A smooth frame, about 40 to 215 DN, on the 8-bit grid: (375, 1242) float32."""
    coarse = stream(0, "image formation benchmark").random((13, 40), dtype=np.float32)
    import cv2

    fine = cv2.resize(coarse, SHAPE[::-1], interpolation=cv2.INTER_CUBIC)
    return full_range(np.rint(np.clip(40 + 175 * fine, 0, 255)))


def equal_physics(image: np.ndarray, psf: np.ndarray) -> dict[str, dict[str, Any]]:
    """Contestants of the first comparison: name -> ``call`` and notes, or ``status`` why there is none."""
    import cv2
    import torch

    sensor = Sensor()
    read_e = sensor.readout_sigma_e(TEMPERATURE_K)
    full_e = sensor.full_well_e
    draws = stream(1, "image formation benchmark")
    torch_draws = torch_stream(1, "image formation benchmark")
    fast = np.random.Generator(np.random.SFC64(1))
    tensor = torch.from_numpy(image)[None, None]
    filter_ = torch.from_numpy(psf)[None, None]

    def ours(method: Any) -> np.ndarray:
        electrons = photon_shot(sensor.electrons(blur(image, psf)), draws, method)
        electrons += read_noise(electrons.shape, sensor, TEMPERATURE_K, draws)
        return full_range(digitise(electrons, sensor, out=electrons), out=electrons)

    def eight_bit(out: Any) -> np.ndarray:
        return (out * 255).round_().clamp_(0, 255).div_(255)[0, 0].numpy()

    def plain_numpy() -> np.ndarray:
        blurred = cv2.filter2D(image, -1, psf[::-1, ::-1], borderType=cv2.BORDER_REFLECT_101)
        electrons = fast.poisson(blurred * np.float32(full_e)).astype(np.float32)
        electrons += fast.standard_normal(electrons.shape, np.float32) * np.float32(read_e)
        return np.clip(np.rint(electrons * np.float32(255 / full_e)), 0, 255) / np.float32(255)

    def plain_torch() -> np.ndarray:
        blurred = blur(tensor, psf)
        electrons = torch.poisson(blurred.mul_(full_e), generator=torch_draws)
        electrons += torch.empty_like(electrons).normal_(0, read_e, generator=torch_draws)
        return eight_bit(electrons.div_(full_e))

    results: dict[str, dict[str, Any]] = {
        "ours, exact Poisson": {"call": lambda: ours("exact")},
        "ours, hybrid": {"call": lambda: ours("hybrid"), "physics": "normal approximation from 64 electrons"},
        "numpy: cv2.filter2D, SFC64 Poisson and normal": {"call": plain_numpy},
        "torch: our blur of a tensor, torch.poisson, normal_": {"call": plain_torch},
    }
    try:
        from deepinv.physics import Blur, BlurFFT, PoissonGaussianNoise
    except (ImportError, RuntimeError) as error:
        results["deepinv"] = {"status": f"absent: {error}"}
        return results
    rng = torch.Generator().manual_seed(1)
    noise = PoissonGaussianNoise(gain=1 / full_e, sigma=read_e / full_e, rng=rng)
    plain = Blur(filter=filter_, padding="reflect", noise_model=noise)
    fourier = Blur(filter=filter_, padding="reflect", use_fft=True, noise_model=noise)
    circular = BlurFFT(img_size=(1, *SHAPE), filter=filter_, noise_model=noise)
    for name, physics, note in (
        ("deepinv Blur(reflect) + PoissonGaussianNoise", plain, ""),
        ("deepinv Blur(reflect, use_fft) + PoissonGaussianNoise", fourier, ""),
        ("deepinv BlurFFT + PoissonGaussianNoise", circular, "circular border"),
    ):
        results[name] = {"call": lambda physics=physics: eight_bit(physics(tensor)), "physics": note}
    return results


def check(image: np.ndarray, psf: np.ndarray, call: Call) -> dict[str, Any]:
    """Whether frames have the mean and variance of the physics, away from the border.

    Returns:
        largest difference of a row mean from theory in standard errors over 4 frames, and the variance over its theory.
    """
    sensor = Sensor()
    inner = (slice(20, -20), slice(20, -20))
    clean = blur(image, psf)[inner].astype(np.float64) * 255
    gain = sensor.dn_per_electron
    variance = gain * clean + (gain * sensor.readout_sigma_e(TEMPERATURE_K)) ** 2 + 1 / 12
    score = np.stack([(call()[inner] * 255.0 - clean) / np.sqrt(variance) for _ in range(4)])
    rows = score.mean(axis=(0, 2)) * np.sqrt(4 * score.shape[2])
    return {
        "largest_row_mean_in_standard_errors": round(float(np.abs(rows).max()), 2),
        "variance_over_theory": round(float(score.var()), 4),
    }


def authors_program(folder: Path | None) -> tuple[Any, Any] | str:
    """The paper's noise and blur modules, or why there are none."""
    if folder is None:
        return "absent: give its checkout by --authors"
    modules = []
    for name in ("noise/simulation/generateHighLevelNoise.py", "blur/simulation/simulateDefocusBlur.py"):
        path = folder / name
        if not path.exists():
            return f"absent: no {name} in the folder given by --authors"
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if spec is None or spec.loader is None:
            return f"absent: {name} cannot be imported"
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        modules.append(module)
    return modules[0], modules[1]


def with_ratios(times: Mapping[str, Mapping[str, Any]], ours: str) -> dict[str, dict[str, Any]]:
    """Add each contestant's ratio to ours, by least processor time."""
    base = times[ours]["processor_least_ms"]
    return {name: {**record, "ratio": round(record["processor_least_ms"] / base, 2)} for name, record in times.items()}


def summary(record: Mapping[str, Any]) -> str:
    """One line of a record for the screen."""
    if "processor_least_ms" not in record:
        return f"{record.get('least_ms', '')} {record.get('status', '')}"
    return (
        f"{record['least_ms']:8.2f} ms   processor {record['processor_least_ms']:8.2f} ms   "
        f"median {record['processor_median_ms']:8.2f}   x {record['ratio']}  {record.get('status', '')}"
    )


def main() -> None:
    """Check, time, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=None)
    parser.add_argument("--repeats", type=int, default=40)
    parser.add_argument("--authors", type=Path, default=None, help="checkout of the paper's repository")
    parser.add_argument("--note", default="", help="recorded with the result")
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    image, psf = scene(), create("defocus", SIZE_PX)
    results: dict[str, dict[str, dict[str, Any]]] = {}

    contestants = equal_physics(image, psf)
    records: dict[str, dict[str, Any]] = {}
    for name, entry in contestants.items():
        records[name] = {key: value for key, value in entry.items() if key != "call" and value}
        if "call" in entry:
            records[name] |= {"status": "ok", **check(image, psf, entry["call"])}
            if abs(records[name]["variance_over_theory"] - 1) > 0.02 or (
                records[name]["largest_row_mean_in_standard_errors"] > 5
            ):
                records[name]["status"] = "other output than theory"
    calls = {name: entry["call"] for name, entry in contestants.items() if "call" in entry}
    for name, times in with_ratios(common.take_turns(calls, arguments.repeats), "ours, exact Poisson").items():
        records[name] |= times
    results["equal physics"] = records

    def ours(noise_source: str, kernel: np.ndarray | None, poisson: Any = "exact") -> Callable[[], object]:
        key = (2, "image formation benchmark", noise_source)
        return lambda: corruption.corrupt(
            image, noise_source, sigma_dn=SIGMA_DN, generator=stream(*key), psf=kernel, poisson=poisson
        )

    program = authors_program(arguments.authors)
    theirs: dict[str, Callable[[], object]] = {}
    if not isinstance(program, str):
        noises, blurs = program
        names = {
            "photon": "applyPhotonNoise",
            "dcsn": "applyDarkCurrentShotNoise",
            "readout": "applyReadNoise",
            "combined": "applyPhotonDarkReadNoise",
        }
        for noise_source, name in names.items():
            theirs[noise_source] = partial(getattr(noises, name), image, SIGMA_DN)
        eight = np.rint(image * 255).astype(np.uint8)
        theirs["blur"] = lambda: blurs.addDefocusBlur(eight, SIZE_PX)

    natural = chain.PRESETS["combined"]
    full: dict[str, Callable[[], object]] = {
        "ours, exact Poisson": ours("combined", psf),
        "ours, hybrid": ours("combined", psf, "hybrid"),
        "ours, exact, natural size": lambda: chain.expose(
            image, natural, stream(2, "image formation benchmark", "natural"), psf=psf
        ),
    }
    if theirs:
        full["the paper's program"] = lambda: (theirs["combined"](), theirs["blur"]())
    measured: dict[str, dict[str, Any]] = with_ratios(common.take_turns(full, arguments.repeats), "ours, exact Poisson")
    if isinstance(program, str):
        measured["the paper's program"] = {"status": program}
    measured["the paper's program, recorded"] = {
        "status": "another machine",
        "least_ms": RECORDED_FULL_CHAIN_MS,
        "a_twentieth_ms": RECORDED_FULL_CHAIN_MS / 20,
    }
    results["full chain"] = measured

    results["sources"] = {}
    for noise_source in ("photon", "dcsn", "readout", "combined"):
        pair: dict[str, Callable[[], object]] = {"ours": ours(noise_source, None)}
        if noise_source in theirs:
            pair["the paper's program"] = theirs[noise_source]
        for name, record in with_ratios(common.take_turns(pair, arguments.repeats), "ours").items():
            results["sources"][f"{noise_source}: {name}"] = record
        results["sources"][f"{noise_source}: recorded"] = {
            "status": "another machine",
            "least_ms": RECORDED_MS[noise_source],
        }

    for group, table in results.items():
        for name, record in table.items():
            print(f"{group:14s}{name:58s}{summary(record)}", flush=True)
    about = common.machine("torch", "opencv-python-headless", "deepinv")
    settings = {"frame": "1242x375", "kernel": f"disc of {SIZE_PX} px", "sigma_dn": SIGMA_DN, "note": arguments.note}
    path = common.write("image_formation", {"machine": about, "settings": settings, "results": results}, arguments.out)
    print("written:", path)


if __name__ == "__main__":
    common.run(main)
