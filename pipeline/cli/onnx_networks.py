"""The released networks in ONNX format: what each takes and gives, and a file that equals the original.

A file holds the network alone. What precedes it (statistics of a patch, `features` of its package) and what follows
(abstentions, non-maximum suppression) stay in Python; the description of each network names them.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError, did_you_mean

if TYPE_CHECKING:
    import numpy as np
    import torch
    from numpy.typing import NDArray

OPSET = 17
LARGEST_DIFFERENCE = 1e-4
BATCH = 3  # of the patches that the export is compared with


@dataclass(frozen=True)
class Network:
    """A released network.

    Attributes:
        load: makes it, with its weights.
        features: (N, 1, S, S) patches in [0, 1] -> its inputs by name, the first axis of each being the batch.
        side_px: side S of such patches.
        outputs: names.
        description: of inputs and outputs.
    """

    load: Callable[[], torch.nn.Module]
    features: Callable[[torch.Tensor], dict[str, torch.Tensor]]
    side_px: int
    outputs: tuple[str, ...]
    description: str


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes:
        inputs, outputs: name -> shape, with ``N`` for the batch.
        difference: largest difference from PyTorch, as a fraction of the output's largest value (or of 1).
        description: of the network.
        weights_sha256: of the weight file that it was made from.
    """

    inputs: dict[str, tuple[Any, ...]]
    outputs: dict[str, tuple[Any, ...]]
    difference: float
    description: str
    weights_sha256: str


def _spectral_features(patches: torch.Tensor) -> dict[str, torch.Tensor]:
    import torch

    from pipeline.blur.networks.spectral_features import features

    return dict(zip(("maps", "vector"), features(torch.round(patches[:, 0] * 255)), strict=True))


def _cellwise_features(patches: torch.Tensor) -> dict[str, torch.Tensor]:
    from pipeline.noise.networks.cellwise_features import features

    return dict(zip(("statistics", "base_dn"), features(patches[:, 0] * 255), strict=True))


def _correlated_features(patches: torch.Tensor) -> dict[str, torch.Tensor]:
    import numpy as np
    import torch

    from pipeline.noise.networks.correlated_features import statistics

    pixels = np.rint(patches[:, 0].numpy() * 255).astype(np.float32)
    return {"statistics": torch.from_numpy(np.stack([statistics(patch) for patch in pixels]))}


def _network_of(package: str, name: str, attribute: str = "network", **options: Any) -> Callable[[], torch.nn.Module]:
    """The network that an estimator of a registry holds."""

    def load() -> torch.nn.Module:
        from pipeline import blur, noise

        estimator: Any = {"blur": blur, "noise": noise}[package].create(name, **options)
        network: torch.nn.Module = getattr(estimator, attribute)
        return network

    return load


def _mtf_pixels() -> torch.nn.Module:
    network: torch.nn.Module = _network_of("blur", "fused", "networks")().pixels  # type: ignore[assignment]
    return network


def _mtf_cnn() -> torch.nn.Module:
    import torch
    from torch import nn

    class BothDirections(nn.Module):
        """MTF along x and along y."""

        def __init__(self) -> None:
            super().__init__()
            self.network = _network_of("blur", "cnn")()

        def forward(self, patches: Any) -> Any:
            """(N, 192, 192) to (N, 2, 8)."""
            turned = patches.transpose(1, 2).flip(2)  # a quarter turn clockwise
            return torch.stack([self.network(patches), self.network(turned)], dim=1)

    return BothDirections()


SPECTRAL = "log power (pipeline.blur.networks.spectral_features.features of patches, DN) to the MTF"
SPECTRAL_OUTPUTS = ("mtf", "mtf_scale", "sigma_dn", "sigma_scale_dn")
NETWORKS = {
    "mtf_spectral": Network(
        _network_of("blur", "spectral", processed=False), _spectral_features, 192, SPECTRAL_OUTPUTS, SPECTRAL
    ),
    "mtf_spectral_processed": Network(
        _network_of("blur", "spectral", "processed"), _spectral_features, 192, SPECTRAL_OUTPUTS,
        f"{SPECTRAL} of processed pictures",
    ),
    "mtf_pixels": Network(
        _mtf_pixels, lambda patches: {"patches_dn": (patches[:, 0] * 255).round()}, 192, SPECTRAL_OUTPUTS,
        "patches, DN, to the MTF",
    ),
    "mtf_cnn": Network(
        _mtf_cnn, lambda patches: {"patches": patches[:, 0]}, 192, ("mtf",), "patches in [0, 1] to the MTF"
    ),
    "sigma_cellwise": Network(
        _network_of("noise", "cellwise"), _cellwise_features, 128, ("sigma_dn", "scale", "map_dn"),
        "statistics (pipeline.noise.networks.cellwise_features.features of patches, DN) to the noise and its map, DN",
    ),
    "sigma_correlated": Network(
        _network_of("noise", "correlated"), _correlated_features, 128,
        ("sigma_dn", "scale", "white_fraction", "correlation", "log_curve"),
        "statistics (pipeline.noise.networks.correlated_features.statistics of patches, DN) to correlated noise, DN",
    ),
    "sigma_cnn": Network(
        _network_of("noise", "cnn"), lambda patches: {"image": patches}, 128, ("sigma",),
        "patches in [0, 1] to the noise of every pixel, white = 1",
    ),
}  # fmt: skip
"""Networks that can be exported, by the name of their weight file."""


