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
    "pipeline.detection": [], "pipeline.blur": [], "pipeline.noise": [], "pipeline.control": [],
}  # fmt: skip
NETWORKS = {
    "train_mtf": ("spectral", "cnn"),
    "train_sigma": ("cellwise", "cnn"),
    "train_detector": ("compact", "compact_two_stage"),
}


@stage("report", reads=READS, uses=USES)
def run(run: Run) -> None:
    """Write the report from the stages' folders, and the ledger's score."""
    from importlib.metadata import version

    import yaml

    from pipeline import store
    from pipeline.experiments.headline_metrics import headline
    from pipeline.report.build import build
    from pipeline.report.inputs import ReportInputs, mode_of
    from pipeline.report.sections.runtime import COMMAND

    params = run.params
    data = run.inputs / "data"
    listed = list(params.datasets)
    modes = {name: mode_of(section.model_dump()) for name, section in params.blur.estimators.items()}
    absent = {name: line for name, line in params.report.not_run.items() if name not in listed}
    inputs = ReportInputs(
        paper=run.project / "data/paper",
        index={name: data / "index" / name for name in listed},
        psf=data / "psf",
        corrupt={name: data / "corrupt" / name for name in listed},
        noise=data / "noise",
        noise_members=frozenset(f"{name}-{method}" for name in listed for method in params.noise.estimators),
        real_noise={name: data / "real_noise" / name for name in params.real_noise.recordings},
        blur=data / "blur",
        blur_members=frozenset(f"{name}-{method}" for name in listed for method in params.blur.estimators),
        combined={name: data / "combined" / name for name in listed},
        denoised={name: data / "denoised_blur" / name for name in listed},
        star=data / "star",
        sensor=data / "sensor",
        weights=data / "weights",
        ablation=run.inputs / "reports/metrics/ablation",
        ablations=tuple(params.matrix.ablations),
        runtime=run.project / "benchmarks/results/estimators.json",
        flags=run.project / "benchmarks/results/flags.json",
        unseen=run.project / "benchmarks/results/unseen_kernels.json",
        detection=data,
        control=data,
        scenarios=tuple(params.matrix.scenarios),
        decision_times=run.project / "benchmarks/results/control.json",
        recorded=run.project / "reports/recorded",
        detection_members=frozenset(
            (name, detector) for name in params.matrix.detection_datasets for detector in params.matrix.detectors
        ),
        detectors_absent={
            name: line for name, line in params.report.not_run_detectors.items() if name not in params.matrix.detectors
        },
        results={
            **{item: data / f"refit/{item}.csv" for item in ("regression_coefficients", "fitted_ap_grid")},
            "worked_examples": data / "worked_examples/steps.parquet",
            "controller_ap": data / "worked_examples/precision.parquet",
            "controller_response": data / "worked_examples/response.parquet",
        },
        absent=absent,
        lock=Path("dvc.lock"),
        stages=frozenset(yaml.safe_load(Path("dvc.yaml").read_text(encoding="utf-8"))["stages"]),
        aliases=stage_names(params),
        code_version=version("camera-condition-pipeline"),
        profile=params.profile,
        runs={"runtime": COMMAND},
        modes={name: mode for name, mode in modes.items() if mode},
        seed=params.seed,
    )
    score = build(inputs, run.outputs / "reports")
    store.write_json(run.outputs / "reports/metrics/report.json", score.metrics)
    metrics = run.inputs / "reports/metrics"
    summary = headline(metrics, score.metrics, inputs.blur_members or (), inputs.noise_members or ())
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
    names["generic_lens"] = f"generic_lens@{params.profile}"
    return names


if __name__ == "__main__":
    run()
