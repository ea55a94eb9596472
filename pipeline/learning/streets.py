"""Street-like pictures: sky, road with markings, buildings, trees, cars, poles, wires and shadows, all by formula.

They need not look real. They give a network the statistics of upright scenes: more horizontal than vertical detail on
the ground, periodic windows, thin poles, text, soft shadows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.learning.textures import OUTLINES, Plane, fill, outline, power_law, rectangle, smooth_field


def draw(generator: np.random.Generator, size_px: int, supersampling: int = 2) -> Plane:
    """One street-like picture.

    Args:
        generator: source of randomness.
        size_px: side of the picture, pixels.
        supersampling: it is drawn that much finer and averaged.

    Returns:
        (size, size) float32, 0..255.
    """
    import cv2

    street = _Street(generator, size_px * supersampling)
    street.sky_and_road()
    for paint, most in ((street.building, 5), (street.tree, 4), (street.car, 6), (street.pole, 6), (street.wires, 2)):
        for _ in range(int(generator.integers(most))):
            paint()
    street.light(supersampling)
    return cv2.resize(np.clip(street.image, 0, 255), (size_px, size_px), interpolation=cv2.INTER_AREA)


@dataclass
class _Street:
    """A picture in the making: (size, size) DN, its horizon in pixels."""

    generator: np.random.Generator
    size: int

    def __post_init__(self) -> None:
        self.horizon = self.generator.uniform(-0.2, 1.1) * self.size
        self.road_dn = self.generator.uniform(40, 140)
        self.image = np.zeros((self.size, self.size), np.float32)

    def pick(self, low: float, high: float) -> float:
        """A number between these, all equally likely."""
        return float(self.generator.uniform(low, high))

    def sky_and_road(self) -> None:
        """Bright sky with clouds, grained road with markings towards a vanishing point."""
        height = np.arange(self.size, dtype=np.float32)[:, None] / self.size
        self.image += np.float32(self.pick(120, 300)) - height * np.float32(self.pick(-30, 60))
        if self.generator.random() < 0.4:
            clouds = smooth_field(self.generator, self.size, 1.8) * np.float32(self.pick(5, 40))
            self.image += np.clip(clouds, -60, 60)
        below = np.arange(self.size) > self.horizon
        if not below.any():
            return
        slope = (height - np.float32(self.horizon / self.size)) * np.float32(self.pick(-40, 60))
        grain = power_law(self.generator, self.size, self.pick(0.3, 1.0)) * np.float32(self.pick(1, 9))
        self.image[below] = (np.float32(self.road_dn) + slope + grain)[below]
        vanishing = np.array([self.pick(0, self.size), self.horizon])
        for _ in range(int(self.generator.integers(1, 5))):
            end = np.array([self.pick(-self.size, 2 * self.size), 1.3 * self.size])
            half = np.array([self.pick(5, 40), 0.0])
            grey = self.pick(150, 255)
            dashes = int(self.generator.integers(2, 12)) if self.generator.random() < 0.6 else 1
            for start in np.linspace(0, 1, dashes, endpoint=False):
                stop = min(start + 0.07 + 0.1 * start, 1.0) if dashes > 1 else 1.0
                sides = [(start, -half), (start, half), (stop, half), (stop, -half)]
                corners = np.array([vanishing + (end + side - vanishing) * share for share, side in sides])
                fill(self.image, corners, grey)

    def building(self) -> None:
        """A facade with rows of windows."""
        size = self.size
        x, width = self.pick(-0.2, 1) * size, self.pick(0.1, 0.6) * size
        top, bottom = self.horizon - self.pick(0.05, 0.9) * size, self.horizon + self.pick(0, 0.1) * size
        fill(self.image, rectangle(x, top, width, bottom - top), self.pick(20, 230))
        step_x, step_y = self.pick(14, 90), self.pick(14, 90)
        window_x, window_y, glass = step_x * self.pick(0.3, 0.85), step_y * self.pick(0.3, 0.85), self.pick(0, 255)
        for left in np.arange(x + 0.3 * step_x, x + width - step_x, step_x):
            for upper in np.arange(top + 0.3 * step_y, bottom - step_y, step_y):
                grey = float(np.clip(glass + self.generator.normal(0, 25), 0, 255))
                fill(self.image, rectangle(left, upper, window_x, window_y), grey)

    def tree(self) -> None:
        """A trunk and a crown of many small leaves."""
        size, dark = self.size, self.pick(10, 120)
        x, y, crown = self.pick(0, size), self.horizon - self.pick(0, 0.35) * size, self.pick(0.05, 0.35) * size
        fill(self.image, rectangle(x, y, self.pick(4, 30), max(self.horizon + 20 - y, 1)), 0.6 * dark)
        for _ in range(int(self.pick(100, 900))):
            angle, reach = self.pick(0, 2 * np.pi), crown * np.sqrt(self.generator.random())
            centre = (x + reach * np.cos(angle), y + reach * np.sin(angle))
            leaf = outline(self.generator, str(self.generator.choice(OUTLINES)), centre, self.pick(3, 16))
            fill(self.image, leaf, float(np.clip(dark + self.generator.normal(0, 35), 0, 255)))

    def car(self) -> None:
        """A car from its side: shadow, body, windows, wheels, number plate and lamps."""
        x, width = self.pick(-0.1, 0.95) * self.size, self.pick(0.06, 0.45) * self.size
        height, bottom = width * self.pick(0.4, 0.9), self.horizon + self.pick(0, 0.5) * self.size
        corner, scale = np.array([x, bottom - height]), np.array([width, height])

        def part(points: list[list[float]], grey: float) -> None:
            fill(self.image, np.array(points) * scale + corner, grey)

        def disc(share_x: float, radius: float, grey: float) -> None:
            turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
            circle = np.stack([np.cos(turn), np.sin(turn)], axis=1) * radius * width
            fill(self.image, circle + np.array([x + share_x * width, bottom - 0.06 * height]), grey)

        part([[-0.05, 0.95], [1.05, 0.95], [1.1, 1.06], [-0.1, 1.06]], max(self.road_dn - 40, 0))
        body = [[0, 0.5], [0.12, 0.42], [0.25, 0], [0.75, 0], [0.9, 0.42], [1, 0.5], [1, 0.92], [0, 0.92]]
        part(body, self.pick(10, 255))
        glass = self.pick(0, 120)
        part([[0.28, 0.06], [0.48, 0.06], [0.48, 0.4], [0.18, 0.4]], glass)
        part([[0.52, 0.06], [0.73, 0.06], [0.84, 0.4], [0.52, 0.4]], glass)
        for share in (0.2, 0.8):
            disc(share, 0.09, self.pick(0, 40))
            disc(share, 0.045, self.pick(80, 200))
        part([[0.4, 0.65], [0.6, 0.65], [0.6, 0.78], [0.4, 0.78]], self.pick(160, 255))
        number, size = str(self.generator.integers(1000, 99999)), max(0.12 * height / 22, 0.1)
        position = (int(x + 0.41 * width), int(bottom - 0.24 * height))
        thick = max(1, int(height / 90))
        self._write(number, position, size, self.pick(0, 80), thick)
        for share in (0.03, 0.88):
            part([[share, 0.52], [share + 0.09, 0.52], [share + 0.09, 0.62], [share, 0.62]], self.pick(80, 330))

    def _write(self, text: str, corner: tuple[int, int], scale: float, grey: float, thickness: int) -> None:
        """Draw text with its lower left corner there (OpenCV writes on 8-bit images only)."""
        import cv2

        mask = np.zeros(self.image.shape, np.uint8)
        cv2.putText(mask, text, corner, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, thickness)
        self.image[mask > 127] = grey

    def pole(self) -> None:
        """A post, often with a round sign with a number."""
        import cv2

        x, width, lean = self.pick(0, self.size), self.pick(2, 24), self.generator.normal(0, 8)
        top, bottom = self.horizon - self.pick(0.1, 1) * self.size, self.horizon + self.pick(0, 0.3) * self.size
        fill(self.image, np.array([[x, top], [x + width, top], [x + width + lean, bottom], [x + lean, bottom]]),
             self.pick(0, 255))  # fmt: skip
        if self.generator.random() < 0.6:
            radius, y = self.pick(12, 60), self.horizon - self.pick(0.1, 0.6) * self.size
            for share in (1.0, 0.75):
                cv2.circle(self.image, (int(x), int(y)), int(radius * share), self.pick(0, 255), -1)
            position, thick = (int(x - 0.6 * radius), int(y + 0.3 * radius)), max(1, int(radius / 10))
            number = str(self.generator.integers(10, 99))
            self._write(number, position, radius / 32, self.pick(0, 255), thick)

    def wires(self) -> None:
        """Thin lines from side to side."""
        for _ in range(int(self.generator.integers(1, 6))):
            left, right, width = self.pick(-0.2, 1) * self.size, self.pick(-0.2, 1) * self.size, self.pick(1, 5)
            corners = np.array([[0, left], [self.size, right], [self.size, right + width], [0, left + width]])
            fill(self.image, corners, self.pick(0, 120))

    def light(self, supersampling: int) -> None:
        """Uneven reflectance, soft-edged shadows and fine grain over everything."""
        import cv2

        if self.generator.random() < 0.7:
            stains = smooth_field(self.generator, self.size, 2.0) * np.float32(self.pick(0, 0.35))
            self.image *= 1 + np.float32(0.5) * np.clip(stains, -0.8, 0.8)
        if self.generator.random() < 0.5:
            shadow = np.zeros((self.size, self.size), np.uint8)
            for _ in range(int(self.generator.integers(1, 6))):
                centre = (self.pick(0, self.size), self.pick(0, self.size))
                fill(
                    shadow,
                    outline(self.generator, str(self.generator.choice(OUTLINES)), centre, self.pick(30, 250)),
                    255,
                )
            soft = cv2.GaussianBlur(shadow, (0, 0), self.pick(0.5, 6) * supersampling)
            self.image *= 1 - soft.astype(np.float32) / 255 * np.float32(self.pick(0.1, 0.6))
        grain = power_law(self.generator, self.size, self.pick(0.4, 1.2))
        self.image += grain * np.float32(np.exp(self.pick(np.log(0.3), np.log(4))))
