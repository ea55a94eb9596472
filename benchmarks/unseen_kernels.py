"""Blur estimators under rendered optics that none was trained on (benchmarks/rendered_psf.py).

    python benchmarks/unseen_kernels.py [--dataset NAME=KIND:ROOT ...] [--patches N] [--fused] [--peers N] [--out FILE]

Frames of scikit-image's photographs, and of the datasets named (kinds of `pipeline.datasets`, e.g.
``kitti=kitti:data/raw/kitti``), are blurred whole and rounded to 8 bits as in the stage `blur`, and patches over
objects (or tiles, where nothing is labelled) are estimated. The AMAE is that of Table I: of the robust median over a
dataset's patches, for each kernel, percent; `mean_amae_percent` is its mean over kernels, and
`mean_interval_percent` the 95 % interval of that over frames (`benchmarks.mean_amae`). The spectral estimator gives
four answers:

    raw                the system MTF: lens and sensor of the recording camera are among it
    generic_lens       the MTF relative to a generic lens (`output: relative`)
    calibrated         divided by its answer for the same sharp frames
    camera_calibrated  `pipeline.blur.camera_calibration`, calibrated to the sharp frames of the other half of a
                       dataset, blurred by random kernels of the training family (`with_optics`), none of these

The networks for processed pictures and the calibrations saw random irises, halos and lenses, none of these. With
``--fused``, the fused estimator calibrated to the camera likewise, some ten minutes a dataset. With ``--peers N``, PMP
and GBB (fast) too, on one patch of each of N frames evenly spread, beside the spectral estimator on the same patches
(`few`). The picture shows kernels and AMAE.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from benchmarks import mean_amae, rendered_psf  # noqa: E402
from pipeline import blur  # noqa: E402
from pipeline.blur import camera_calibration, spectral  # noqa: E402
from pipeline.camera import mtf  # noqa: E402
from pipeline.datasets.selection import evenly_spread  # noqa: E402
from pipeline.experiments import calibrate, table_one  # noqa: E402
from pipeline.experiments.condition import SHARP, grid, sharp_kernel  # noqa: E402
from pipeline.experiments.frames import TestFrame, of_index  # noqa: E402
from pipeline.experiments.run import Method, Registered, run  # noqa: E402
from pipeline.store import file_sha256  # noqa: E402

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.config.schema import Config
    from pipeline.report.style import Drawing

PEERS = {name: {"mode": "fast", "kernel_size": 31} for name in ("pmp", "gbb")}
ANSWERS = {
    "raw": "system MTF",
    "generic_lens": "relative to a generic lens",
    "calibrated": "divided by its answer for sharp frames",
    "camera_calibrated": "calibrated to the camera",
}
SOURCE = (
    "Kernels are rendered by wave optics (pupil, Zernike aberrations, three wavelengths, hand shake) in "
    "benchmarks/rendered_psf.py; truth is the MTF of the rendered kernel. No estimator was trained on these kernels."
)


def configuration(datasets: Sequence[str]) -> Config:
    """The study's own configuration with the photographs and the datasets named as its only ones.

    Raises:
        InputError: a dataset that is not NAME=KIND:ROOT, or a section that the configuration refuses.
    """
    import yaml

    from pipeline.config.compose import compose
    from pipeline.config.schema import validate

    overrides, names = ["executor.workers=1"], ["photos"]
    for text in datasets:
        name, kind, root = common.dataset(text)
        overrides += [f"+dataset@datasets.{name}={kind}", f"datasets.{name}.root={Path(root).resolve()}"]
        names.append(name)
    content = yaml.safe_load(compose(overrides, ROOT / "conf"))
    content["datasets"] = {name: content["datasets"][name] for name in names}
    content["matrix"]["datasets"] = names
    return validate(content)


def indexed(config: Config, name: str, patches_per_frame: int | None) -> tuple[list[TestFrame], list[TestFrame]]:
    """A dataset's frames, each with the patches to evaluate on, and with all of them to calibrate on."""
    from pipeline.stages import index

    with tempfile.TemporaryDirectory() as temporary:
        index.run.run(config, {"dataset": name}, Path(temporary), Path(temporary))
        folder, section = Path(temporary) / "data/index" / name, config.datasets[name]
        some, every = (of_index(folder, name, section, {"mtf": count}) for count in (patches_per_frame, None))
        return some, every


