"""Pins numerical libraries to one instruction set and one BLAS thread: the same bytes on any x86-64 processor.

NumPy, SciPy, OpenCV and torch choose their kernels by the processor they run on; another order of additions changes the
last digits of a sum, and iterative estimators amplify them. `pin` limits them to AVX2 with FMA (Haswell, 2013; Zen),
by environment variables that the libraries read when they are loaded::

    torch   ATEN_CPU_CAPABILITY, ONEDNN_MAX_CPU_ISA, MKL_CBWR (one code path for Intel and AMD), MKL_NUM_THREADS
    NumPy   NPY_DISABLE_CPU_FEATURES (its AVX-512 kernels)
    NumPy, SciPy    OPENBLAS_CORETYPE, OPENBLAS_NUM_THREADS
    OpenCV  OPENCV_CPU_DISABLE (its AVX-512 kernels), OPENCV_IPP

OpenBLAS and MKL split one sum over as many threads as there are cores, so that products of matrices end in other
digits on another number of cores; beside other work OpenBLAS's waiting threads also make small products several times
slower. Both get one thread. Convolutions and sums of torch, and OpenCV, are the same for any number of threads.

SciPy's own code (its FFT among it) has no kernels to choose from. Importing `pipeline` calls `pin`, so that stages,
their worker processes, tests and the command line are pinned; nothing is pinned where NumPy, SciPy, OpenCV or torch
were imported first, where the processor has no AVX2 or is not an x86-64, and where the environment variable
``CAMERA_MONITOR_PINS`` is ``off``. A variable that is set already keeps its value.

What Numba compiles (`pipeline.scenes.ray_tree`) needs no pin: without fast math it rounds every operation. Not covered:
ONNX Runtime, which offers no choice (published detectors); trainings in bfloat16, which lift torch's pins; and torch's
square root, inverse trigonometry and logarithm of float64 on whole tensors, which come from MKL's vector library: it
differs between processors in the last digit whatever ``MKL_CBWR`` is. Networks therefore take square roots from NumPy
(`pipeline.learning.elementwise`), and optimisers their fused form, which has a square root of its own, so that a
training in single precision gives the same weights on any processor.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Collection, Iterator, MutableMapping, Sequence
from contextlib import contextmanager
from pathlib import Path

SWITCH = "CAMERA_MONITOR_PINS"
"""Environment variable: ``off`` pins nothing, ``no-torch`` all libraries but torch."""

LIBRARIES = ("numpy", "scipy", "cv2", "torch")
TORCH_PINS = {
    "ATEN_CPU_CAPABILITY": "avx2", "ONEDNN_MAX_CPU_ISA": "AVX2", "MKL_CBWR": "COMPATIBLE", "MKL_NUM_THREADS": "1"
}  # fmt: skip
PINS = {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1", "OPENCV_IPP": "avx2"}
AVX512_PINS = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL,AVX512_SPR",  # the groups that NumPy 2.4 has kernels for
    "OPENCV_CPU_DISABLE": "AVX512-SKX",
}
"""Only where the processor has AVX-512: OpenCV writes a line for each feature that is not there."""

PINNED = "pinned"
_status = "pipeline was not imported"


def cpu_features() -> frozenset[str]:
    """Features of the processor as Linux names them (``avx2``, ``fma``, ``avx512f``); empty where they are unknown."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return frozenset()
    try:
        with Path("/proc/cpuinfo").open(encoding="ascii", errors="replace") as lines:
            flags = next((line for line in lines if line.startswith("flags")), "")
    except OSError:
        return frozenset()
    return frozenset(flags.partition(":")[2].split())


def pins(features: Collection[str], *, torch: bool = True) -> dict[str, str]:
    """Environment variables that pin the libraries on a processor.

    Args:
        features: of the processor, see `cpu_features`.
        torch: whether torch is pinned as well.

    Returns:
        values by name; none where the processor lacks AVX2 or FMA.
    """
    if not {"avx2", "fma"} <= set(features):
        return {}
    chosen = PINS | (TORCH_PINS if torch else {})
    return chosen | AVX512_PINS if "avx512f" in features else chosen


def pin() -> str:
    """Pin the libraries of this process and of those it starts.

    Returns:
        ``"pinned"``, or why nothing was pinned; see `status`.
    """
    global _status
    _status = _pin(os.environ, cpu_features(), [name for name in LIBRARIES if name in sys.modules])
    return _status


def _pin(environment: MutableMapping[str, str], features: Collection[str], loaded: Sequence[str]) -> str:
    """`pin` for an environment, a processor and the libraries that are loaded already."""
    switch = environment.get(SWITCH, "")
    if switch == "off":
        return f"not pinned: {SWITCH} is off"
    chosen = pins(features, torch=switch != "no-torch")
    if not chosen:
        return "not pinned: the processor is not known to have AVX2"
    if loaded and not all(environment.get(name) == value for name, value in chosen.items()):
        return f"not pinned: {', '.join(loaded)} imported before pipeline"
    for name, value in chosen.items():
        environment.setdefault(name, value)
    changed = [f"{name}={environment[name]}" for name, value in chosen.items() if environment[name] != value]
    if changed:
        return f"pinned otherwise: {', '.join(changed)} in the environment"
    return PINNED if switch != "no-torch" else f"{PINNED} but for torch"


def status() -> str:
    """How this process is pinned: ``"pinned"``, ``"pinned but for torch"``, or why it is not."""
    return _status


def is_like(other: str) -> bool:
    """Whether a process of another `status` computes the same last digits as this one, as far as pins go."""
    return other.partition(":")[0] == _status.partition(":")[0]


@contextmanager
def for_children() -> Iterator[None]:
    """Processes started within are pinned only if this one is, though they would load the libraries afresh."""
    if not _status.startswith("not pinned") or SWITCH in os.environ:
        yield
        return
    os.environ[SWITCH] = "off"
    try:
        yield
    finally:
        del os.environ[SWITCH]


def release_torch() -> bool:
    """Lift the pins of torch for this process and those it starts, before torch is imported.

    Training in bfloat16 needs it: AVX2 has no such arithmetic, and emulating it takes 15 times as long
    (``benchmarks/pins.py``). What depends on the result's last digits must come from its released weights.

    Returns:
        whether the pins are lifted; False where nothing was pinned or torch is imported already.
    """
    global _status
    if _status != PINNED or "torch" in sys.modules:
        return False
    for name in TORCH_PINS:
        os.environ.pop(name, None)
    os.environ[SWITCH] = "no-torch"
    _status = f"{PINNED} but for torch"
    return True
