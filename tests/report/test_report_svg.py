"""Smaller SVG with the same look, and figures on one page."""

from __future__ import annotations

import base64
import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

from pipeline.report import style, svg

FIGURE = (
    '<?xml version="1.0"?>\n<!DOCTYPE svg>\n<svg xmlns="http://www.w3.org/2000/svg" version="1.1" '
    'xmlns:xlink="http://www.w3.org/1999/xlink" width="10pt" height="5pt" viewBox="0 0 10 5">\n'
    '<metadata>\n<x/></metadata>\n<!-- text --><g id="unused"><g id="axes"><defs>'
    '<path id="a" d="M 1.234567 -0.000001\nL 2 3 "/></defs></g>'
    '<g id="series--pca--line"><use xlink:href="#a" x="1.999999" style="fill: #1b1f24"/></g>'
    '<g clip-path="url(#a)" transform="translate(1.23456 2) scale(0.015625)"><use xlink:href="#a"/></g></g></svg>'
)


def png(picture: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(picture).save(out, "PNG")
    return out.getvalue()


def decoded(address: str) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))).convert("RGBA"))


def test_compact_rounds_and_keeps_what_is_referred_to() -> None:
    text = svg.compact(FIGURE)
    root = ET.fromstring(text)
    ids = {element.get("id") for element in root.iter() if element.get("id")}
    assert ids == {"a", "series--pca--line"}
    assert 'd="M 1.23 0 L 2 3"' in text and 'x="2"' in text and "metadata" not in text and "<!--" not in text
    assert 'transform="translate(1.23 2) scale(0.015625)"' in text  # a factor is no coordinate


def test_clip_paths_are_named_by_their_order_not_by_their_position() -> None:
    first, second = (svg.compact(FIGURE.replace('"a"', f'"{name}"').replace("#a", f"#{name}"))
                     for name in ("p0123456789", "pabcdef0123"))  # fmt: skip
    assert first == second and 'id="p0"' in first and "url(#p0)" in first


def test_compact_twice_is_compact_once() -> None:
    once = svg.compact(FIGURE)
    assert svg.compact(once) == once


@pytest.mark.parametrize(("side", "kind", "largest"), [(16, "png", 0), (128, "jpeg", 24)])
def test_grey_pictures_keep_their_levels(side: int, kind: str, largest: int) -> None:
    levels = np.linspace(0, 255, side * side).reshape(side, side).astype(np.uint8)
    address = svg.encoded(png(np.dstack([levels] * 3)))
    assert address.startswith(f"data:image/{kind};base64,")
    assert np.abs(decoded(address)[..., 0].astype(int) - levels).max() <= largest


def test_colours_and_transparency_stay() -> None:
    picture = np.zeros((80, 80, 4), np.uint8)
    picture[:40] = (0, 114, 178, 255)
    address = svg.encoded(png(picture))
    assert address.startswith("data:image/png") and (decoded(address)[0, 0] == picture[0, 0]).all()
    assert decoded(address)[-1, -1, 3] == 0


@pytest.mark.parametrize("opacity", [255, 140])
def test_a_colour_map_loses_nothing(opacity: int) -> None:
    bar = (255 * colormaps["viridis"](np.linspace(0, 1, 256))).astype(np.uint8)
    picture = np.repeat(bar[:, None], 12, axis=1)
    picture[..., 3] = opacity
    assert (decoded(svg.encoded(png(picture))) == picture).all()


@style.styled
def labelled(title: str) -> style.Drawing:
    figure = style.new_figure(2.0, 1.0)
    figure.subplots().set_title(title)
    return style.Drawing(figure, title)


def test_figures_on_one_page_share_glyphs_and_no_id(tmp_path: object) -> None:
    files = {
        name: style.save(labelled(name).figure, f"{tmp_path}/{name}")[0].read_text(encoding="utf-8")
        for name in ("aa", "ab")
    }
    shared, parts = svg.inline(files, {"aa": 'levels "0" < 5', "ab": "b"})
    assert parts["aa"].startswith("<svg viewBox=") and 'aria-label="levels &quot;0&quot; &lt; 5"' in parts["aa"]
    text = shared + "".join(parts.values())
    ids = re.findall(r' id="([^"]+)"', text)
    assert len(set(ids)) == len(ids)
    assert set(re.findall(r'(?:href="#|url\(#)([^")]+)', text)) <= set(ids)
    first = re.search(r'id="(g\d+)"', shared)
    assert first and all(f'href="#{first[1]}"' in part for part in parts.values())  # both titles have an "a"


def test_letters_of_a_line_are_placed_by_one_number() -> None:
    text = FIGURE.replace('x="1.999999"', 'transform="translate(63.623047 0)"')
    use = svg.compact(text).partition("<use")[2].partition("/>")[0]
    assert 'x="63.62"' in use and "transform" not in use
