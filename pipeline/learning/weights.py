"""Weight files: safetensors, with what was trained, how and on what in the header.

A file without that header, of another architecture, cut short, changed after it was written, or with values that are
not finite or absurdly large is refused with one line.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError

if TYPE_CHECKING:
    import torch

LARGEST_WEIGHT = 1e6


def save(path: str | Path, tensors: Mapping[str, torch.Tensor], architecture: str, **details: Any) -> None:
    """Write a network's weights.

    Args:
        path: ``.safetensors``.
        tensors: a state dict.
        architecture: name and version, e.g. ``"mtf-spectral-1"``; `load` compares it.
        details: anything JSON can hold: parameters, seed, fingerprint of the training, validation.
    """
    from safetensors.torch import save_file

    from pipeline.store import replacing

    content = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    # One entry: safetensors does not keep the order of several, and files should be the same byte for byte.
    written = {"architecture": architecture, "tensors_sha256": tensors_sha256(content), **details}
    header = json.dumps(written, sort_keys=True)
    with replacing(path) as temporary:
        save_file(content, temporary, {"pipeline": header})


def tensors_sha256(tensors: Mapping[str, torch.Tensor]) -> str:
    """SHA-256 of names, types, shapes and values of tensors, in the order of their names."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        tensor = tensors[name].detach().cpu().contiguous()
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}\n".encode())
        digest.update(tensor.numpy().tobytes())
    return digest.hexdigest()


def details(path: str | Path) -> dict[str, Any]:
    """What the header of a weight file says: ``architecture`` and whatever was saved beside it.

    Raises:
        InputError: no such file, not a weight file of this package, or cut short.
    """
    return _read(path, tensors=False)[0]


def load(path: str | Path, architecture: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Read a network's weights.

    Args:
        path: file written by `save`.
        architecture: expected name and version.

    Returns:
        the tensors by name, and the header (see `details`).

    Raises:
        InputError: no such file, not a weight file of this package, cut short, changed, or of another architecture;
            or its values are not finite or absurdly large.
    """
    header, content = _read(path, tensors=True)
    if header["architecture"] != architecture:
        raise InputError(
            f"{path}: holds weights of '{header['architecture']}', expected '{architecture}'; "
            "name the right file or train anew (dvc repro)"
        )
    _check_values(path, content)
    if "tensors_sha256" in header and header["tensors_sha256"] != tensors_sha256(content):
        raise InputError(f"{path}: the weights are not those that were written (SHA-256 differs); restore the file")
    return content, header


def _check_values(path: str | Path, tensors: Mapping[str, torch.Tensor]) -> None:
    """Refuse values that no training of this package leaves.

    Raises:
        InputError: a value is NaN, infinite, or larger than `LARGEST_WEIGHT`.
    """
    for name, tensor in tensors.items():
        if not tensor.is_floating_point() or not tensor.numel():
            continue
        if not bool(tensor.isfinite().all()):
            raise InputError(f"{path}: tensor '{name}' holds values that are NaN or infinite; restore the file")
        if float(tensor.abs().max()) > LARGEST_WEIGHT:
            raise InputError(
                f"{path}: tensor '{name}' holds values up to {float(tensor.abs().max()):.3g}, expected at most "
                f"{LARGEST_WEIGHT:g}; restore the file"
            )


def into(model: torch.nn.Module, path: str | Path, architecture: str) -> dict[str, Any]:
    """Load weights into a model, which must have exactly those; returns the header.

    Raises:
        InputError: see `load`; or names or shapes do not fit the model.
    """
    tensors, header = load(path, architecture)
    try:
        model.load_state_dict(tensors)
    except RuntimeError as error:
        lines = [line.strip() for line in str(error).splitlines()[1:2]]
        raise InputError(f"{path}: does not fit the network '{architecture}' ({' '.join(lines)})") from None
    return header


def _read(path: str | Path, tensors: bool) -> tuple[dict[str, Any], dict[str, torch.Tensor]]:
    from safetensors import SafetensorError, safe_open

    if not Path(path).is_file():
        raise InputError(f"{path}: no such weight file; dvc repro trains it, git checkout restores a released one")
    try:
        with safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {}).get("pipeline", "null"))
            names = list(file.keys()) if tensors else []
            content = {name: file.get_tensor(name) for name in names}
    except (SafetensorError, OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a readable safetensors file ({error}); restore or train it anew") from None
    if not isinstance(header, dict) or "architecture" not in header:
        raise InputError(f"{path}: says nothing of its architecture; expected a file written by pipeline.learning")
    return header, content