def estimates(
    frames: Sequence[TestFrame], kernels: Sequence[Kernel], name: str, config: Config, **options: Any
) -> pd.DataFrame:
    """One estimator under every kernel and on sharp frames (`pipeline.experiments.tables.MEASUREMENTS`)."""
    method = Method(name, "mtf", Registered(blur.create, name, PEERS.get(name, {}) | options))
    camera = config.camera
    return run(frames, grid([sharp_kernel(), *kernels]), [method], camera=camera, seed=config.seed)


def camera_calibrated(
    frames: Sequence[TestFrame],
    every: Sequence[TestFrame],
    kernels: Sequence[Kernel],
    name: str,
    config: Config,
    samples: int,
) -> tuple[pd.DataFrame, list[float]]:
    """Estimates by one estimator calibrated to the other half's frames; each calibration's held-out error, %."""
    estimator = Registered(blur.create, name)
    maps = calibrate.cross_fit(every, estimator, samples=samples, seed=config.seed)
    folds = tuple(calibrate.Calibrated(estimator, one) for one in maps)
    method = Method(name, "mtf", estimator, of_folds=folds)
    folded = calibrate.in_folds(frames, every)
    table = run(folded, grid([sharp_kernel(), *kernels]), [method], camera=config.camera, seed=config.seed)
    return table, [round(one.error_percent[1], 3) for one in maps]


def outcome(table: pd.DataFrame, seed: int) -> dict[str, Any]:
    """AMAE of each kernel, their means with the interval of all, percent; patches that answered and that did not."""
    # Each kernel is a cell of its own, whatever its size.
    cells = table[table["kernel"] != SHARP].assign(blur_kind=lambda rows: rows["kernel"])
    rows = table_one.summarise(cells, seed, 0).set_index("blur_kind")
    amae = rows["amae_percent"]
    group_of = amae.index.map({one.name: one.group for one in rendered_psf.BANK})
    # The same resamples for every estimator and answer of a dataset, which are compared.
    interval = mean_amae.interval_percent(cells, seed, ("unseen kernels",))
    return {
        "mean_amae_percent": round(float(amae.mean()), 3),
        "mean_interval_percent": [None if math.isnan(end) else round(end, 3) for end in interval],
        "mean_of_group_percent": {str(k): round(float(v), 3) for k, v in amae.groupby(group_of).mean().items()},
        "amae_percent": {str(name): round(float(value), 3) for name, value in amae.items()},
        "patches_per_kernel": int(rows["count"].max()),
        "abstained": int(rows["abstained"].sum()),
    }


def answers(read: pd.DataFrame, seed: int) -> dict[str, Any]:
    """Raw and calibrated."""
    return {"raw": outcome(read, seed), "calibrated": outcome(calibrate.divided_by_sharp(read), seed)}


def spectral_answers(read: pd.DataFrame, added: pd.DataFrame, corrected: pd.DataFrame, seed: int) -> dict[str, Any]:
    """The spectral estimator's answers (`ANSWERS`)."""
    return {**answers(read, seed), "generic_lens": outcome(added, seed), "camera_calibrated": outcome(corrected, seed)}


