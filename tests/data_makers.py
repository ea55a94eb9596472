"""Makers of small fake datasets in each original layout, for tests of readers and of whole runs.

Every maker writes below a given folder, deterministically, and returns the root a dataset is opened with. The
pictures are overlapping ellipses and bars of random grey under fine texture: edges at many scales, as estimators
need, with dark "objects" on them whose boxes are the labels.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path

import cv2
import numpy as np

from pipeline.camera.mtf import sample
from pipeline.streams import stream

Corners = tuple[int, int, int, int]


def picture(name: str, width_px: int = 448, height_px: int = 320, objects: tuple[Corners, ...] = ()) -> np.ndarray:
    """A textured grey picture, (H, W) uint8, with a dark rectangle at each object."""
    return _picture(name, width_px, height_px, tuple(tuple(corners) for corners in objects)).copy()


@functools.lru_cache(maxsize=64)
def _picture(name: str, width_px: int, height_px: int, objects: tuple[Corners, ...]) -> np.ndarray:
    draw = stream(0, "fake picture", name)
    image = np.full((height_px, width_px), 150, np.uint8)
    for _ in range(150):
        centre = (int(draw.integers(width_px)), int(draw.integers(height_px)))
        axes = (int(draw.integers(3, 60)), int(draw.integers(3, 40)))
        angle, grey = float(draw.uniform(0, 180)), int(draw.integers(30, 240))
        cv2.ellipse(image, centre, axes, angle, 0, 360, grey, -1)
    image = np.clip(image + draw.normal(0, 2.0, image.shape), 0, 255)
    for x1, y1, x2, y2 in objects:
        image[y1:y2, x1:x2] = 40 + 20 * ((np.arange(y1, y2)[:, None] // 6 + np.arange(x1, x2)[None] // 9) % 2)
    return np.rint(image).astype(np.uint8)


def gaussian_mtf(sigma_px: float) -> np.ndarray:
    """(2, 8) MTF of a Gaussian blur as OpenCV's kernel gives it."""
    kernel = cv2.getGaussianKernel(21, sigma_px)
    return sample(kernel @ kernel.T)


def write(path: Path, image: np.ndarray) -> None:
    """Write a picture, making its folder; colour is RGB."""
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image if image.ndim == 2 else image[..., ::-1])


def make_kitti(path: Path, frames: int = 3, previous: int = 3, width_px: int = 448, height_px: int = 320) -> Path:
    """KITTI's layout: colour PNG, 15-field labels (a Car, a Pedestrian, a low Car, DontCare), previous frames."""
    root = Path(path)
    labels = root / "training" / "label_2"
    labels.mkdir(parents=True, exist_ok=True)
    for number in range(frames):
        stem = f"{number:06d}"
        x = 60 + 20 * (number % 6)
        car, walker = (x, 120, x + 110, 190), (300, 100, 340, 210)
        grey = picture(f"kitti {stem}", width_px, height_px, (car, walker))
        write(root / "training" / "image_2" / f"{stem}.png", np.repeat(grey[..., None], 3, axis=2))
        for back in range(1, previous + 1):
            moved = (car[0] - 4 * back, car[1], car[2] - 4 * back, car[3])
            before = picture(f"kitti {stem}", width_px, height_px, (moved, walker))
            write(root / "training" / "prev_2" / f"{stem}_{back:02d}.png", before)
        rest = "1.5 1.6 3.9 1.0 1.7 20.0 0.1"
        rows = [
            f"Car 0.00 0 1.55 {car[0]}.00 {car[1]}.00 {car[2]}.00 {car[3]}.00 {rest}",
            f"Pedestrian 0.00 1 -0.20 {walker[0]}.00 {walker[1]}.00 {walker[2]}.00 {walker[3]}.00 {rest}",
            f"Car 0.00 0 1.55 200.00 60.00 240.00 80.00 {rest}",
            "DontCare -1 -1 -10 10.00 20.00 50.00 40.00 -1 -1 -1 -1000 -1000 -1000 -10",
        ]
        (labels / f"{stem}.txt").write_text("\n".join(rows) + "\n")
    return root


