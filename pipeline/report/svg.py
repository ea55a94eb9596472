"""Smaller SVG with the same look, and many SVG figures on one page that share their glyphs and styles.

matplotlib writes coordinates to a millionth of a point, an id for every group and every picture as a PNG with four
channels. `compact` rounds, drops what nothing refers to and stores photographs as JPEG. `inline` gives ids that no two
figures share, and moves the outlines of letters and the styles of lines, which are the same in all figures, into one
element in front of them.
"""

from __future__ import annotations

import base64
import html
import io
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping

import numpy as np

SVG, XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
HREF = f"{{{XLINK}}}href"
SERIES = "series--"
"""Beginning of ids that the page's script looks for, beside those that the figure refers to itself."""

JPEG_QUALITY = 84
PHOTOGRAPH_PX = 4096
"""Grey pictures with at least so many pixels are stored as JPEG, smaller ones (kernels) without loss."""

_LONG_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_ALONG = re.compile(r"translate\((-?[\d.]+) 0\)")
_CLIP_PATH = re.compile(r'(id="|href="#|url\(#)(p[0-9a-f]{10})(?=["\)])')
_REFERENCE = re.compile(r"url\(#([^)]+)\)|^#(.+)$")


def encoded(picture: bytes) -> str:
    """A PNG as a data URL of the smallest suitable kind.

    Returns:
        JPEG for large opaque grey pictures, else PNG; colour maps and their bars are read off, so they lose nothing.
    """
    from PIL import Image

    image = Image.open(io.BytesIO(picture)).convert("RGBA")
    channels = np.asarray(image)
    is_grey = bool((channels[..., :3] == channels[..., :1]).all() and (channels[..., 3] == 255).all())
    out, kind = io.BytesIO(), "png"
    if not is_grey:
        opaque = bool((channels[..., 3] == 255).all())
        (image.convert("RGB") if opaque else image).save(out, "PNG", optimize=True)
    elif channels.shape[0] * channels.shape[1] < PHOTOGRAPH_PX:
        image.convert("L").save(out, "PNG", optimize=True)
    else:
        image.convert("L").save(out, "JPEG", quality=JPEG_QUALITY, optimize=True)
        kind = "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(out.getvalue()).decode()}"


def _rounded(text: str) -> str:
    """Text with its coordinates rounded to a hundredth of a point."""
    return _LONG_NUMBER.sub(lambda match: f"{round(float(match[0]), 2) + 0.0:g}", text)


def compact(text: str) -> str:
    """A figure of matplotlib with the same look in fewer bytes.

    Returns:
        an SVG file; ids that begin with `SERIES` or that something refers to are kept, those of clip paths numbered.
    """
    for prefix, name in (("", SVG), ("xlink", XLINK)):
        ET.register_namespace(prefix, name)
    root = ET.fromstring(text)
    for unused in root.findall(f"{{{SVG}}}metadata"):
        root.remove(unused)
    referenced = {
        match[1] or match[2]
        for element in root.iter()
        for value in element.attrib.values()
        for match in _REFERENCE.finditer(value)
    }
    for element in root.iter():
        _shorten(element, referenced)
    _unwrap(root)
    # matplotlib names a clip path by a hash of its position, whose last digits a layout does not repeat: here by order.
    names: dict[str, str] = {}
    text = ET.tostring(root, encoding="unicode") + "\n"
    return _CLIP_PATH.sub(lambda match: match[1] + names.setdefault(match[2], f"p{len(names)}"), text)


def _shorten(element: ET.Element, referenced: set[str]) -> None:
    """Drops white space and unused ids of one element, rounds its coordinates, stores its picture anew."""
    attributes = element.attrib
    element.tail = None
    if element.text is not None and not element.text.strip():
        element.text = None
    name = attributes.get("id", "")
    if name and name not in referenced and not name.startswith(SERIES):
        del attributes["id"]
    for key in ("d", "x", "y"):
        if key in attributes:
            attributes[key] = _rounded(" ".join(attributes[key].split()))
    if "transform" in attributes:  # factors keep their digits
        attributes["transform"] = re.sub(r"translate\([^)]*\)", lambda one: _rounded(one[0]), attributes["transform"])
        along = _ALONG.fullmatch(attributes["transform"])
        if along is not None and element.tag == f"{{{SVG}}}use":  # a letter behind another one
            del attributes["transform"]
            attributes["x"] = along[1]
    if element.tag == f"{{{SVG}}}image":
        attributes[HREF] = encoded(base64.b64decode(attributes[HREF].partition(",")[2]))


def _unwrap(parent: ET.Element) -> None:
    """Replaces groups without attributes by their content, and leaves out empty ones."""
    children: list[ET.Element] = []
    for child in parent:
        _unwrap(child)
        is_plain = child.tag == f"{{{SVG}}}g" and not child.attrib
        children += list(child) if is_plain else [child]
    parent[:] = [child for child in children if len(child) or child.attrib or child.text]


def inline(svgs: Mapping[str, str], alts: Mapping[str, str]) -> tuple[str, dict[str, str]]:
    """Figures as elements of one page.

    Returns:
        one invisible element with the outlines of letters and the styles that figures share, to stand before them; name
        -> element.
    """
    glyphs: dict[str, str] = {}
    parts = {name: _element(svg, f"f{number}", alts[name], glyphs) for number, (name, svg) in enumerate(svgs.items())}
    counts = Counter(style for part in parts.values() for style in re.findall(r' style="([^"]*)"', part))
    classes = {style: f"v{number}" for number, (style, count) in enumerate(counts.items()) if count > 2}

    def short(match: re.Match[str]) -> str:
        return f' class="{classes[match[1]]}"' if match[1] in classes else match[0]

    parts = {name: re.sub(r' style="([^"]*)"', short, part) for name, part in parts.items()}
    rules = "".join(f".{name}{{{style}}}" for style, name in classes.items())
    content = f"<style>{rules}</style><defs>{''.join(glyphs.values())}</defs>"
    return (f'<svg class="shared" aria-hidden="true">{content}</svg>' if parts else ""), parts


def _element(svg: str, prefix: str, alt: str, glyphs: dict[str, str]) -> str:
    """One figure with short ids; outlines of its letters go to ``glyphs``, by their id in the file."""
    names: dict[str, str] = {}

    def collect(match: re.Match[str]) -> str:
        number = len(glyphs)
        glyphs.setdefault(match[1], match[0].replace(match[1], f"g{number}", 1))
        return ""

    def renamed(name: str) -> str:
        if name.startswith(SERIES):
            return f"{prefix}-{name}"
        return names.setdefault(name, f"{prefix}-{len(names)}")

    body = svg[svg.index("<svg") :].strip().replace("xlink:href=", "href=").replace(" />", "/>")
    body = re.sub(r'<path (?:[^<>]* )?id="(DejaVu[^"]+)"[^<>]*/>', collect, body).replace("<defs></defs>", "")
    names.update({glyph: f"g{number}" for number, glyph in enumerate(glyphs)})
    body = re.sub(r'\b(id="|href="#|url\(#)([^")]+)', lambda match: match[1] + renamed(match[2]), body)
    head, rest = body.split(">", 1)
    head = re.sub(r'\s(?:width|height|version|xmlns(?::xlink)?)="[^"]*"', "", head)
    label = html.escape(alt, quote=True)
    return f'{head} role="img" aria-label="{label}"><title>{label}</title>{rest}'