def measure(
    config: Config,
    work: Sequence[TestFrame],
    every: Sequence[TestFrame],
    kernels: Sequence[Kernel],
    arguments: argparse.Namespace,
) -> dict[str, Any]:
    """All estimators on one dataset's frames (`indexed`)."""
    read = estimates(work, kernels, "spectral", config)
    added = estimates(work, kernels, "spectral", config, output="relative")
    table, errors = camera_calibrated(work, every, kernels, "spectral", config, arguments.samples)
    results: dict[str, Any] = {
        "frames": len(work),
        "patches": sum(len(item.patches["mtf"]) for item in work),
        "spectral": spectral_answers(read, added, table, config.seed),
    }
    results["spectral"]["camera_calibrated"]["error_on_fitting_samples_percent"] = errors
    if arguments.fused:
        fused, _ = camera_calibrated(work, every, kernels, "fused", config, arguments.samples)
        results["fused"] = {"camera_calibrated": outcome(fused, config.seed)}
    if arguments.peers:
        count = min(arguments.peers, len(work))
        few = [TestFrame(item.frame, {"mtf": item.patches["mtf"][:1]}) for item in evenly_spread(work, count)]
        chosen = [item.frame.name for item in few]
        known = {answer: own_rows[own_rows["frame"].isin(chosen) & (own_rows["patch"] == 0)] for answer, own_rows in
               (("raw", read), ("generic_lens", added), ("camera_calibrated", table))}  # fmt: skip
        results["few"] = {
            "patches": count,
            "spectral": spectral_answers(known["raw"], known["generic_lens"], known["camera_calibrated"], config.seed),
            **{peer: answers(estimates(few, kernels, peer, config), config.seed) for peer in PEERS},
        }
    return results


def described(kernels: Sequence[Kernel]) -> list[dict[str, Any]]:
    """The table of kernels: diameter with 90 % of the light, side, and MTF50 (null where above Nyquist)."""
    rows = []
    for kernel in kernels:
        across, down = (round(float(value), 3) for value in mtf.mtf50(kernel.psf))
        row = {
            "kernel": kernel.name,
            "group": kernel.kind,
            "diameter_90_px": kernel.size_px,
            "side_px": len(kernel.psf),
        }
        rows.append({**row, "mtf50_horizontal": across, "mtf50_vertical": down})
    return rows


