"""Network files in ONNX format: open them in ONNX Runtime, at the input size that is wanted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.store import file_sha256

if TYPE_CHECKING:
    import onnxruntime

_SESSIONS_KEPT = 4  # one per input size; a dataset rarely has more


class OnnxFile:
    """An ONNX file with its sessions, one per input size, opened when first used and not copied to other processes.

    Args:
        path: the file.
        threads: CPU threads of one session.
        sha256: expected hash, or None to take any file.

    Raises:
        InputError: fewer than one thread, or the file is missing or is not the expected one.
    """

    def __init__(self, path: str | Path, threads: int = 1, sha256: str | None = None) -> None:
        self.path, self.threads = Path(path), threads
        if threads < 1:
            raise InputError(f"threads: expected at least 1, not {threads}")
        if not self.path.is_file():
            raise InputError(f"{self.path}: no such model file; give weights= the path of an ONNX file")
        if sha256 is not None:
            result = file_sha256(self.path)
            if result != sha256.lower():
                raise InputError(f"{self.path}: SHA-256 is {result}, expected {sha256}; get the file again")
        self._sessions: dict[tuple[int, int] | None, onnxruntime.InferenceSession] = {}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_sessions": {}}

    def session(self, size: tuple[int, int] | None = None) -> onnxruntime.InferenceSession:
        """The session for an input size.

        Args:
            size: (height, width), which rewrites the network's input (`resized_model`); None for the file as it is.

        Raises:
            InputError: no ONNX network.
        """
        if size in self._sessions:
            return self._sessions[size]
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = self.threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 3  # errors only: public files bring many harmless warnings
        source = str(self.path) if size is None else resized_model(self.path, size)
        try:
            session = onnxruntime.InferenceSession(source, options, providers=["CPUExecutionProvider"])
        except _runtime_errors() as error:
            raise InputError(
                f"{self.path}: not an ONNX network that ONNX Runtime can open: {_first_line(error)}"
            ) from error
        while len(self._sessions) >= _SESSIONS_KEPT:
            del self._sessions[next(iter(self._sessions))]
        self._sessions[size] = session
        return session

    def outputs(self, image: NDArray[np.float32], size: tuple[int, int] | None = None) -> list[NDArray[Any]]:
        """All outputs for one image.

        Args:
            image: (..., H, W), of the rank that the network takes.
            size: see `session`.

        Raises:
            InputError: the network cannot run at this size.
        """
        session = self.session(size)
        try:
            result: list[NDArray[Any]] = session.run(None, {session.get_inputs()[0].name: image})
        except _runtime_errors() as error:
            height, width = image.shape[-2:]
            raise InputError(f"{self.path}: cannot run at {width} x {height} px: {_first_line(error)}") from error
        return result


class OnnxModel(OnnxFile):
    """A network with one image input of (1, C, H, W).

    Args:
        path: the file.
        threads: CPU threads of one session.
        sha256: expected hash, or None to take any file.

    Raises:
        InputError: the file is missing, is not the expected one, or is no ONNX network with an image input.
    """

    def __init__(self, path: str | Path, threads: int = 1, sha256: str | None = None) -> None:
        super().__init__(path, threads, sha256)
        shape = self.session().get_inputs()[0].shape
        if len(shape) != 4:
            raise InputError(f"{self.path}: its input has shape {shape}, expected (1, channels, height, width)")
        self.own_size = (shape[2], shape[3]) if isinstance(shape[2], int) and isinstance(shape[3], int) else None
        """(height, width) that the file asks for, or None if any will do."""

    def run(self, image: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """All outputs for one image.

        Args:
            image: (1, C, H, W); a size other than the file's own rewrites the network's input, which needs `onnx`.

        Raises:
            InputError: the network cannot run at this size.
        """
        size = (int(image.shape[2]), int(image.shape[3]))
        return self.outputs(image, None if self.own_size in (None, size) else size)


def resized_model(path: Path, size: tuple[int, int]) -> bytes:
    """The network with another input size.

    Sizes of outputs and intermediate results that the file declares are removed, for they follow from the input. This
    works for fully convolutional networks that do not bake their input size into a constant.

    Args:
        path: an ONNX file that ONNX Runtime can open.
        size: height and width, pixels.

    Returns:
        the serialised network.

    Raises:
        InputError: the package `onnx` is not installed.
    """
    try:
        import onnx
    except ImportError as error:
        raise InputError(
            f"{path}: its input size is fixed; changing it needs the package 'onnx' (pip install onnx), or leave"
            " input_px unset to use the file's own size"
        ) from error
    model = onnx.load(str(path))
    constants = {tensor.name for tensor in model.graph.initializer}
    image = next(entry for entry in model.graph.input if entry.name not in constants)
    for dimension, length in zip(image.type.tensor_type.shape.dim[2:4], size, strict=True):
        dimension.dim_value = length
    for output in model.graph.output:
        output.type.tensor_type.ClearField("shape")
    del model.graph.value_info[:]
    serialised: bytes = model.SerializeToString()
    return serialised


def _runtime_errors() -> tuple[type[Exception], ...]:
    """What ONNX Runtime raises for a bad file or a bad shape; its exceptions have no common base of their own."""
    from onnxruntime.capi import onnxruntime_pybind11_state as state

    names = ("Fail", "InvalidArgument", "InvalidGraph", "InvalidProtobuf", "NoSuchFile", "NotImplemented")
    return (*(getattr(state, name) for name in names), state.RuntimeException)


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]
