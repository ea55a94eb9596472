"""The figures' style and their files."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from pipeline.report import style


@style.styled
def small_figure() -> object:
    figure = style.new_figure(style.ONE_COLUMN_IN, 2.0)
    axes = figure.subplots()
    axes.plot([0, 1, 2], [1, 3, 2], **style.series_look("pca"), gid=style.series_id("pca", "line 1"))
    axes.set_title("a σ title")
    return figure


def test_saving_twice_gives_the_same_bytes_without_date_or_version(tmp_path: Path) -> None:
    values = pd.DataFrame({"x": [1.0, 1 / 3]})
    first = style.save(small_figure(), tmp_path / "a" / "figure", values)
    second = style.save(small_figure(), tmp_path / "b" / "figure", values)
    assert [path.suffix for path in first] == [".svg", ".png", ".csv"]
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes()
    svg = first[0].read_text()
    assert "<dc:date>" not in svg and "Matplotlib v" not in svg
    assert b"Software" not in first[1].read_bytes()
    assert (tmp_path / "a" / "figure.csv").read_text() == "x\n1\n0.333333\n"
    ET.fromstring(svg)
    assert not list(tmp_path.rglob(".writing-*"))


def test_a_users_settings_neither_enter_nor_are_changed(tmp_path: Path) -> None:
    plain = style.save(small_figure(), tmp_path / "plain")[0].read_bytes()
    with mpl.rc_context({"font.size": 20.0, "lines.linewidth": 9.0, "svg.fonttype": "none"}):
        changed = style.save(small_figure(), tmp_path / "changed")[0].read_bytes()
        assert mpl.rcParams["font.size"] == 20.0
    assert plain == changed


def test_a_stem_with_a_point_keeps_its_name(tmp_path: Path) -> None:
    written = style.save(small_figure(), tmp_path / "level_0.5")
    assert [path.name for path in written] == ["level_0.5.svg", "level_0.5.png"]


def test_series_of_the_project_keep_their_look_wherever_they_stand() -> None:
    assert style.series_look("pca", 0) == style.series_look("pca", 5)
    looks = [style.series_look(name) for name in ("pca", "bf", "cnn", "cellwise", "wavelet", "immerkaer")]
    for part in ("color", "marker"):
        assert len({look[part] for look in looks}) == len(looks)
    assert style.series_id("pca", "line 1") == "series--pca--line_1"


def test_palette_stays_distinct_for_colour_blind_readers() -> None:
    # Dichromats' views in linear RGB (Viénot, Brettel, Mollon 1999), distances in CIE L*a*b*.
    from skimage.color import rgb2lab

    to_lms = np.array([[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714], [0.0299566, 0.184309, 1.46709]])
    protan = np.array([[0, 2.02344, -2.52581], [0, 1, 0], [0, 0, 1]])
    deutan = np.array([[1, 0, 0], [0.494207, 0, 1.24827], [0, 0, 1]])
    colours = np.array([mpl.colors.to_rgb(colour) for colour in style.PALETTE[:6]])
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    for view in (np.eye(3), protan, deutan):
        seen = np.clip(linear @ (np.linalg.inv(to_lms) @ view @ to_lms).T, 0, 1)
        encoded = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
        lab = rgb2lab(encoded[None])[0]
        distance = np.linalg.norm(lab[:, None] - lab[None], axis=-1) + 1e3 * np.eye(len(lab))
        assert distance.min() > 10.0  # a just noticeable difference is about 2.3


def test_a_sheet_has_cells_of_the_size_asked_for() -> None:
    figure, axes = style.sheet(3, [1.0, 0.5], left_in=0.4, top_in=0.3, gap_in=0.1, row_gap_in=0.2)
    assert axes.shape == (2, 3)
    width_in, height_in = figure.get_size_inches()
    cell_in = (width_in - 0.42 - 2 * 0.1) / 3
    assert height_in == pytest.approx(0.3 + 1.5 * cell_in + 0.2 + 0.05)
    boxes = [[cell.get_position() for cell in row] for row in axes]
    assert boxes[0][0].height * height_in == pytest.approx(cell_in)
    assert boxes[1][0].height * height_in == pytest.approx(0.5 * cell_in)
    assert boxes[0][2].width * width_in == pytest.approx(cell_in)
    assert boxes[0][2].x1 * width_in == pytest.approx(width_in - 0.02)


@style.styled
def line_beside_a_photograph() -> object:
    figure = style.new_figure(4.0, 2.0)
    left, right = figure.subplots(1, 2)
    left.imshow(np.add.outer(np.arange(256), np.arange(256)) / 2, cmap="gray")
    right.plot([0, 1], [0, 1], color=style.PALETTE[1], linewidth=0.8)
    return figure


def test_a_png_keeps_the_colour_of_a_thin_line_beside_a_photograph(tmp_path: Path) -> None:
    _, png = style.save(line_beside_a_photograph(), tmp_path / "mixed")
    pixels = np.asarray(Image.open(png).convert("RGB")).reshape(-1, 3).astype(int)
    line = np.array([0xD5, 0x5E, 0x00])
    assert np.abs(pixels - line).max(axis=1).min() <= 8
