"""Figures as functions of data: what they draw, what they say of it, what they refuse."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_makers import picture

from pipeline import store, tables
from pipeline.datasets.power_spectrum import power_spectrum
from pipeline.errors import InputError
from pipeline.report import figures, style
from pipeline.report.inputs import Arrays, ReportInputs
from pipeline.report.sections import datasets, formation, noise, optics
from pipeline.report.sections.datasets import DatasetSample
from pipeline.streams import stream


def artists(figure: object, prefix: str) -> list:
    return figure.findobj(lambda artist: (artist.get_gid() or "").startswith(prefix))  # type: ignore[attr-defined]


def test_white_noise_has_a_flat_spectrum_of_its_variance() -> None:
    noise = stream(0, "white").normal(scale=10.0, size=(256, 320))
    _, power = power_spectrum(noise, bins=8)
    assert power[3:] == pytest.approx(100.0, rel=0.1)


def test_a_sinusoid_peaks_at_its_frequency() -> None:
    x = np.arange(512)
    wave = np.broadcast_to(100 + 50 * np.sin(2 * np.pi * 0.1 * x), (128, 512))
    frequency, power = power_spectrum(wave)
    assert frequency[np.nanargmax(power)] == pytest.approx(0.1, rel=0.1)


def test_datasets_figure_draws_boxes_and_patches() -> None:
    box = {"label": "car", "x1": 20, "y1": 30, "x2": 80, "y2": 60, "ignore": False}
    patches = pd.DataFrame(
        [{"frame": "a", "purpose": purpose, "x_px": 4, "y_px": 8, "size_px": 96} for purpose in ("blur", "noise")]
    )
    frames = {"a": picture("a"), "b": picture("b")}
    drawing = datasets.samples_figure([DatasetSample("sim", frames, {"a": [box, {**box, "ignore": True}]}, patches)])
    shown = drawing.figure.subfigs[0].axes[0]
    assert len(shown.patches) == 3  # two boxes and the blur patch; noise patches are not shown
    assert (shown.patches[1].get_width(), shown.patches[1].get_height()) == (60, 30)
    assert "Sim (2 shown)" in drawing.alt and "2 object boxes" in drawing.alt
    histogram = drawing.values[drawing.values["curve"] == "histogram_percent"]
    assert histogram["y"].sum() == pytest.approx(100.0)


def test_large_frames_are_shrunk_and_boxes_with_them() -> None:
    frame = np.zeros((600, 1200), np.uint8)
    box = {"label": "car", "x1": 0, "y1": 0, "x2": 1200, "y2": 600}
    shown = datasets.samples_figure([DatasetSample("kitti", {"a": frame}, {"a": [box]})]).figure.subfigs[0].axes[0]
    assert max(shown.images[0].get_array().shape) == datasets.SHOWN_PX
    assert shown.patches[0].get_width() == pytest.approx(datasets.SHOWN_PX)


def test_the_chain_reports_each_change() -> None:
    clean = np.full((64, 64), 100, np.uint8)
    noisy = (clean + np.where(np.arange(64) % 2, 3, -3)).astype(np.uint8)
    entries = [{"array": name, "title": name.title()} for name in ("scene", "photon", "same")]
    drawing = formation.chain({"scene": clean, "photon": noisy, "same": noisy}, entries)
    assert drawing.values["change_std_dn"].tolist()[1:] == pytest.approx([3.0, 0.0])
    assert "Photon (3.00 DN)" in drawing.alt
    with pytest.raises(InputError, match=r"array 'photn'.*did you mean 'photon'"):
        formation.chain(Arrays(photon=clean), [{"array": "photn", "title": ""}])


def test_the_gallery_crops_and_never_shrinks() -> None:
    picture_in = stream(0, "gallery").integers(0, 255, (300, 400)).astype(np.uint8)
    drawing = formation.effects({"a": picture_in}, [{"array": "a", "noise_source": "photon", "target_sigma_dn": 0}])
    shown = np.asarray(drawing.figure.axes[0].images[0].get_array())
    side = formation.EFFECTS_PX
    top, left = (300 - side) // 2, (400 - side) // 2
    assert np.array_equal(shown, picture_in[top : top + side, left : left + side])


def test_effects_measure_what_is_present_after_clipping_and_show_gaps() -> None:
    clean = np.full((32, 32), 0.5, np.float32)
    noisy = clean + stream(0, "effects").normal(scale=5 / 255, size=clean.shape).astype(np.float32)
    entries = [
        {"array": "clean", "noise_source": "photon", "target_sigma_dn": 0},
        {"array": "noisy", "noise_source": "photon", "target_sigma_dn": 5},
        {"array": "clean", "noise_source": "dcsn", "target_sigma_dn": 0},
    ]
    drawing = formation.effects({"clean": clean, "noisy": noisy}, entries)
    present = drawing.values.set_index(["noise_source", "target_sigma_dn"])["present_std_dn"]
    assert present["photon", 5.0] == pytest.approx(5.0, rel=0.1)
    assert f"{present['photon', 5.0]:.1f} DN present" in [axes.get_xlabel() for axes in drawing.figure.axes]
    assert any(text.get_text() == "not run" for axes in drawing.figure.axes for text in axes.texts)


def test_kernel_sheet_shows_every_kernel_once(report_inputs: ReportInputs) -> None:
    table = store.read_table(report_inputs.data / "psf/kernels.parquet", tables.KERNELS)
    kernels = report_inputs.arrays("psf/kernels.npz")
    drawing = optics.kernel_sheet(table, kernels, "generated")
    assert sum(len(axes.images) for axes in drawing.figure.axes) == table["kernel"].nunique() == 27
    assert len(artists(drawing.figure, "series--H--")) == len(artists(drawing.figure, "series--V--")) == 27
    assert "27 blur kernels" in drawing.alt
    kernels.pop("defocus-3-0")
    with pytest.raises(InputError, match="defocus-3-0"):
        optics.kernel_sheet(table, kernels, "generated")
    with pytest.raises(InputError, match="source 'paper'"):
        optics.kernel_sheet(table, kernels, "paper")


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 6))
def test_framing_keeps_the_middle(height: int, width: int, extra: int) -> None:
    kernel = np.arange(1.0, height * width + 1).reshape(height, width)
    framed = optics._framed(kernel, max(height, width) + extra)
    assert framed.sum() == kernel.sum()
    assert framed.shape == (max(height, width) + extra,) * 2


def test_noise_figure_plots_the_medians_and_counts_abstentions(report_inputs: ReportInputs) -> None:
    summary = report_inputs.result("noise_summary")
    drawing = noise.curves(summary, ["sim", "kitti"])
    lines = artists(drawing.figure, "series--pca--median")
    assert len(lines) == 4  # one per effect; KITTI has none
    selected = summary[(summary["estimator"] == "pca") & (summary["noise_source"] == "photon")].sort_values(
        "target_sigma_dn"
    )
    assert np.asarray(lines[0].get_ydata()) == pytest.approx(selected["median_dn"].to_numpy())
    texts = [text.get_text() for axes in drawing.figure.axes for text in axes.texts]
    assert texts.count("PCA abstained 12 of 72") == 4 and texts.count("not run") == 4
    assert "96 estimates" not in drawing.alt and f"{int(summary['abstained'].sum())} estimates" in drawing.alt
    assert [name for name, _, _ in drawing.series] == ["pca", "bf"]


def test_star_figure_says_how_far_measurement_and_formula_part() -> None:
    frequency = np.array([0.25, 0.5, 0.75])
    curves = {"measured": np.array([0.9, 0.8, 0.6]), "formula": np.array([0.9, 0.79, 0.63]), "frequency": frequency}
    drawing = optics.star_figure(np.zeros((700, 600)), curves)
    assert "0.800 at half" in drawing.alt and "at most 0.0300, at 0.75" in drawing.alt
    assert max(drawing.figure.axes[0].images[0].get_array().shape) == 512


def test_photon_transfer_compares_slope_and_gain() -> None:
    curve = {
        "mean_dn": [0, 100, 200], "variance_dn2": [0, 1, 2], "slope_dn_per_e": 0.0101, "offset_dn2": 0.0,
        "gain_dn_per_e": 0.01,
    }  # fmt: skip
    assert "+1.00 % from the sensor's gain" in formation.photon_transfer(curve).alt
    with pytest.raises(InputError, match="equally long"):
        formation.photon_transfer(curve | {"mean_dn": [0]})


@pytest.mark.parametrize(
    ("labels", "columns"),
    [
        (["a"], 1),
        (["3 px"] * 6, 6),
        (["3 px"] * 12, 6),
        (["n" * 70, *["PMP"] * 5], 3),  # one long name leaves room for two columns of short ones
        (["n" * 140, "PMP"], 1),
    ],
)
def test_a_legend_has_as_many_columns_as_fit(labels: list[str], columns: int) -> None:
    assert figures.legend_columns(labels, style.TWO_COLUMNS_IN) == columns


@style.styled
def test_a_legend_with_a_long_name_stays_within_its_figure() -> None:
    figure = style.new_figure(style.TWO_COLUMNS_IN, 2.0)
    figure.subplots()
    long = "CNN (blur: at most 45 %; noise: at most 86 % of the paper’s samples)"
    figures.add_legend(figure, [(name, {}) for name in (long, "PMP", "GBB", "Spectral", "the paper's")], "Title")
    figure.draw_without_rendering()
    extent = figure.legends[0].get_window_extent()
    assert extent.x0 >= 0 and extent.x1 <= figure.bbox.x1
    assert figure.legends[0].get_title().get_text() == "Title"
