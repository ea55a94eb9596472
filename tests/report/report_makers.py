"""Small synthetic outputs of the stages before the report, written as those stages write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import store, tables
from pipeline.report.inputs import ReportInputs
from pipeline.streams import stream

REPO = Path(__file__).resolve().parents[2]
EFFECTS = ("photon", "dcsn", "readout", "combined")
LEVELS_DN = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)
ESTIMATORS = {"pca": 1.0, "bf": 0.6, "wavelet": 1.05, "immerkaer": 0.93}
SHARES = {**ESTIMATORS, "cellwise": 1.0}
FREQUENCY = np.array([3, 6, 8, 11, 16, 22, 27, 33]) * 2 / 111
ABSENT = {"kitti": "dvc exp run -S datasets.kitti.root=/path/to/kitti", "udacity": "dvc exp run -S datasets=udacity"}


def picture(name: str, shape: tuple[int, int] = (192, 256)) -> np.ndarray:
    """A smooth random field with edges, uint8."""
    import cv2

    generator = stream(0, "picture", name)
    field = sum(
        cv2.resize(generator.normal(size=(2 + 2**k, 2 + 2**k)), shape[::-1], interpolation=cv2.INTER_CUBIC) / 1.6**k
        for k in range(1, 7)
    )
    return np.clip(120 + 45 * np.asarray(field), 0, 255).astype(np.uint8)


def make_index(folder: Path, dataset: str, frames: int = 5, quarantined: int = 2) -> None:
    """Frames, patches, quarantine and samples of one dataset."""
    generator = stream(0, "index", dataset)
    names = [f"{dataset}-{number:04d}" for number in range(frames)]
    rows = []
    for name in names:
        numbers = {column: float(generator.uniform(0.1, 0.9)) for column in tables.FRAMES.columns}
        numbers |= {"mean_dn": float(generator.normal(110, 9)), "std_dn": float(generator.normal(55, 5))}
        numbers |= {
            "gradient_mean_dn": float(generator.normal(14, 1)),
            "gradient_p99_dn": float(generator.normal(80, 5)),
        }
        numbers |= {"spectrum_slope": float(generator.normal(-2.4, 0.1))}
        rows.append({**numbers, "dataset": dataset, "frame": name, "split": "all", "width_px": 256, "height_px": 192})
        rows[-1] |= {"objects": 3, "objects_ignored": 1, "previous_frames": 0}
    store.write_table(folder / "frames.parquet", pd.DataFrame(rows)[list(tables.FRAMES.columns)], tables.FRAMES)
    patches = [
        {
            "dataset": dataset, "frame": name, "purpose": purpose, "patch": number, "x_px": 20 + 90 * number,
            "y_px": 40, "size_px": 96, "label": "car" if purpose == "blur" else "",
        }
        for name in names for purpose, count in (("blur", 1), ("noise", 2)) for number in range(count)
    ]  # fmt: skip
    store.write_table(folder / "patches.parquet", pd.DataFrame(patches), tables.PATCHES)
    bad = pd.DataFrame(
        [
            {"dataset": dataset, "file": f"/somewhere/else/bad-{number}.png", "reason": "truncated picture"}
            for number in range(quarantined)
        ],
        columns=list(tables.QUARANTINE.columns),
    )
    store.write_table(folder / "quarantine.parquet", bad, tables.QUARANTINE)
    store.write_arrays(folder / "samples.npz", **{f"frame_{name}": picture(name) for name in names[:4]})
    boxes = [
        {"label": "car", "x1": 30.0, "y1": 60.0, "x2": 110.0, "y2": 120.0, "ignore": False},
        {"label": "person", "x1": 150.0, "y1": 50.0, "x2": 170.0, "y2": 110.0, "ignore": True},
    ]
    store.write_json(folder / "samples.json", dict.fromkeys(names[:4], boxes))


def make_psf(folder: Path, sizes: tuple[int, ...] = (3, 7, 11)) -> None:
    """A bank of plain kernels: discs, lines and crooked lines."""
    kernels, rows = {}, []
    for kind, angles in (
        ("defocus", (0,)),
        ("linear_motion", (0, 45, 90, 135)),
        ("nonlinear_motion", (0, 45, 90, 135)),
    ):
        for size in sizes:
            for angle in angles:
                name = f"{kind}-{size}-{angle}"
                kernels[name] = _kernel(kind, size, angle)
                for axis, turned in (("H", kernels[name].sum(axis=0)), ("V", kernels[name].sum(axis=1))):
                    spectrum = np.abs(np.fft.fft(turned, 111))[[3, 6, 8, 11, 16, 22, 27, 33]]
                    rows += [
                        {
                            "kernel": name, "blur_kind": kind, "kernel_size_px": size, "angle_deg": float(angle),
                            "source": "generated", "axis": axis, "frequency": frequency, "mtf": value,
                        }
                        for frequency, value in zip(FREQUENCY, spectrum, strict=True)
                    ]  # fmt: skip
    store.write_table(folder / "kernels.parquet", pd.DataFrame(rows), tables.KERNELS)
    store.write_arrays(folder / "kernels.npz", **kernels)


def _kernel(kind: str, size: int, angle: float) -> np.ndarray:
    side = 2 * size + 1
    y, x = np.mgrid[:side, :side] - size
    turn = np.deg2rad(angle)
    along, across = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    if kind == "defocus":
        kernel = np.hypot(x, y) <= size / 2
    elif kind == "linear_motion":
        kernel = (np.abs(along) <= size / 2) & (np.abs(across) < 0.75)
    else:
        kernel = (np.abs(along) <= size / 2) & (np.abs(across - 0.15 * size * np.sin(5 * along / size)) < 0.75)
    return kernel / kernel.sum()


def make_corrupt(folder: Path, dataset: str, frames: int = 4) -> None:
    """Corruption truth and gallery of one dataset."""
    generator = stream(0, "corrupt", dataset)
    rows = []
    for noise_source in EFFECTS:
        for level in LEVELS_DN:
            for number in range(frames):
                rows.append(
                    {
                        "dataset": dataset, "frame": f"{dataset}-{number:04d}", "noise_source": noise_source,
                        "target_sigma_dn": level,
                        "noise_scale": 1.0, "unclipped_sigma_dn": level, "shift_dn": 0.0, "clipped_fraction": 0.01,
                        "clipped_sigma_dn": level * float(generator.uniform(0.92, 0.99)),
                        "temperature_k": 300.0, "exposure_s": 0.1,
                    }
                )  # fmt: skip
    store.write_table(folder / "corruption.parquet", pd.DataFrame(rows), tables.CORRUPTION)
    clean = picture(f"gallery-{dataset}", (96, 96)).astype(float)
    arrays, effects = {}, []
    for noise_source in EFFECTS:
        for level in LEVELS_DN:
            name = f"{noise_source}_{level:g}"
            arrays[name] = np.clip(clean + level * generator.normal(size=clean.shape), 0, 255).round().astype(np.uint8)
            effects.append({"array": name, "noise_source": noise_source, "target_sigma_dn": level})
    chain, current = [], clean
    for step in ("Scene", "Photon", "Optics", "Dark current", "Readout", "Quantisation"):
        current = current if step in ("Scene", "Quantisation") else current + 3 * generator.normal(size=clean.shape)
        arrays[f"chain_{step}"] = np.clip(current, 0, 255).round().astype(np.uint8)
        chain.append({"array": f"chain_{step}", "title": step, "caption": ""})
    store.write_arrays(folder / "gallery.npz", **arrays)
    store.write_json(folder / "gallery.json", {"frame": f"{dataset}-0000", "chain": chain, "effects": effects})


def make_noise(folder: Path, dataset: str, estimator: str, patches: int = 12) -> None:
    """Estimates and summary of one noise estimator on one dataset."""
    generator = stream(0, "noise", dataset, estimator)
    estimates, summary = [], []
    for noise_source in EFFECTS:
        for level in LEVELS_DN:
            true = level * 0.95
            values = SHARES[estimator] * true + 1.0 + generator.normal(scale=0.6, size=patches)
            values[:2] = np.nan if estimator in ("pca", "wavelet") else values[:2]
            key = {"dataset": dataset, "estimator": estimator, "noise_source": noise_source, "target_sigma_dn": level}
            estimates += [
                {
                    **key, "frame": f"{dataset}-0000", "patch": number, "clipped_sigma_dn": true, "sigma_dn": value,
                    "unclipped_sigma_dn": level, "saturated_fraction": 0.9 if number == 2 else 0.0,
                    "low_dn": value - 1.5 if estimator == "cellwise" else np.nan,
                    "high_dn": value + 1.5 if estimator == "cellwise" else np.nan, "abstained": bool(np.isnan(value)),
                    "reason": "saturated" if np.isnan(value) else "",
                }
                for number, value in enumerate(values)
            ]  # fmt: skip
            selected = values[np.isfinite(values)]
            summary.append(
                {
                    **key, "median_dn": np.median(selected), "minimum_dn": selected.min(), "maximum_dn": selected.max(),
                    "low_dn": np.median(selected) - 0.3, "high_dn": np.median(selected) + 0.3,
                    "clipped_median_dn": true,
                    "patch_error_dn": np.abs(selected - true).mean(), "count": len(selected), "rejected": 1,
                    "unclipped_median_dn": level, "unclipped_error_dn": np.abs(selected - level).mean(),
                    "coverage": np.mean(np.abs(selected - level) <= 1.5) if estimator == "cellwise" else np.nan,
                    "abstained": patches - len(selected),
                }
            )  # fmt: skip
    position = folder / f"{dataset}-{estimator}"
    store.write_table(position / "estimates.parquet", pd.DataFrame(estimates), tables.NOISE_ESTIMATES)
    store.write_table(position / "summary.parquet", pd.DataFrame(summary), tables.NOISE_SUMMARY)


def make_star(folder: Path) -> None:
    """A Siemens star and two curves that differ by 0.002."""
    y, x = np.mgrid[-128:128, -128:128] + 0.5
    image = np.clip(0.5 + 0.4 * np.sin(36 * np.arctan2(y, x)) * (np.hypot(x, y) < 126), 0, 1)
    frequency = np.arange(1, 11) / 10
    formula = np.exp(-1.1 * frequency**2)
    store.write_arrays(folder / "star.npz", image=np.rint(255 * image).astype(np.uint8))
    store.write_json(folder / "star.json", {"frequency": frequency, "measured": formula + 0.002, "formula": formula})


def make_sensor(folder: Path) -> None:
    """Constants equal to the published ones but one, and a photon-transfer curve."""
    published = pd.read_csv(REPO / "data/paper/image_formation.csv")
    numbers = dict(zip(published["quantity"], published["value"], strict=True))
    numbers["source_follower_std_e"] = 6.1
    store.write_json(folder / "formation.json", numbers)
    mean = np.linspace(12, 204, 12)
    curve = {"mean_dn": mean, "variance_dn2": 0.01275 * mean + 0.9, "slope_dn_per_e": 0.01276, "offset_dn2": 0.9}
    store.write_json(folder / "photon_transfer.json", {**curve, "gain_dn_per_e": 0.01275})


LOCK = """schema: '2.0'
stages:
  noise@sim-pca:
    cmd: python -m pipeline.stages.noise
    deps:
    - {path: data/index/sim, hash: md5, md5: 0123456789abcdef0123456789abcdef.dir, size: 1}
    - {path: /home/someone/secret/kitti, hash: md5, md5: ffffffffffffffffffffffffffffffff, size: 1}
    params:
      params.yaml:
        seed: 1
        noise.tile_px: 128
"""


def make_all(
    root: Path, datasets: tuple[str, ...] = ("sim", "photos"), estimators: tuple[str, ...] = tuple(ESTIMATORS)
) -> ReportInputs:
    """Everything a report can show at this stage, small."""
    for dataset in datasets:
        make_index(root / "index" / dataset, dataset)
        make_corrupt(root / "corrupt" / dataset, dataset)
        for estimator in estimators:
            make_noise(root / "noise", dataset, estimator)
    make_psf(root / "psf")
    make_star(root / "star")
    make_sensor(root / "sensor")
    store.write_text(root / "dvc.lock", LOCK)
    return ReportInputs(
        paper=REPO / "data/paper",
        data=root,
        absent=ABSENT,
        lock=root / "dvc.lock",
        code_version="0.1.0",
        profile="smoke",
    )
