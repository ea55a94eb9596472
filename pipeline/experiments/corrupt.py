"""A frame under a condition, with its ground truth: sharp frames as another camera would have delivered them.

Sampling policy. The noise of a frame and source is drawn once, from the random stream of (seed, dataset, frame, noise
source), and scaled to every target sigma (`pipeline.camera.corruption`); behind every kernel the draw is the same (with
``camera.order: detector`` photon noise follows the blurred light, from the same random numbers). Cells of a table are
therefore paired: between two levels or two kernels nothing changes but the level or the kernel. The detection sweep
and its curves are sampled so. With ``paired=False`` every level and kernel draws from a stream of its own, as the noise
and combined experiments do, whose published numbers were drawn so.

Nothing is stored: a corrupted frame is a pure function of the sharp frame, the condition, the camera and the seed, so
every stage that needs it forms it again, bit for bit. Noise that enters after the optics leaves the blurred light
alone: a frame is then blurred once per kernel, whatever the number of levels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera import chain, corruption, mtf
from pipeline.camera.settings import CameraSettings
from pipeline.camera.truth import Corrupted, local_sigma, through_optics
from pipeline.experiments.condition import SHARP, Condition, CorruptedImage
from pipeline.streams import KeyPart, stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.patches import Patch

ANY_SOURCE = "photon"  # at level 0 no noise is drawn, whatever its source


@dataclass(frozen=True, eq=False)
class FormedImage:
    """A frame corrupted by the camera model: a `pipeline.experiments.condition.CorruptedImage`.

    Attributes:
        formation: the camera model's account of it.
        true_mtf: (2, 8) MTF of the kernel, horizontal and vertical.
    """

    formation: Corrupted
    true_mtf: NDArray[np.float64]

    @property
    def image(self) -> NDArray[np.float32]:
        """(H, W) in [0, 1], on the 8-bit grid."""
        return self.formation.image

    def clipped_sigma_dn(self, patches: Sequence[Patch]) -> NDArray[np.float64]:
        """(N,) standard deviation of the noise present in each patch, DN."""
        return local_sigma(self.formation, patches)

    def unclipped_sigma_dn(self, patches: Sequence[Patch]) -> NDArray[np.float64]:
        """(N,) the same before the 8-bit range clips it, DN."""
        return local_sigma(self.formation, patches, "before")


class SharpFrame:
    """A sharp frame, to be corrupted under any number of conditions; best ordered by kernel.

    Args:
        frame: of a dataset.
        camera: that forms the corrupted image.
        seed: root of the random streams.
        paired: one draw for all levels and kernels; else a draw for each.
    """

    def __init__(self, frame: Frame, camera: CameraSettings, seed: int, *, paired: bool = True) -> None:
        self.frame, self.camera, self.seed, self.paired = frame, camera, seed, paired
        self._draws: dict[tuple[KeyPart, ...], chain.Drawn] = {}
        self._kernel, self._images = SHARP, dict[tuple[str, float], FormedImage]()
        self._blurred: NDArray[np.float32] | None = None

    @cached_property
    def image(self) -> NDArray[np.float32]:
        """(H, W) in [0, 1]."""
        return self.frame.image()

    @cached_property
    def earlier(self) -> list[SharpFrame]:
        """The frames before this one, the oldest first; none unless all are of its size."""
        from pipeline.datasets.decoding.pictures import read_grey

        frames = []
        for back, path in enumerate(self.frame.previous):
            named = replace(self.frame, name=f"{self.frame.name}-{back}")
            moment = SharpFrame(named, self.camera, self.seed, paired=self.paired)
            moment.image = read_grey(path)
            frames.append(moment)
        return frames if all(moment.image.shape == self.image.shape for moment in frames) else []

    def under(self, condition: Condition) -> CorruptedImage:
        """The frame under a condition.

        Args:
            condition: kernel, noise source and target sigma, or another corruption.

        Returns:
            the image and its ground truth; the same object for two conditions in a row that corrupt alike, and for all
            without noise of one kernel.

        Raises:
            InputError: unknown noise source, or one without any noise on this frame.
        """
        if condition.corruption is not None:
            return condition.corruption(self.image, self.frame, condition, self.seed)
        self._turn_to(condition.kernel)
        source = condition.noise_source if condition.noisy or self.camera.kind != "physical" else ""
        key = (source, condition.target_sigma_dn)
        if key not in self._images:
            self._images = {known: image for known, image in self._images.items() if not known[1]}
            self._images[key] = FormedImage(
                self.formation(condition, shared_optics=True), mtf.sample(condition.kernel.psf)
            )
        return self._images[key]

    def formation(self, condition: Condition, *, shared_optics: bool = False) -> Corrupted:
        """The camera model's account of the frame under a condition.

        Args:
            condition: kernel, noise source and target sigma.
            shared_optics: blur the light once for all conditions of a kernel where no photon noise is in it; the
                account then begins behind the optics.
        """
        source = condition.noise_source or ANY_SOURCE
        key = self._key(source, condition)
        name, effects = chain.preset(source)
        sensor, level = self.camera.sensor, float(condition.target_sigma_dn)
        psf = condition.kernel.psf if condition.blurred else None
        options: dict[str, Any] = {"sensor": sensor, "poisson": self.camera.poisson, "key": (self.seed, *key)}
        plain = (self.camera.kind, self.camera.order, self.camera.light) == ("physical", "paper", "encoded")
        if not plain or not (condition.noisy or condition.blurred):
            return corruption.corrupt(
                self.image,
                source,
                sigma_dn=level,
                generator=stream(self.seed, *key),
                psf=psf,
                camera=self.camera.kind,
                order=self.camera.order,
                light=self.camera.light,
                **options,
            )
        light, drawn, noise_scale = self._light, chain.Drawn({}, float("nan"), float("nan")), 0.0
        if condition.noisy:
            drawn = self._drawn(key, effects)
            noise_scale = corruption.noise_scale_to_reach(drawn, level, sensor)
        if shared_optics and psf is not None and "photon" not in drawn.noise_e:
            light, psf = self._behind(condition.kernel), None
        return chain.develop(
            light, drawn, noise_scale=noise_scale, psf=psf, noise_source=name, target_sigma_dn=level, **options
        )

    def _key(self, source: str, condition: Condition) -> tuple[str, *tuple[KeyPart, ...]]:
        head = self.frame.dataset, self.frame.name, source
        if self.paired:
            return "conditions", *head
        kernel = condition.kernel.name if condition.blurred or condition.experiment else None
        return "corrupt", *head, float(condition.target_sigma_dn), kernel

    @cached_property
    def _light(self) -> NDArray[np.float32]:
        """(H, W) mean electrons without any effect."""
        return self.camera.sensor.electrons(chain.as_image(self.image))

    def _drawn(self, key: tuple[str, *tuple[KeyPart, ...]], effects: chain.Effects) -> chain.Drawn:
        """The noise of a source at its natural size: drawn once, and copied since it is scaled in place."""
        if key not in self._draws:
            if not self.paired:
                self._draws.clear()
            sensor, poisson = self.camera.sensor, self.camera.poisson
            self._draws[key] = chain.draw(self._light, effects, sensor, stream(self.seed, *key), poisson=poisson)
        drawn = self._draws[key]
        return replace(drawn, noise_e={name: noise.copy() for name, noise in drawn.noise_e.items()})

    def _turn_to(self, kernel: Kernel) -> None:
        """Forget what was formed for another kernel."""
        if kernel.name != self._kernel:
            self._kernel, self._images, self._blurred = kernel.name, {}, None

    def _behind(self, kernel: Kernel) -> NDArray[np.float32]:
        """(H, W) mean electrons behind the optics."""
        self._turn_to(kernel)
        if self._blurred is None:
            self._blurred = through_optics(self._light, kernel.psf, "reflect")
        return self._blurred
