"""Stage `report`: tables, figures, ledger and the page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.config.entry import Run, stage

READS = [
    "profile", "seed", "camera", "scenes", "datasets", "corruption", "noise", "real_noise", "blur", "report",
    "matrix",
]  # fmt: skip
USES: dict[str, list[str]] = {
    "pipeline.detection": [], "pipeline.blur": ["pmp", "gbb"], "pipeline.noise": [], "pipeline.control": [],
}  # fmt: skip
MOST_WORKERS = 4  # of few long sections, more would wait for the longest
NETWORKS = {
    "train_mtf": ("spectral", "spectral_processed", "pixels", "cnn"),
    "train_sigma": ("cellwise", "cnn"),
    "train_detector": ("compact", "compact_two_stage"),
}


@stage("report", reads=READS, uses=USES)
def run(run: Run) -> None:
    """Write the report from the stages' folders, and the ledger's score."""
    from importlib.metadata import version

    from pipeline import store, yaml_text
    from pipeline.executor import available_cores
    from pipeline.experiments.headline_metrics import headline
    from pipeline.report.build import build
    from pipeline.report.inputs import ReportInputs, mode_of
    from pipeline.report.sections.runtime import TIMED

    params = run.params
    data, listed, matrix = run.inputs / "data", list(params.datasets), params.matrix
    modes = {name: mode_of(section.model_dump()) for name, section in params.blur.estimators.items()}
    sweeps = [f"{name}-{detector}" for name in matrix.detection_datasets for detector in matrix.detectors]
    members = {
        **dict.fromkeys(("index", "corrupt", "combined", "denoised_blur"), listed),
        "noise": sorted(f"{name}-{method}" for name in listed for method in params.noise.estimators),
        "blur": sorted(f"{name}-{method}" for name in listed for method in params.blur.estimators),
        "real_noise": list(params.real_noise.recordings),
        **dict.fromkeys(("curves", "direction", "regression"), sweeps),
        "closed_loop": list(matrix.scenarios),
    }
    inputs = ReportInputs(
        paper=run.project / "data/paper",
        data=data,
        members=members,
        weights=data / "weights",
        ablation=run.inputs / "reports/metrics/ablation",
        ablations=tuple(matrix.ablations),
        recorded=run.project / "reports/recorded",
        benchmarks={
            "coded_noise": run.project / "benchmarks/results/coded_noise.json",
            "control": run.project / "benchmarks/results/control.json",
            "estimators": run.project / "benchmarks/results/estimators.json",
            "flags": run.project / "benchmarks/results/flags.json",
            "noise_budget": run.project / "benchmarks/results/noise_budget.json",
            "noisy_blur": run.project / "benchmarks/results/noisy_blur.json",
            "other_frames": run.project / "benchmarks/results/other_frames.json",
            "real_blur": run.project / "benchmarks/results/real_blur.json",
            "unseen_kernels": run.project / "benchmarks/results/unseen_kernels.json",
            "video_codecs": run.project / "benchmarks/results/video_codecs.json",
        },
        absent={name: line for name, line in params.report.not_run.items() if name not in listed},
        detectors_absent={
            name: line for name, line in params.report.not_run_detectors.items() if name not in matrix.detectors
        },
        lock=Path("dvc.lock"),
        stages=frozenset(yaml_text.parse(Path("dvc.yaml").read_text(encoding="utf-8"))["stages"]),
        aliases=stage_names(params),
        code_version=version("camera-condition-pipeline"),
        profile=params.profile,
        runs={"runtime": TIMED.command},
        modes={name: mode for name, mode in modes.items() if mode},
        seed=params.seed,
    )
    # the last stage has the machine to itself, while `executor.workers` leaves cores to stages that run at once
    workers = max(run.executor.workers, min(MOST_WORKERS, available_cores()))
    score = build(inputs, run.outputs / "reports", workers)
    store.write_json(run.outputs / "reports/metrics/report.json", score.metrics)
    summary = headline(run.inputs / "reports/metrics", score.metrics, members)
    store.write_json(run.outputs / "reports/headline.json", summary)


def stage_names(params: Any) -> dict[str, str]:
    """Stages of estimators and trainings as tables name them -> as ``dvc.yaml`` does, by registry name."""
    names = {}
    for group, estimators in (("noise", params.noise.estimators), ("blur", params.blur.estimators)):
        for dataset in params.datasets:
            for name, section in estimators.items():
                names[f"{group}@{dataset}-{name}"] = f"{group}_{section.kind}@{dataset}-{name}"
    for group, networks in NETWORKS.items():
        names |= {f"{group}@{name}": f"{group}_{name}@{name}-{params.profile}" for name in networks}
    names["train_sigma@correlated"] = f"train_sigma_correlated@{params.profile}"
    names["generic_lens"] = f"generic_lens@{params.profile}"
    return names


if __name__ == "__main__":
    run()