def make_udacity(path: Path, frames: int = 3, layout: str = "both", width_px: int = 448, height_px: int = 320) -> Path:
    """Udacity's layouts: JPEG named by nanoseconds at 2 Hz, ``labels.csv``; the last frame has no object.

    ``layout`` is ``"autti"``, ``"crowdai"`` or ``"both"``, with the same boxes.
    """
    root = Path(path)
    spaced, commas = [], ["xmin,ymin,xmax,ymax,Frame,Label,Preview URL"]
    folders = {"autti": root / "object-dataset", "crowdai": root / "object-detection-crowdai"}
    wanted = [folder for name, folder in folders.items() if layout in (name, "both")]
    for number in range(frames):
        file = f"{1478020193690486111 + number * 500_000_000}.jpg"
        x = 50 + 10 * (number % 10)
        car, truck = (x, 110, x + 100, 180), (260, 90, 400, 220)
        objects = (car, truck) if number < frames - 1 else ()
        image = picture(f"udacity {number}", width_px, height_px, objects)
        for folder in wanted:
            write(folder / file, np.repeat(image[..., None], 3, axis=2))
        for word, (x1, y1, x2, y2) in zip(("car", "truck"), objects, strict=False):
            spaced.append(f'{file} {x1} {y1} {x2} {y2} 0 "{word}"')
            commas.append(f"{x1},{y1},{x2},{y2},{file},{word.capitalize()},http://example.org/{number}")
    if folders["autti"] in wanted:
        (folders["autti"] / "labels.csv").write_text("\n".join(spaced) + "\n")
    if folders["crowdai"] in wanted:
        (folders["crowdai"] / "labels.csv").write_text("\n".join(commas) + "\n")
    return root


def make_folder(path: Path, frames: int = 3, labels: bool = True, width_px: int = 448, height_px: int = 320) -> Path:
    """A plain folder: ``images/frame-N.png`` and ``labels/frame-N.txt`` (a car, and a difficult traffic light)."""
    root = Path(path)
    for number in range(frames):
        x = 40 + 30 * (number % 8)
        car = (x, 130, x + 130, 200)
        write(root / "images" / f"frame-{number}.png", picture(f"folder {number}", width_px, height_px, (car,)))
        if labels:
            (root / "labels").mkdir(exist_ok=True)
            rows = f"car {' '.join(map(str, car))}\ntraffic light 300 40 320 90 difficult"
            (root / "labels" / f"frame-{number}.txt").write_text(rows)
    return root


def make_sim(
    path: Path, viewpoints: int = 2, split: str = "evaluation", width_px: int = 448, height_px: int = 320
) -> Path:
    """The rendering stage's layout: four moments a viewpoint, PNG and JSON (a car, a person, a hidden car)."""
    root = Path(path)
    for number in range(viewpoints):
        for moment in range(4):
            name = f"{split}-{number:04d}-{moment}"
            car, person = (80 + 6 * moment, 140, 200 + 6 * moment, 210), (320, 110, 350, 200)
            image = picture(f"sim {split} {number}", width_px, height_px, (car, person))
            write(root / split / f"{name}.png", image)
            boxes = [
                _sim_box("car", car, 1.0),
                _sim_box("person", person, 0.9),
                _sim_box("car", (200, 100, 230, 140), 0.1),
            ]
            (root / split / f"{name}.json").write_text(json.dumps({"boxes": boxes}))
    return root


def _sim_box(label: str, box: Corners, visible: float) -> dict[str, object]:
    pixels = (box[2] - box[0]) * (box[3] - box[1])
    return {"label": label, "box": list(box), "amodal": list(box), "visible_fraction": visible, "pixels": pixels}
