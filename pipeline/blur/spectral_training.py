"""Training the spectral network: what it is fed, what it minimises, how it is validated."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.learning.samples import Recipe, Samples
from pipeline.learning.trainer import Schedule, Trained

if TYPE_CHECKING:
    import torch

SIGMA_WEIGHT = 0.05  # of the noise's likelihood beside the MTF's
COVERAGE = 0.95


@dataclass(frozen=True)
class Settings:
    """A training of the spectral network.

    Attributes:
        schedule: of the optimiser.
        recipe: of the samples.
        images, validation_images: pictures in the banks.
        kernels: kernels in the bank.
        fresh, uses, window: see `pipeline.learning.feed`; a batch has fresh * uses chunks.
        validation_chunks: chunks that weights are selected on, of pictures and kernels never trained on.
        seed: of everything.
    """

    schedule: Schedule
    recipe: Recipe = field(default_factory=Recipe)
    images: int = 2400
    validation_images: int = 160
    kernels: int = 24_000
    fresh: int = 1
    uses: int = 3
    window: int = 256
    validation_chunks: int = 40
    seed: int = 1


@dataclass
class Maker:
    """Makes chunks of features: chunk number -> arrays. Opens its banks on first use, in whichever process that is."""

    settings: Settings
    cache: Path
    validation: bool = False
    _samples: Samples | None = None

    def __call__(self, number: int) -> dict[str, np.ndarray]:
        """Features and truth of a chunk: maps, vector (float16), mtf, sigma_dn (float32)."""
        import torch

        from pipeline.blur.spectral_features import features

        if self._samples is None:
            self._samples = self.open()
        chunk = self._samples.chunk(number)
        maps, vector = features(torch.from_numpy(chunk.patches_dn).float())
        return {
            "maps": maps.half().numpy(),
            "vector": vector.half().numpy(),
            "mtf": chunk.mtf,
            "sigma_dn": chunk.sigma_dn,
        }

    def open(self) -> Samples:
        """The sampler with its banks, made if they are not in the cache."""
        from pipeline.learning import images, kernels

        word = "validation" if self.validation else "training"
        settings = self.settings
        count = settings.validation_images if self.validation else settings.images
        tiles = images.bank(count, settings.seed, purpose=f"{word} image", folder=self.cache / "images")
        bank = kernels.bank(
            settings.kernels if not self.validation else max(settings.kernels // 16, kernels.BLOCK),
            settings.seed,
            purpose=f"{word} kernels",
            folder=self.cache / "kernels",
        )
        return Samples(tiles, bank, settings.recipe, settings.seed, f"{word} samples")


def loss(model: torch.nn.Module, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, float]]:
    """Likelihood of MTF and noise; half of the batch, the repeated and some fresh, is seen mirrored.

    Every second sample of the batch is mirrored, so a sample that comes again elsewhere may look different.
    """
    import torch

    from pipeline.blur.spectral_features import mirrored
    from pipeline.blur.spectral_net import laplace_loss

    maps = batch["maps"].float()
    other = torch.arange(len(maps)) % 2 == 1
    maps[other] = mirrored(maps[other])
    mtf, scale, sigma_dn, sigma_scale = model(maps, batch["vector"].float())
    value = laplace_loss(mtf, scale, batch["mtf"])
    value = value + SIGMA_WEIGHT * laplace_loss(sigma_dn, sigma_scale, batch["sigma_dn"])
    measures = {
        "mtf_error_percent": 100 * float((mtf - batch["mtf"]).detach().abs().mean()),
        "sigma_error_dn": float((sigma_dn - batch["sigma_dn"]).detach().abs().mean()),
    }
    return value, measures


def validation(settings: Settings, cache: Path) -> Callable[[torch.nn.Module], dict[str, float]]:
    """Measures of a network on held-out samples: mean absolute errors, and how wide intervals must be.

    ``interval`` is the factor k for which m +- k b holds the truth in 95 % of the values.
    """
    import torch

    make = Maker(settings, cache, validation=True)
    made = [make(number) for number in range(settings.validation_chunks)]
    data = {name: torch.from_numpy(np.concatenate([one[name] for one in made])) for name in made[0]}

    def measure(model: torch.nn.Module) -> dict[str, float]:
        pieces = zip(data["maps"].split(256), data["vector"].split(256), strict=True)
        found = [model(maps.float(), vector.float()) for maps, vector in pieces]
        mtf, scale, sigma_dn, _ = (torch.cat(parts) for parts in zip(*found, strict=True))
        error = (mtf - data["mtf"]).abs()
        clean = data["sigma_dn"] == 0
        return {
            "mtf_error_percent": 100 * float(error.mean()),
            "mtf_error_clean_percent": 100 * float(error[clean].mean()),
            "mtf_error_noisy_percent": 100 * float(error[~clean].mean()),
            "sigma_error_dn": float((sigma_dn - data["sigma_dn"]).abs().mean()),
            "interval": float(torch.quantile((error / scale).flatten(), COVERAGE)),
        }

    return measure


def fingerprint(settings: Settings) -> str:
    """What a training depends on, hashed: its settings and the source of its code."""
    import pipeline.blur.spectral_features
    import pipeline.blur.spectral_net
    import pipeline.learning

    text = hashlib.blake2b(json.dumps(asdict(settings), sort_keys=True).encode(), digest_size=8)
    sources = sorted(Path(pipeline.learning.__file__).parent.glob("*.py"))
    for module in (pipeline.blur.spectral_features, pipeline.blur.spectral_net):
        sources.append(Path(str(module.__file__)))
    for path in [*sources, Path(__file__)]:
        text.update(path.read_bytes())
    return text.hexdigest()


def train(
    settings: Settings,
    cache: Path,
    *,
    folder: Path | None = None,
    producers: int = 1,
    executor: Mapping[str, Any] | None = None,
    report: Callable[[dict[str, float]], None] | None = None,
) -> Trained:
    """Train the spectral network.

    Args:
        settings: all that the result depends on.
        cache: folder for banks and checkpoints, outside of any stage's outputs.
        folder: of the checkpoints; None names it by the `fingerprint`.
        producers: processes that make samples ahead; 0 makes them in this one. Does not change the result.
        executor: of `pipeline.executor.run_map`, for the banks.
        report: called with every new row of the learning curve.

    Returns:
        the network that validated best, and its learning curve.
    """
    import torch

    from pipeline.blur.spectral_net import SpectralNet
    from pipeline.executor import one_thread
    from pipeline.learning import images, kernels
    from pipeline.learning.feed import Feed
    from pipeline.learning.initial import initialise
    from pipeline.learning.trainer import train as run

    one_thread()
    seed = settings.seed
    # Banks first, with all the workers there are; the producers then only read them.
    images.bank(settings.images, seed, folder=cache / "images", executor=executor)
    kernels.bank(settings.kernels, seed, folder=cache / "kernels", executor=executor)
    measure = validation(settings, cache)
    model = SpectralNet(half_precision=torch.backends.mkldnn.is_available())
    initialise(model, seed, "spectral network")
    model = model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if folder is None:
        folder = cache / f"spectral-{fingerprint(settings)}"
    maker = Maker(settings, cache)
    options = {"fresh": settings.fresh, "uses": settings.uses, "window": settings.window, "producers": producers}
    with Feed(maker, seed, **options) as feed:
        trained = run(
            model,
            loss,
            feed,
            settings.schedule,
            folder=folder,
            validate=measure,
            score="mtf_error_percent",
            report=report,
        )
    return trained