def export(name: str, path: Path) -> Exported:
    """Write a released network as an ONNX file whose outputs equal the original's.

    Args:
        name: in `NETWORKS`.
        path: the file; replaced.

    Returns:
        inputs, outputs, the largest difference, and the SHA-256 of the weights.

    Raises:
        InputError: no such network, a package is missing, or the outputs differ by more than `LARGEST_DIFFERENCE`.
    """
    from pipeline.project_files import located
    from pipeline.store import file_sha256, replacing
    from pipeline.weight_files import active

    if name not in NETWORKS:
        raise InputError(f"network '{name}': unknown; {did_you_mean(name, NETWORKS)}")
    network = NETWORKS[name]
    model = network.load().eval()
    example = network.features(example_patches(BATCH - 1, network.side_px))
    with replacing(path) as temporary:
        _write(model, example, network.outputs, temporary)
        other = network.features(example_patches(BATCH, network.side_px))
        expected = original_outputs(model, other)
        difference = largest_difference(expected, run(temporary, other))
        if not difference <= LARGEST_DIFFERENCE:
            raise InputError(f"network '{name}': its ONNX outputs differ by {difference:.2g} of their range")
    inputs = {key: ("N", *value.shape[1:]) for key, value in other.items()}
    outputs = {key: ("N", *value.shape[1:]) for key, value in zip(network.outputs, expected, strict=True)}
    weights_sha256 = file_sha256(active(located(f"data/weights/{name}.safetensors")))
    return Exported(inputs, outputs, difference, network.description, weights_sha256)


def example_patches(count: int, side_px: int) -> torch.Tensor:
    """(N, 1, S, S) float32 patches in [0, 1] of structure and noise, always the same."""
    import numpy as np
    import torch

    from pipeline.streams import stream

    generator = stream(0, "export", count, side_px)
    coarse = generator.random((count, side_px // 8, side_px // 8))
    image = np.kron(coarse, np.ones((1, 8, 8))) * 0.7 + 0.1 + generator.normal(0, 0.02, (count, side_px, side_px))
    return torch.from_numpy(np.clip(image, 0, 1).astype(np.float32)[:, None])


def original_outputs(model: torch.nn.Module, inputs: dict[str, torch.Tensor]) -> list[NDArray[np.float32]]:
    """What the network returns in PyTorch."""
    import torch

    with torch.inference_mode():
        result = model(*inputs.values())
    return [value.numpy() for value in (result if isinstance(result, tuple) else (result,))]


def run(path: Path, inputs: dict[str, torch.Tensor]) -> list[NDArray[np.float32]]:
    """What the file returns in ONNX Runtime on one thread."""
    return session(path).run(None, {name: value.numpy() for name, value in inputs.items()})


def session(path: Path) -> Any:
    """An ONNX Runtime session of the file, on one thread of the processor."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def largest_difference(expected: list[NDArray[np.float32]], result: list[NDArray[np.float32]]) -> float:
    """Largest absolute difference, each output's as a fraction of its largest value (or of 1); infinite for NaN."""
    import numpy as np

    largest = 0.0
    for wanted, value in zip(expected, result, strict=True):
        part = float(np.abs(wanted - value).max() / max(1.0, float(np.abs(wanted).max())))
        largest = max(largest, part if np.isfinite(part) else np.inf)
    return largest


def _write(model: torch.nn.Module, example: dict[str, torch.Tensor], outputs: tuple[str, ...], path: Path) -> None:
    import torch

    names = [*example, *outputs]
    try:
        import onnx  # noqa: F401
    except ImportError:
        raise InputError("the package onnx is missing; pip install 'camera-condition-pipeline[onnx]'") from None
    for operation, symbolic in {"mT": _transposed, "expm1": _exponential_less_one, "log1p": _logarithm_of_more}.items():
        torch.onnx.register_custom_op_symbolic(f"aten::{operation}", symbolic, OPSET)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter's remarks on constants
        torch.onnx.export(
            model, tuple(example.values()), str(path), input_names=list(example), output_names=list(outputs),
            dynamic_axes={name: {0: "N"} for name in names}, opset_version=OPSET, dynamo=False,
        )  # fmt: skip


def _transposed(graph: Any, matrix: Any) -> Any:
    """The last two axes exchanged, which the exporter does not know by the name ``mT``."""
    axes = list(range(matrix.type().dim()))
    axes[-2:] = axes[:-3:-1]
    return graph.op("Transpose", matrix, perm_i=axes)


def _exponential_less_one(graph: Any, value: Any) -> Any:
    """exp(x) - 1."""
    return graph.op("Sub", graph.op("Exp", value), _one(graph))


def _logarithm_of_more(graph: Any, value: Any) -> Any:
    """ln(1 + x)."""
    return graph.op("Log", graph.op("Add", value, _one(graph)))


def _one(graph: Any) -> Any:
    import torch

    return graph.op("Constant", value_t=torch.tensor(1.0))
