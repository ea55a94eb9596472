"""What a reader has to know before believing a number: choices that favour ours, and shortcuts, each with its size."""

from __future__ import annotations

from pipeline.learning.learning_curve import read
from pipeline.report import training_budget
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import counted, listing
from pipeline.report.inputs import ReportInputs, mode_note
from pipeline.report.sections.training import network_title
from pipeline.report.spec import Section
from pipeline.report.tables import format_number
from pipeline.stage_files import optional

PAGE = Descriptions("disclosure")


def _networks(inputs: ReportInputs) -> list[str]:
    """How much of the paper's training its two networks have had here."""
    curves = {curve.name: curve for curve in read(inputs.weights)}
    sentences = []
    for name, percent in training_budget.percents(inputs).items():
        curve = curves[name]
        released = training_budget.released_samples(curve)
        trained = counted(curve.steps * (curve.samples or 0), "sample")
        network, words = network_title(curve).partition(" (")[0], training_budget.in_words(percent)
        sentences.append(f"{network} is released after {released:,} of {trained}, {words}")
    return [f"The paper's networks, trained anew: {'; '.join(sentences)}."] if sentences else []


def _upright(inputs: ReportInputs) -> str:
    """The upright prior, and what leaving it out does."""
    base, isotropic, seed = (optional(inputs.ablation, f"{name}.json") for name in ("base", "isotropic", "seed_2"))
    if base is None or isotropic is None:
        return PAGE.text("upright")
    with_prior, without = (format_number(one["mtf_error_percent"], 2) for one in (base, isotropic))
    text = [PAGE.text("upright"), PAGE.text("without_upright", with_prior=with_prior, without=without)]
    if seed is not None:
        text.append(PAGE.text("another_seed", error=format_number(seed["mtf_error_percent"], 2)))
    return " ".join(text)


def _light(inputs: ReportInputs) -> str:
    """That image formation acts on encoded grey levels, and what linear light changes."""
    study = inputs.read("order_study/study.parquet")
    if study is None:
        return PAGE.text("encoded")
    selected = study[study["target_sigma_dn"] == study["target_sigma_dn"].max()]
    means = selected.groupby(["light", "order"])[["amae_percent", "ap_percent"]].mean()
    if not {("encoded", "paper"), ("linear", "detector")} <= set(means.index):
        return PAGE.text("encoded")
    numbers = {
        f"{light}_{order}_{name}": format_number(value, 1) for (light, order, name), value in means.stack().items()
    }
    motions = listing(f"{px:g}" for px in sorted(set(selected["motion_px"])))
    return " ".join([PAGE.text("encoded"), PAGE.text("linear", motions=motions, **numbers)])


def section(inputs: ReportInputs) -> Section:
    """Choices and shortcuts, with their size where it was measured."""
    fast = mode_note(inputs.modes, inputs.modes)
    text = [*_networks(inputs), *([fast] if fast else []), _upright(inputs), PAGE.text("discs"), _light(inputs)]
    return PAGE.section([], text=[*text, PAGE.text("calibration")])
