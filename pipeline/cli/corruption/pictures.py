"""Corrupted pictures of a command, written one by one with their truth: NAME.png and NAME.json of every frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from pipeline.cli.ending_signals import held

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.cli.frames.set_aside import SetAside


class CorruptedPicture(NamedTuple):
    """One corrupted picture.

    Attributes:
        image: (H, W) or (H, W, 3), as `pipeline.store.write_image` takes it.
        truth: for NAME.json, which has the name of the frame as ``source`` beside it.
        line: what is printed of it, before the names.
    """

    image: NDArray[Any]
    truth: Mapping[str, Any]
    line: str


def write_each(
    frames: Iterable[tuple[str, NDArray[Any] | None, str]],
    files: Sequence[Path],
    out: Path,
    header: str,
    make: Callable[[str, str, NDArray[Any]], CorruptedPicture],
    note: str = "",
) -> tuple[bool, SetAside]:
    """Corrupt frames, write them with their truth, and print a line of each and the folder.

    Args:
        frames: name, picture or None, and the reason for None.
        files: that they are of.
        out: folder of the results; those of the last run there go.
        header: of the printed lines, before the names.
        make: the corrupted picture of a frame, from its name, the stem of its results and the picture; a frame of which
            it raises InputError is set aside.
        note: printed before the folder.

    Returns:
        whether anything was written, and what was set aside, which the caller refuses at its end.

    Raises:
        OutputError: the folder cannot be used.
    """
    from tqdm import tqdm

    from pipeline import store
    from pipeline.cli.frames.names import result_stem
    from pipeline.cli.frames.set_aside import SetAside
    from pipeline.cli.results.output_folder import OutputFolder, stems_kept
    from pipeline.errors import InputError, printable

    set_aside = SetAside()
    kept = stems_kept(files, ".png")
    with OutputFolder(out, "corrupt", "--out", files) as folder:
        click.echo(f"{header}  picture -> file")
        for name, image, problem in tqdm(frames, delay=2, leave=False, unit=" frames"):
            stem = result_stem(name)
            stem = Path(name).stem if stem == Path(name).name else stem
            try:
                if image is None:
                    raise InputError(problem)
                corrupted = make(name, stem, image)
            except InputError as error:
                set_aside.add(name, error)
                continue
            picture, sidecar = folder.claim_all(stem, (".png", ".json"), () if Path(name).suffix == ".png" else kept)
            with held():
                store.write_image(picture, corrupted.image)
                store.write_json(sidecar, {**corrupted.truth, "source": name})
            click.echo(f"{corrupted.line}  {printable(name)} -> {printable(picture.name)}")
    if note:
        click.echo(note)
    if folder.any_claimed:
        click.echo(f"written to {out}")
    return folder.any_claimed, set_aside
