"""Weight files: safetensors, with what was trained, how and on what in the header.

A file without that header, of another architecture, cut short, changed after it was written, or with values that are
not finite or absurdly large is refused with one line; such values are not written either.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pipeline import weight_files
from pipeline.errors import InputError
from pipeline.learning.inference import caller_settings_kept
from pipeline.store import file_sha256

if TYPE_CHECKING:
    import torch

Made = TypeVar("Made")

LARGEST_WEIGHT = 1e6
OPTIMISER_PREFIX = "optimiser."
"""Names of tensors that are an optimiser's state in a checkpoint begin with it: squared gradients may be large."""

RELEASED_WITHOUT_FLAG = frozenset(
    {
        "7a33ec6e671e3dadc5674290bd907c2b1f673b447b596d259f6e4a573d78a952",  # detector_compact.safetensors
        "57b423190f7fc8e29ab5059c73dc1b51bbda2729c9fdeb2b9e6c64c98f4a2411",  # detector_compact_two_stage.safetensors
        "a6ba4418f0151d67105247f8ce918f88c55e8b1c055bb6c4bc370de2dff20bfe",  # mtf_cnn.safetensors
        "61b07e8d50a37d05a676f9027d6c32c7300e9191cfa9e461eb848b172ba3e2d8",  # mtf_spectral.safetensors
        "60d8d773d134b1246571395745532e3ae8d9301ff8390b118ef51fd2338fc057",  # sigma_cellwise.safetensors
        "30555c437e6bdd9149ad5a1f78a0654d4c4c7b193f4a0b729c4343d257082f7c",  # sigma_cnn.safetensors
        "f79dfecdbfb2d3d8ad2af9c19fa6f653ca50c772c1095cd59840d7b984245ff4",  # sigma_correlated.safetensors
    }
)
"""SHA-256 of released files that were written before headers said whether a file is released."""

RENAMED_SETTINGS = {
    "hold": "constant_lr_fraction",
    "final_share": "final_lr_ratio",
    "average_decay": "ema_decay",
    "clip": "max_grad_norm",
    "fresh": "new_chunks_per_step",
    "uses": "replays",
    "window": "replay_window",
    "before_share": "pre_blur_noise_fraction",
    "clean_share": "clean_fraction",
    "low_share": "low_fraction",
    "texture_share": "texture_fraction",
    "blurred_noise_share": "blurred_noise_fraction",
    "interpolated_share": "interpolated_fraction",
    "compressed_share": "compressed_fraction",
}
"""Settings in headers of files that were written before these were renamed -> their names now."""

_announced: set[str] = set()


def save(path: str | Path, tensors: Mapping[str, torch.Tensor], architecture: str, **details: Any) -> None:
    """Write a network's weights.

    Args:
        path: ``.safetensors``.
        tensors: a state dict.
        architecture: name and version, e.g. ``"mtf-spectral-1"``; `load` compares it.
        details: anything JSON can hold: parameters, seed, fingerprint of the training, validation.

    Raises:
        InputError: values that `load` refuses; a file that is there stays.
        OSError: the system refuses to write, for example because the disk is full; a file that is there stays.
    """
    from safetensors.torch import save as encoded

    from pipeline.store import replacing

    content = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    _check_values(path, content, "not written; lower schedule.learning_rate")
    # One entry: safetensors does not keep the order of several, and files should be the same byte for byte.
    written = {"architecture": architecture, "tensors_sha256": tensors_sha256(content), **details}
    header = json.dumps(written, sort_keys=True)
    with replacing(path) as temporary:
        temporary.write_bytes(encoded(content, {"pipeline": header}))  # its own writer's errors name no file


def tensors_sha256(tensors: Mapping[str, torch.Tensor]) -> str:
    """SHA-256 of names, types, shapes and values of tensors, in the order of their names."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        tensor = tensors[name].detach().cpu().contiguous()
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}\n".encode())
        digest.update(tensor.numpy().tobytes())
    return digest.hexdigest()


def details(path: str | Path) -> dict[str, Any]:
    """The header of a weight file: ``architecture`` and whatever was saved beside it.

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
    _check_values(path, content, "restore the file")
    if "tensors_sha256" in header and header["tensors_sha256"] != tensors_sha256(content):
        raise InputError(f"{path}: the weights are not those that were written (SHA-256 differs); restore the file")
    return content, header


def _check_values(path: str | Path, tensors: Mapping[str, torch.Tensor], advice: str) -> None:
    """Refuse values that no training of this package leaves.

    Raises:
        InputError: a value is NaN, infinite, or, of a weight, larger than `LARGEST_WEIGHT`; with the advice.
    """
    for name, tensor in tensors.items():
        if not tensor.is_floating_point() or not tensor.numel():
            continue
        if not bool(tensor.isfinite().all()):
            raise InputError(f"{path}: tensor '{name}' holds values that are NaN or infinite; {advice}")
        if not name.startswith(OPTIMISER_PREFIX) and float(tensor.abs().max()) > LARGEST_WEIGHT:
            raise InputError(
                f"{path}: tensor '{name}' holds values up to {float(tensor.abs().max()):.3g}, expected at most "
                f"{LARGEST_WEIGHT:g}; {advice}"
            )


def untrained(make: Callable[[], Made]) -> Made:
    """A network as it is before weights are loaded.

    PyTorch draws its first weights, for nothing, from random numbers that are the caller's; they stay as they are. So
    does the type of new tensors that the caller has set; the network's is float32. Threads make theirs one by one.

    Args:
        make: the network's class, or a call of it.
    """
    with caller_settings_kept():
        return make()


def into(model: torch.nn.Module, path: str | Path, architecture: str) -> dict[str, Any]:
    """Load weights into a model, which must have exactly those; announces weights that are not released.

    Returns:
        the header, with ``released`` (bool) in any case.

    Raises:
        InputError: see `load`; or names or shapes do not fit the model.
    """
    tensors, header = load(path, architecture)
    try:
        model.load_state_dict(tensors)
    except RuntimeError as error:
        lines = [line.strip() for line in str(error).splitlines()[1:2]]
        raise InputError(f"{path}: does not fit the network '{architecture}' ({' '.join(lines)})") from None
    header["released"] = is_released(path, header)
    if not header["released"]:
        _announce(path, header)
    return header


def is_released(path: str | Path, header: Mapping[str, Any]) -> bool:
    """Whether weights are released ones: trained by the profile default, for use.

    Args:
        path: weight file.
        header: of it.
    """
    if "released" in header:
        return header["released"] is True
    return file_sha256(path) in RELEASED_WITHOUT_FLAG


def _announce(path: str | Path, header: Mapping[str, Any]) -> None:
    """One line on standard error, once for each file; not in a run that trained them (`pipeline.weight_files`)."""
    if weight_files.VARIABLE in os.environ or str(path) in _announced:
        return
    _announced.add(str(path))
    step = f", step {header['step']}" if "step" in header else ""
    print(f"warning: {path}: weights that are not released ({header['architecture']}{step})", file=sys.stderr)


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
        raise InputError(f"{path}: holds no architecture; expected a file written by pipeline.learning")
    if "settings" in header:
        header["settings"] = _with_current_names(header.get("settings"))
    return header, content


def _with_current_names(settings: Any) -> Any:
    """Settings of a header under the names that they have now (`RENAMED_SETTINGS`)."""
    if not isinstance(settings, Mapping):
        return settings
    return {RENAMED_SETTINGS.get(name, name): _with_current_names(value) for name, value in settings.items()}