def draw(kernels: Sequence[Kernel], results: dict[str, Any]) -> Drawing:
    """Kernels by group and size, and beneath, for each dataset, the AMAE of each answer of the spectral estimator."""
    from matplotlib.lines import Line2D

    from pipeline.report import style
    from pipeline.report.display_names import word

    groups = rendered_psf.GROUPS
    ordered = sorted(kernels, key=lambda kernel: (groups.index(kernel.kind), kernel.size_px, kernel.name))
    begins = [next(i for i, kernel in enumerate(ordered) if kernel.kind == group) for group in groups]
    names, columns = list(results), len(ordered)
    amae = {(name, answer): results[name]["spectral"][answer]["amae_percent"] for name in names for answer in ANSWERS}
    highest = 1.1 * max(max(values.values()) for values in amae.values())

    @style.styled
    def drawing() -> Drawing:
        left_in, right_in, gap_in, top_in = 0.42, 0.04, 0.03, 0.62
        cell_in = (style.TWO_COLUMNS_IN - left_in - right_in - (columns - 1) * gap_in) / columns
        figure, axes = style.sheet(
            columns, [1, *[0.85 / cell_in] * len(names)], left_in=left_in, right_in=right_in, gap_in=gap_in,
            top_in=top_in, bottom_in=0.8, row_gap_in=0.24,
        )  # fmt: skip
        height_in = figure.get_figheight()
        for position, (axis, kernel) in enumerate(zip(axes[0], ordered, strict=True)):
            picture = np.pad(kernel.psf, (rendered_psf.LARGEST_PX - len(kernel.psf)) // 2)
            axis.imshow((picture / picture.max()) ** 0.5, cmap="gray", vmin=0, vmax=1)
            style.bare(axis)
            axis.set_title(f"{kernel.size_px:g} px", fontsize=5.2, fontweight="normal", pad=2)
            if position in begins:
                location = axis.get_position().x0
                figure.text(location, 1 - 0.42 / height_in, kernel.kind, fontweight="bold", fontsize=6.5)
        looks = {
            answer: style.series_look(answer, look) | {"linestyle": "none"}
            for answer, look in zip(ANSWERS, (3, 5, 0, 1), strict=True)
        }
        handles = [Line2D([], [], label=f"{answer}: {ANSWERS[answer]}", **looks[answer]) for answer in ANSWERS]
        figure.legend(handles=handles, loc="upper center", ncols=2, borderpad=0.2, handletextpad=0.1)
        for row, name in enumerate(names, start=1):
            for other in axes[row, 1:]:
                other.remove()
            axis, location = axes[row, 0], axes[row, 0].get_position()
            axis.set_position((location.x0, location.y0, axes[0, -1].get_position().x1 - location.x0, location.height))
            for offset, answer in zip((-0.27, -0.09, 0.09, 0.27), ANSWERS, strict=True):
                values = [amae[name, answer][kernel.name] for kernel in ordered]
                axis.plot(np.arange(columns) + offset, values, **looks[answer])
            for begin in begins[1:]:
                axis.axvline(begin - 0.5, color=style.MUTED, linewidth=0.6)
            axis.set(xlim=(-0.5, columns - 0.5), ylim=(0, highest), xticks=range(columns), ylabel="AMAE [%]")
            axis.set_xticklabels([] if row < len(names) else [kernel.name for kernel in ordered])
            axis.tick_params(axis="x", labelrotation=45, pad=1)
            for label in axis.get_xticklabels():
                label.set(ha="right", rotation_mode="anchor")
            known = results[name]["spectral"]
            means = ", ".join(f"{answer} {known[answer]['mean_amae_percent']:.1f}" for answer in ANSWERS)
            title = f"{word(name)}: {results[name]['patches']} patches, mean over kernels {means} %"
            axis.set_title(title, loc="left", pad=2, fontweight="normal")
        return style.Drawing(figure, "kernels of rendered optics and the AMAE of the spectral estimator under each")

    return drawing()


def main() -> None:
    """Render, blur, estimate, write, draw."""
    from pipeline.report import style

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", action="append", default=[], metavar="NAME=KIND:ROOT", help="may be repeated")
    parser.add_argument("--patches", type=int, default=4, help="at most this many of each frame")
    parser.add_argument(
        "--samples", type=int, default=camera_calibration.SAMPLES, help="blurred patches that a fit is made on"
    )
    parser.add_argument("--fused", action="store_true", help="the fused estimator calibrated to the camera as well")
    parser.add_argument("--peers", type=int, default=0, metavar="N", help="PMP and GBB on N patches of a dataset")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/unseen_kernels.json")
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    config = configuration(arguments.dataset)
    common.check_datasets("unseen_kernels", config.datasets, arguments.out)
    kernels = rendered_psf.bank(config.seed)
    # All are opened first: one that is absent is told before an hour of work on another.
    frames = {name: indexed(config, name, arguments.patches) for name in config.datasets}
    results: dict[str, Any] = {}
    for name, (work, every) in frames.items():
        start = time.perf_counter()
        results[name] = measure(config, work, every, kernels, arguments)
        for group in (results[name], results[name].get("few", {})):
            for estimator in ("spectral", "fused", *PEERS):
                for answer, item in group.get(estimator, {}).items():
                    print(f"{name:10s}{estimator:10s}{answer:12s}{item['mean_amae_percent']:6.2f} %", flush=True)
        print(f"{name:10s}{time.perf_counter() - start:.0f} s", flush=True)
    record = {
        "datasets": list(results),
        "source": SOURCE,
        "weights_sha256": file_sha256(spectral.RELEASED),
        "seed": config.seed,
        "patches_per_frame": arguments.patches,
        "fitting_samples": arguments.samples,
        "kernels": described(kernels),
        "results": results,
    }
    path = common.write("unseen_kernels", record, arguments.out)
    print(path, *style.save(draw(kernels, results).figure, path.with_suffix("")), sep="\n")


if __name__ == "__main__":
    common.run(main)
