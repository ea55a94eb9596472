"""HEIF files made for the tests: HEVC by FFmpeg (PyAV), boxes by hand (ISO/IEC 23008-12)."""

from __future__ import annotations

import io
import struct
from collections.abc import Sequence
from fractions import Fraction

import av
import numpy as np

HIDDEN_ITEM = 1  # flag of a picture that is only a part of another


def box(kind: bytes, *content: bytes) -> bytes:
    body = b"".join(content)
    return struct.pack(">I", 8 + len(body)) + kind + body


def full(kind: bytes, version: int, flags: int, *content: bytes) -> bytes:
    return box(kind, struct.pack(">I", version << 24 | flags), *content)


def coded(pixels: np.ndarray, quantiser: int) -> tuple[bytes, bytes]:
    """The configuration record and the data of one picture, (H, W) or (H, W, 3) uint8, or 10-bit grey uint16."""
    file = io.BytesIO()
    with av.open(file, "w", format="matroska") as container:
        stream = container.add_stream("libx265", rate=Fraction(25))
        stream.height, stream.width = pixels.shape[:2]
        stream.pix_fmt = "yuv444p" if pixels.ndim == 3 else ("gray10le" if pixels.dtype == np.uint16 else "gray")
        lossless = "lossless=1" if quantiser < 0 else f"qp={quantiser}"
        stream.options = {"x265-params": f"{lossless}:log-level=none:pools=none:frame-threads=1:keyint=1:aq-mode=0"}
        kind = "rgb24" if pixels.ndim == 3 else stream.pix_fmt
        frame = av.VideoFrame.from_ndarray(pixels, format=kind)
        for packet in [*stream.encode(frame), *stream.encode()]:
            container.mux(packet)
    with av.open(io.BytesIO(file.getvalue())) as container:
        packet = next(packet for packet in container.demux(video=0) if packet.size)
        return bytes(container.streams.video[0].codec_context.extradata), bytes(packet)


def heic(
    pixels: np.ndarray,
    quantiser: int = 10,
    *,
    tiles: int = 1,
    display: Sequence[tuple[bytes, int]] = (),
    transfer: int = 13,
    exif: bytes = b"",
    thumbnail: np.ndarray | None = None,
    alpha: np.ndarray | None = None,
) -> bytes:
    """A HEIC file.

    Args:
        pixels: (H, W) or (H, W, 3) uint8, or (H, W) uint16 of 10 bits.
        quantiser: of the codec; -1 for lossless.
        tiles: as many beside one another, as telephones store large pictures.
        display: ``irot`` with quarter turns or ``imir`` with an axis, in order.
        transfer: transfer characteristic (ITU-T H.273).
        exif: EXIF data, from the TIFF header on.
        thumbnail: a small picture of the same kind, coded as coarsely as can be.
        alpha: opacity, (H, W) uint8; of one tile only.
    """
    height, width = pixels.shape[:2]
    parts = [(part, quantiser) for part in np.split(pixels, tiles, axis=1)]
    parts += [] if thumbnail is None else [(thumbnail, 51)]
    parts += [] if alpha is None else [(alpha, -1)]
    payloads, kinds, properties, associations = [], [], [], []
    for number, (part, coarseness) in enumerate(parts, 1):
        record, data = coded(np.ascontiguousarray(part), coarseness)
        properties += [box(b"hvcC", record), full(b"ispe", 0, 0, struct.pack(">II", part.shape[1], part.shape[0]))]
        payloads.append(data)
        kinds.append((b"hvc1", HIDDEN_ITEM if tiles > 1 and number <= tiles else 0))
        associations.append([2 * number - 1 | 0x80, 2 * number])
    primary, grid = 1, b""
    if tiles > 1:
        primary = len(kinds) + 1
        grid = struct.pack(">BBBBHH", 0, 0, 0, tiles - 1, width, height)
        kinds.append((b"grid", 0))
        properties.append(full(b"ispe", 0, 0, struct.pack(">II", width, height)))
        associations.append([len(properties)])
    full_range = 0 if pixels.ndim == 3 else 0x80  # FFmpeg converts colours to the narrow range
    colours = struct.pack(">4sHHHB", b"nclx", 1, transfer, 6, full_range)
    depth, channels = (10 if pixels.dtype == np.uint16 else 8), (3 if pixels.ndim == 3 else 1)
    for extra in (
        box(b"colr", colours),
        full(b"pixi", 0, 0, bytes([channels, *[depth] * channels])),
        *(box(kind, bytes([value])) for kind, value in display),
    ):
        properties.append(extra)
        associations[primary - 1].append(len(properties) | 0x80 * (extra[4:8] in (b"irot", b"imir")))
    references = []
    if tiles > 1:
        references.append(box(b"dimg", struct.pack(f">{2 + tiles}H", primary, tiles, *range(1, tiles + 1))))
    if thumbnail is not None:
        references.append(box(b"thmb", struct.pack(">HHH", tiles + 1, 1, primary)))
    if alpha is not None:
        properties.append(full(b"auxC", 0, 0, b"urn:mpeg:mpegB:cicp:systems:auxiliary:alpha\0"))
        associations[len(parts) - 1].append(len(properties) | 0x80)
        references.append(box(b"auxl", struct.pack(">HHH", len(parts), 1, primary)))
    if exif:
        kinds.append((b"Exif", 0))
        associations.append([])
        references.append(box(b"cdsc", struct.pack(">HHH", len(kinds), 1, primary)))
    entries = [
        full(b"infe", 2, hidden, struct.pack(">HH4s", number, 0, kind), b"\0")
        for number, (kind, hidden) in enumerate(kinds, 1)
    ]
    chunks = dict(enumerate(payloads, 1))
    if exif:
        chunks[len(kinds)] = struct.pack(">I", 6) + b"Exif\0\0" + exif
    table = b"".join(
        struct.pack(">HB", number, len(indices)) + bytes(indices) for number, indices in enumerate(associations, 1)
    )

    def meta(begin: int) -> bytes:
        places, at = [], begin
        for number, (kind, _) in enumerate(kinds, 1):
            inside = kind == b"grid"
            length = len(grid) if inside else len(chunks[number])
            places.append(struct.pack(">HHHHII", number, int(inside), 0, 1, 0 if inside else at, length))
            at += 0 if inside else length
        return full(
            b"meta", 0, 0,
            full(b"hdlr", 0, 0, bytes(4), b"pict", bytes(13)),
            full(b"pitm", 0, 0, struct.pack(">H", primary)),
            full(b"iloc", 1, 0, b"\x44\0", struct.pack(">H", len(kinds)), *places),
            full(b"iinf", 0, 0, struct.pack(">H", len(kinds)), *entries),
            *([full(b"iref", 0, 0, *references)] if references else []),
            box(b"iprp", box(b"ipco", *properties),
                full(b"ipma", 0, 0, struct.pack(">I", len(associations)), table)),
            *([box(b"idat", grid)] if grid else []),
        )  # fmt: skip

    head = box(b"ftyp", b"heic", bytes(4), b"mif1heic")
    begin = len(head) + len(meta(0)) + 8
    body = b"".join(chunks[number] for number in sorted(chunks))
    return head + meta(begin) + box(b"mdat", body)
