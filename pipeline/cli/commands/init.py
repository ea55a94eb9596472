"""``camera-monitor init``: a small project with a dataset, estimator, detector and policy of one's own that runs."""

from __future__ import annotations

import shlex
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pipeline.cli.options.given_paths import GivenPath
from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

FILES = ("README.md", "run.py", "estimator.py", "detector.py", "policy.py", "pyproject.toml")
PICTURES = 4
WIDTH_PX, HEIGHT_PX = 480, 320
CARS = 3


@click.command("init")
@click.argument("folder", type=GivenPath())
def command(folder: Path) -> None:
    """Make a project in FOLDER, which is new or empty: pictures with labels, an estimator, a detector and a policy.

    Every part is a short file to replace by one's own; ``python run.py`` there runs all of them.
    """
    from pipeline.store import write_image, write_text

    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder}: exists and is not an empty folder; name a new one")
        (folder / "data/images").mkdir(parents=True)
        (folder / "data/labels").mkdir()
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}); name another folder") from None
    templates = resources.files("pipeline.cli.new_project")
    for name in FILES:
        write_text(folder / name, templates.joinpath(f"{name}.txt").read_text(encoding="utf-8"))
    for number in range(PICTURES):
        image, boxes = scene(number)
        write_image(folder / f"data/images/scene_{number}.png", image)
        lines = "".join(f"car {x1} {y1} {x2} {y2}\n" for x1, y1, x2, y2 in boxes)
        write_text(folder / f"data/labels/scene_{number}.txt", lines)
    click.echo(f"written to {folder}; next: cd {shlex.quote(str(folder))} && python run.py")


def scene(number: int) -> tuple[NDArray[np.uint8], list[tuple[int, int, int, int]]]:
    """A picture with dark boxes on a bright ground with texture.

    Args:
        number: of the picture; another number, another picture.

    Returns:
        (H, W) grey levels, and corners (x1, y1, x2, y2) of the boxes in pixels.
    """
    import numpy as np

    from pipeline.streams import stream

    generator = stream(0, "init", "scene", number)
    coarse = generator.normal(150, 18, (HEIGHT_PX // 16, WIDTH_PX // 16))
    image = np.kron(coarse, np.ones((16, 16))) + generator.normal(0, 2, (HEIGHT_PX, WIDTH_PX))
    boxes = []
    for index in range(CARS):
        width, height = (int(side) for side in generator.integers(40, 110, 2))
        left = index * WIDTH_PX // CARS + int(generator.integers(5, WIDTH_PX // CARS - width - 5))
        top = int(generator.integers(20, HEIGHT_PX - height - 20))
        image[top : top + height, left : left + width] = 30 + generator.normal(0, 4, (height, width))
        boxes.append((left, top, left + width, top + height))
    return np.rint(np.clip(image, 0, 255)).astype(np.uint8), boxes
