"""Stage outputs of control, small and from formulas: two scenarios, a surface, both examples and the order study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import store
from pipeline.control.simulation.tables import CONTROLLER_AP, EXAMPLE_STEPS, KNOTS, PAIRS, RESPONSE, STEPS, SUMMARY
from pipeline.experiments.order_study import EFFECTS, STUDY

PAPER = Path(__file__).resolve().parents[2] / "data/paper"
POLICIES = ("fixed", "mean_intensity", "shim", "shin2019", "iopc_optimal", "iopc_continuous", "oracle")
AP = dict(zip(POLICIES, (40.0, 60.0, 55.0, 50.0, 78.0, 80.0, 82.0), strict=True))
N_STEPS = 6
PICTURE = np.tile(np.arange(200, dtype=np.uint8), (150, 1))


def make_scenario(root: Path, name: str, speed_px_s: float, margin: float, light_factor: float = 1.0) -> None:
    """One scenario: `margin` is half the width of every interval; from the third step on the light is another."""
    folder = root / "closed_loop" / name
    steps = [
        {
            "scenario": name, "policy": policy, "fold": fold, "step": step,
            "light": 0.2 * (light_factor if step > 2 else 1.0), "speed_px_s": speed_px_s,
            "exposure_ms": 8.0 / (1 + step), "iso": 100.0 * (1 + step), "motion_px": speed_px_s * 8e-3 / (1 + step),
            "sigma_dn": 4.0 + step, "mean_level": 0.5, "saturated_fraction": 0.0,
            "estimated_sigma_dn": 4.5 + step if policy.startswith("iopc") else np.nan,
            "estimated_motion_px": 3.0 if policy.startswith("iopc") else np.nan, "action": "move", "reason": "made",
            "expected_ap_percent": np.nan, "ap_percent": AP[policy] + fold,
        }
        for policy in POLICIES for fold in (0, 1) for step in range(N_STEPS)
    ]  # fmt: skip
    summary = [
        {
            "scenario": name, "policy": policy, "ap_percent": ap, "low_percent": ap - margin,
            "high_percent": ap + margin, "regret_percent": AP["oracle"] - ap, "regret_low_percent": 0.0,
            "regret_high_percent": 9.0, "settling_frames": np.nan if policy == "shin2019" else 2.0,
            "overshoot_stops": 0.1, "ripple_stops": 0.02, "frames_lost_percent": 10.0, "abstained_percent": 0.0,
            "refused_percent": 5.0, "probes_percent": 0.0, "objects": 30, "frames": 24,
            "motion_in_poor_light": speed_px_s >= 100.0,
        }
        for policy, ap in AP.items()
    ]  # fmt: skip
    pairs = [
        {
            "scenario": name, "policy": one, "other": other, "difference_percent": AP[one] - AP[other],
            "low_percent": AP[one] - AP[other] - margin, "high_percent": AP[one] - AP[other] + margin,
        }
        for one in POLICIES for other in POLICIES if one != other
    ]  # fmt: skip
    store.write_table(folder / "steps.parquet", pd.DataFrame(steps), STEPS)
    store.write_table(folder / "summary.parquet", pd.DataFrame(summary), SUMMARY)
    store.write_table(folder / "pairs.parquet", pd.DataFrame(pairs), PAIRS)
    for policy in ("mean_intensity", "iopc_continuous"):
        store.write_arrays(folder / f"film-{policy}.npz", step_00=PICTURE, step_05=PICTURE // 2)


def make_surface(root: Path, raised: bool = False) -> None:
    """AP that falls by 10 points per knot; with `raised` the last knot is far above its neighbours."""
    rows = []
    for row, level in enumerate((0.0, 10.0)):
        for column, motion in enumerate((0.0, 7.0, 15.0)):
            ap = 99.0 if raised and row == 1 and column == 2 else 90.0 - 10.0 * (row + column)
            rows.append(
                {
                    "fold": -1, "level": 0.5, "target_sigma_dn": level, "motion_px": motion, "sigma_dn": level + 1.0,
                    "true_sigma_dn": level, "mtf": 0.9, "ap_percent": ap, "low_percent": ap - 2, "high_percent": ap + 2,
                    "objects": 20, "estimates": 8, "estimates_abstained": row,
                }
            )  # fmt: skip
    dark = [{**row, "level": 0.25} for row in rows if row["target_sigma_dn"] == 0.0]
    dark += [{**row, "target_sigma_dn": 8.0, "ap_percent": row["ap_percent"] - 20.0} for row in dark]
    store.write_table(root / "control_surface/knots.parquet", pd.DataFrame([*rows, *dark]), KNOTS)


def make_examples(root: Path, precision: tuple[float, float, float] = (30.0, 50.0, 70.0)) -> None:
    """Examples whose response is the published one, 0.03 ms off."""
    folder = root / "worked_examples"
    names = [("sim_yolov4_car", "reference"), ("sim_yolov4_car", "corrupted"), ("sim_yolov4_car", "final")]
    names += [("robot", "initial"), ("robot", "final"), ("robot", "built_in_10"), ("robot", "built_in_18")]
    steps = [
        {
            "example": example, "step": step, "exposure_ms": 4.0, "iso": 100.0 * number + 100.0, "sigma_dn": 5.0,
            "mtf_at_0.1": 0.9, "blur_px": 3.0, "detection_score": 0.5, "estimated_blur_px": 2.9, "ap_percent": 60.0,
            "low_percent": 50.0, "high_percent": 70.0,
        }
        for number, (example, step) in enumerate(names)
    ]  # fmt: skip
    store.write_table(folder / "steps.parquet", pd.DataFrame(steps), EXAMPLE_STEPS)
    paper = pd.read_csv(PAPER / "controller_response.csv")
    off = np.where(paper["time_ms"] > 4700, 0.2, 0.03)
    shift = np.where((paper["controller"] == "camera_default") & (paper["quantity"] == "exposure_ms"), off, 0.0)
    store.write_table(folder / "response.parquet", paper.assign(value=paper["value"] + shift), RESPONSE)
    controllers = ("camera_default", "fixed_parameters", "proposed")
    table = pd.DataFrame({"controller": controllers, "car_ap_percent": precision})
    table = table.assign(low_percent=table["car_ap_percent"] - 5, high_percent=table["car_ap_percent"] + 5)
    store.write_table(folder / "precision.parquet", table, CONTROLLER_AP)
    store.write_arrays(folder / "pictures.npz", **{f"{example}_{step}": PICTURE for example, step in names})
    entries = [
        {"array": f"{example}_{step}", "example": example, "step": step, "score": 0.5 * (step != "corrupted"),
         "box": None if step == "corrupted" else [20.0, 20.0, 90.0, 80.0]}
        for example, step in names
    ]  # fmt: skip
    about = {"view": "made-0", "label": "car", "box": [22.0, 18.0, 88.0, 82.0], "steps": entries}
    store.write_json(folder / "pictures.json", about)


def study(kept_detector: float = 1.0) -> pd.DataFrame:
    """Order study in which the paper's order keeps 30 % of the noise under motion, the detector's `kept_detector`."""
    rows = []
    for light in ("encoded", "linear"):
        for order, kept in (("paper", 0.3), ("detector", kept_detector)):
            for motion in (0.0, 21.0):
                for level in (5.0, 15.0):
                    present = level * (kept if motion else 1.0)
                    amae = 5.0 + (level if motion else 0.0)
                    ap = 95.0 - 2.0 * level - motion
                    rows.append(
                        {
                            "order": order, "light": light, "motion_px": motion, "target_sigma_dn": level,
                            "clipped_sigma_dn": present, "estimated_sigma_dn": present, "sigma_low_dn": present - 0.1,
                            "sigma_high_dn": present + 0.1, "amae_percent": amae, "amae_low_percent": amae - 1,
                            "amae_high_percent": amae + 1, "ap_percent": ap, "ap_low_percent": ap - 3,
                            "ap_high_percent": ap + 3, "frames": 8, "blur_abstained": 0, "noise_abstained": 0,
                        }
                    )  # fmt: skip
    return pd.DataFrame(rows)


def effects(noise_hurts: bool = True) -> pd.DataFrame:
    """Effects: noise raises AMAE by 8 to 12 points, or its interval includes 0; AP falls by 10 to 30 points."""
    rows = []
    for light in ("encoded", "linear"):
        for order in ("paper", "detector"):
            for cause, measure, change in (
                ("noise", "amae_percent", 10.0 if noise_hurts else 1.0),
                ("noise", "ap_percent", -20.0),
                ("motion", "amae_percent", 1.0),
                ("motion", "ap_percent", -21.0),
            ):
                half = 2.0 if measure == "amae_percent" else 10.0
                rows.append(
                    {
                        "order": order, "light": light, "cause": cause, "measure": measure, "before": 50.0,
                        "after": 50.0 + change, "change": change, "low": change - half, "high": change + half,
                    }
                )  # fmt: skip
    return pd.DataFrame(rows)


def make_order_study(root: Path) -> None:
    """Both tables of the order study."""
    store.write_table(root / "order_study/study.parquet", study(), STUDY)
    store.write_table(root / "order_study/effects.parquet", effects(), EFFECTS)


def make_all(root: Path) -> Path:
    """Every output; the folder for `ReportInputs.control`."""
    make_scenario(root, "dusk_drive", 1000.0, 5.0)
    make_scenario(root, "standing", 0.0, 5.0)
    make_surface(root)
    make_examples(root)
    make_order_study(root)
    return root
