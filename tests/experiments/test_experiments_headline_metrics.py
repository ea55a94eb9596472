"""The headline metrics: gathered from the metrics of stages, few enough for a diff, without leftovers."""

import json
from pathlib import Path

import composed
import pytest

from pipeline.errors import InputError
from pipeline.experiments.headline_metrics import headline

ROOT = Path(__file__).resolve().parents[2]
BLUR = {"calibrated": {"mean_amae_percent": 2.0, "defocus": {}}, "raw": {"mean_amae_percent": 5.0}}
NOISE = {"photon": {"5": {"patch_error_dn": 1.0}, "10": {"patch_error_dn": 2.0}, "15": {"patch_error_dn": None}}}

MEMBERS = {
    "blur": {"sim-spectral", "sim-raw"},
    "noise": {"sim-pca"},
    "curves": {"sim-compact"},
    "regression": {"sim-compact"},
    "closed_loop": {"ramp", "bias"},
}


@pytest.fixture
def metrics(tmp_path):
    for name, content in {
        "blur/sim-spectral": BLUR,
        "blur/sim-renamed": BLUR,
        "blur/sim-raw": {"raw": {"mean_amae_percent": 5.0}},
        "noise/sim-pca": NOISE,
        "curves/sim-compact": {"car": {"clean_ap_percent": 98.26234, "mean_ap_percent": 60.0, "bins": 34}},
        "regression/sim-compact": {"car": {"r2": 0.9, "cells": 42}},
        "closed_loop/ramp": {"fixed": {"ap_percent": 70.0}, "lamp": {"ap_percent": 99.0}},
        "closed_loop/bias": {"fixed": {"ap_percent": 80.0}},
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    return tmp_path


def test_headline_takes_means_of_what_is_configured(metrics):
    content = headline(metrics, {"match": 3, "printed": 9, "aside": 1}, MEMBERS)
    assert content["blur_amae_percent"] == {"sim-raw": 5.0, "sim-spectral": 2.0}  # a leftover file does not count
    assert content["noise_error_dn"] == {"sim-pca": 1.5}
    assert content["ap_percent"] == {"sim-compact": {"car": 98.2623}}
    assert content["regression_r2"] == {"sim-compact": {"car": 0.9}}
    assert content["control_ap_percent"] == {"fixed": 75.0}  # the other policy drives in one scenario only
    assert content["ledger"] == {"printed": 9, "match": 3}


@pytest.mark.parametrize(
    ("stage", "old"),
    [
        ("blur", BLUR),
        ("noise", NOISE),
        ("curves", {"car": {"clean_ap_percent": 1.0, "mean_ap_percent": 1.0}}),
        ("regression", {"car": {"r2": 0.1}}),
        ("closed_loop", {"lamp": {"ap_percent": 1.0}, "fixed": {"ap_percent": 0.0}}),
    ],
)
def test_files_of_members_that_are_configured_no_longer_do_not_count(metrics, stage, old):
    before = headline(metrics, {}, MEMBERS)
    (metrics / stage / "sim-removed.json").write_text(json.dumps(old))
    assert headline(metrics, {}, MEMBERS) == before
    with_it = headline(metrics, {}, MEMBERS | {stage: {*MEMBERS[stage], "sim-removed"}})
    assert with_it != before  # the file would count if it were a member


def test_headline_leaves_out_stages_that_did_not_run_and_refuses_damaged_files(metrics):
    assert headline(metrics / "absent", {"match": 1}, MEMBERS) == {"ledger": {"match": 1}}
    (metrics / "blur/sim-spectral.json").write_text("{")
    with pytest.raises(InputError, match="sim-spectral"):
        headline(metrics, {}, MEMBERS)


def test_dvc_compares_the_headline_only_and_plots_what_exists():
    graph = composed.graph()
    declared = {
        next(iter(path)) for stage in graph["stages"].values() for path in stage.get("do", stage).get("metrics", [])
    }
    assert declared == {"${root}reports/headline.json"}
    plots = [plot if isinstance(plot, str) else next(iter(plot)) for plot in graph["plots"]]
    assert plots and all((ROOT / path).is_file() for path in plots)
    written = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "pipeline").rglob("*.py"))
    axes = {plot[key] for plot in graph["plots"] if isinstance(plot, dict) for plot in plot.values() for key in "xy"}
    assert axes and all(f'"{column}"' in written for column in axes)
