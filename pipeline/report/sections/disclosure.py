"""What a reader has to know before believing a number: choices that favour ours, and shortcuts, each with its size."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.report import training_budget
from pipeline.report.display_names import counted
from pipeline.report.inputs import ReportInputs, mode_note, optional
from pipeline.report.learning_curves import read
from pipeline.report.ledger import LedgerRow
from pipeline.report.spec import Section
from pipeline.report.tables import format_number

TITLE = "Disclosure"
DISCS = (
    "Discs of the paper's program are fixed arrays, one for each diameter: those that blur the evaluated patches also "
    "occur among the kernels of training (some 8 % of them), on other pictures. This lowers the errors for defocus."
)
CALIBRATION = (
    "Calibrated estimates need sharp frames of the same camera, which the paper's estimates do not need; the ledger "
    "compares raw estimates only."
)


def _networks(inputs: ReportInputs) -> list[str]:
    """How much of the paper's training its two networks have had here."""
    steps = {one.name: one for one in read(inputs.weights)}
    sentences = []
    for name, percent in training_budget.percents(inputs).items():
        one = steps[name]
        seen = counted(one.steps * (one.samples or 0), "sample")
        sentences.append(f"{one.title.partition(' (')[0]} saw {seen}, {training_budget.in_words(percent)}")
    return [f"The paper's networks, trained anew: {'; '.join(sentences)}."] if sentences else []


def _upright(inputs: ReportInputs) -> list[str]:
    """The upright prior, and what leaving it out does."""
    base, isotropic = (optional(inputs.ablation, f"{name}.json") for name in ("base", "isotropic"))
    sentence = (
        "Training pictures have more horizontal and vertical edges than other ones (upright prior). This was chosen "
        "after a look at pictures of the kind that is evaluated, streets and villages."
    )
    if base is None or isotropic is None:
        return [sentence]
    with_prior, without = (format_number(one["mtf_error_percent"], 2) for one in (base, isotropic))
    return [
        f"{sentence} Short trainings with and without it have an MTF error of {with_prior} and {without} % on the same "
        "held-out samples, which have the prior (table of ablations)."
    ]


def _light(inputs: ReportInputs) -> str:
    """That image formation acts on encoded grey levels, and what linear light changes."""
    sentence = (
        "Image formation acts on encoded grey levels, as in the paper. In a camera blur and photon noise act on linear "
        "light, before the tone curve, and photon noise arises behind the optics."
    )
    study = optional(inputs.of_control("order_study"), "study.parquet")
    if study is None:
        return sentence
    own = study[(study["order"] == "paper") & (study["target_sigma_dn"] == study["target_sigma_dn"].max())]
    means = own.groupby("light")[["amae_percent", "ap_percent"]].mean()
    if not {"encoded", "linear"} <= set(means.index):
        return sentence
    amae, precision = (
        f"{format_number(means.loc['encoded', name], 1)} in encoded and "
        f"{format_number(means.loc['linear', name], 1)} % in linear light"
        for name in means
    )
    return f"{sentence} At the strongest photon noise the mean AMAE is {amae}, AP {precision} (order study)."


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section:
    """Choices and shortcuts, with their size where it was measured."""
    fast = mode_note(inputs.modes, inputs.modes)
    text = [*_networks(inputs), *([fast] if fast else []), *_upright(inputs), DISCS, _light(inputs), CALIBRATION]
    return Section("disclosure", TITLE, text)
