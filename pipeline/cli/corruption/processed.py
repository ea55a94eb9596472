"""``camera-monitor corrupt --pipeline``: pictures through a whole camera, with the noise that its processing leaves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LEAST_ISO = 100  # base ISO of the cameras
HEADER = f"{'sigma DN':>8} {'white':>7} {'correlation':>11}"


def run(paths: tuple[Path, ...], out: Path, preset: str, iso: float, shots: int, seed: int, every: int) -> None:
    """Deliver pictures and videos as a named camera would, and write the truth beside each.

    Args:
        paths: files and folders.
        out: folder of NAME.png, the first shot, and NAME.json, its truth.
        preset: name in `pipeline.camera.processing.presets`.
        iso: setting of the camera; 0 for no noise.
        shots: that the truth is measured from.
        seed: of the noise, with the picture's name.
        every: of a video, each n-th frame.

    Raises:
        InputError: no such preset or setting; at the end, if a file could not be used.
    """
    from pipeline.camera.processing import presets
    from pipeline.camera.processing.delivered import deliver
    from pipeline.camera.processing.temporal_noise import LEAST_SIDE_PX
    from pipeline.cli.corruption.pictures import CorruptedPicture, write_each
    from pipeline.cli.frames.given_files import expand
    from pipeline.errors import InputError, printable
    from pipeline.streams import stream

    if 0 < iso < LEAST_ISO:
        raise InputError(f"--iso {iso:g}: expected 0 for no noise, or at least {LEAST_ISO}")
    camera = presets.named(preset).at_iso(iso)
    settings = {"pipeline": preset, "iso": iso, "shots": shots, "seed": seed}
    cropped: list[str] = []

    def delivered(name: str, stem: str, image: NDArray[np.float32]) -> CorruptedPicture:
        shown = deliver(image, camera, shots, stream(seed, "corrupt pipeline", stem, preset, iso))
        if image.shape[0] % 2 or image.shape[1] % 2:
            if not cropped:
                click.echo(
                    f"note: {printable(name)} has {image.shape[1]}x{image.shape[0]} px; the colour mosaic has even "
                    "sides, so the last row or column of odd ones is cut off, in every such picture",
                    err=True,
                )
            cropped.append(name)
        noise = shown.noise
        truth = {
            "sigma_dn": noise.sigma_dn,
            "white_sigma_dn": noise.white_sigma_dn,
            "correlation": noise.correlation,
            "spectrum_dn2": noise.spectrum_dn2,
            "size_in_px": image.shape[1::-1],
            "size_out_px": shown.picture.shape[1::-1],
            **settings,
        }
        line = f"{noise.sigma_dn:8.2f} {noise.white_sigma_dn:7.2f} {noise.correlation:11.2f}"
        return CorruptedPicture(shown.picture, truth, line)

    files = expand(paths)
    _, set_aside = write_each(_coloured(files, every, LEAST_SIDE_PX), files, out, HEADER, delivered)
    set_aside.refuse()


def _coloured(files: Sequence[Path], every: int, least_px: int) -> Iterator[tuple[str, np.ndarray | None, str]]:
    """Name, picture in [0, 1] with its colours (frames of videos are grey) or None, and the reason for None."""
    from pipeline.cli.frames.formats import VIDEOS
    from pipeline.cli.frames.picture_file import read_file
    from pipeline.cli.frames.pictures import readable, refuse
    from pipeline.cli.frames.remarks import point_out
    from pipeline.errors import InputError

    hinted: Counter[int] = Counter()
    for file in files:
        if file.suffix.lower() in VIDEOS:
            yield from (frame[:3] for frame in readable([file], every, hinted, least_px))
            continue
        try:
            refuse(file)
            stored = read_file(file, least_px)
        except InputError as error:
            yield str(file), None, str(error)
            continue
        point_out(file, stored, hinted)
        yield str(file), stored.picture.unit(), ""
