"""Pins of the numerical libraries: set before they load, for children too, and nowhere that they cannot hold."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline import executor, processor
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
HASWELL, SKYLAKE = {"avx2", "fma"}, {"avx2", "fma", "avx512f"}
VARIABLES = (*processor.PINS, *processor.TORCH_PINS, *processor.AVX512_PINS)
needs_avx2 = pytest.mark.skipif(not processor.pins(processor.cpu_features()), reason="the processor has no AVX2")


def fresh(code, **variables):
    """Runs code in a new process with no pins and no number of threads set; its last line of output, as JSON."""
    left_out = (*VARIABLES, *executor._THREAD_VARIABLES, processor.SWITCH)
    environment = {name: value for name, value in os.environ.items() if name not in left_out}
    command = [sys.executable, "-c", "import json, os\n" + code]
    ran = subprocess.run(command, env=environment | variables, cwd=ROOT, capture_output=True, text=True, check=True)
    return json.loads(ran.stdout.splitlines()[-1])


def test_pins_suit_the_processor():
    assert processor.pins(set()) == {}
    assert processor.pins({"avx2"}) == {}
    assert processor.pins(HASWELL) == processor.PINS | processor.TORCH_PINS
    assert processor.pins(SKYLAKE) == processor.PINS | processor.TORCH_PINS | processor.AVX512_PINS
    assert processor.pins(HASWELL, torch=False) == processor.PINS


@pytest.mark.parametrize("machine", ["aarch64", "arm64", "riscv64"])
def test_other_architectures_are_left_alone(monkeypatch, machine):
    monkeypatch.setattr(platform, "machine", lambda: machine)
    assert processor.cpu_features() == frozenset()
    environment = {}
    assert "not known to have AVX2" in processor._pin(environment, processor.cpu_features(), [])
    assert environment == {}


def test_switch_pins_nothing_or_all_but_torch():
    environment = {processor.SWITCH: "off"}
    assert "is off" in processor._pin(environment, SKYLAKE, [])
    assert environment == {processor.SWITCH: "off"}
    environment = {processor.SWITCH: "no-torch"}
    assert processor._pin(environment, SKYLAKE, []) == "pinned but for torch"
    assert environment == {processor.SWITCH: "no-torch"} | processor.PINS | processor.AVX512_PINS


def test_libraries_loaded_before_are_not_half_pinned():
    environment = {}
    assert processor._pin(environment, HASWELL, ["numpy"]) == "not pinned: numpy imported before pipeline"
    assert environment == {}
    inherited = processor.pins(HASWELL)  # a child of a pinned process
    assert processor._pin(inherited, HASWELL, ["numpy"]) == processor.PINNED


def test_values_of_the_user_stay():
    environment = {"MKL_CBWR": "AVX2"}
    assert processor._pin(environment, HASWELL, []) == "pinned otherwise: MKL_CBWR=AVX2 in the environment"
    assert environment == processor.pins(HASWELL) | {"MKL_CBWR": "AVX2"}


@needs_avx2
def test_libraries_are_pinned_by_importing_the_package():
    loaded = fresh(
        "from pipeline import processor\nimport cv2, numpy._core._multiarray_umath as core, torch\n"
        "print(json.dumps([processor.status(), torch.backends.cpu.get_cpu_capability(), cv2.ipp.getIppVersion(),"
        " core.__cpu_features__['X86_V4']]))"
    )
    assert loaded[:2] == [processor.PINNED, "AVX2"]
    assert "AVX2" in loaded[2] or "IPP" not in loaded[2]
    assert loaded[3] is False


@needs_avx2
def test_children_are_pinned():
    code = (
        "from pipeline import processor\nfrom pipeline.executor import run_map\nfrom pipeline.streams import stream\n"
        "print(json.dumps(run_map(os.getenv, ['ATEN_CPU_CAPABILITY', 'OPENBLAS_CORETYPE'], workers=2)))"
    )
    assert fresh(code) == ["avx2", "Haswell"]
    assert fresh(code, **{processor.SWITCH: "off"}) == [None, None]
    assert fresh("import numpy\n" + code) == [None, None]


@needs_avx2
@pytest.mark.full("two processes with large products take 10 s")
def test_products_of_matrices_are_the_same_bytes_for_any_number_of_threads():
    """As on machines of other numbers of cores: sums that OpenBLAS splits over threads end in other digits."""
    code = (
        "from pipeline import processor\nimport hashlib, numpy as np, torch\n"
        "a = np.sin(np.arange(630000.0) ** 1.5).reshape(700, 900)\n"
        "made = [a @ a.T, a @ a[0], np.linalg.svd(a[:300])[1], np.linalg.lstsq(a.T, a[0], rcond=None)[0]]\n"
        "few = torch.from_numpy(a.astype(np.float32))\n"
        "made += [(few @ few.T).numpy(), few.sum(0).numpy(), torch.fft.rfft2(few).abs().numpy()]\n"
        "patch = few[:640, :640].reshape(1, 1, 640, 640)\n"
        "made += [torch.nn.functional.conv2d(patch, patch[:, :, :9, :9].reshape(9, 1, 3, 3)).numpy()]\n"
        "print(json.dumps([hashlib.sha256(one.tobytes()).hexdigest() for one in made]))"
    )
    assert fresh(code, OMP_NUM_THREADS="1") == fresh(code, OMP_NUM_THREADS="3")


@needs_avx2
def test_torch_is_released_only_before_it_is_loaded():
    code = "print(json.dumps([processor.release_torch(), processor.status(), os.environ.get('ATEN_CPU_CAPABILITY')]))"
    assert fresh("from pipeline import processor\n" + code) == [True, "pinned but for torch", None]
    assert fresh("from pipeline import processor\nimport torch\n" + code) == [False, processor.PINNED, "avx2"]
    released = fresh("from pipeline import processor\n" + code, **{processor.SWITCH: "off"})
    assert released == [False, f"not pinned: {processor.SWITCH} is off", None]


@needs_avx2
def test_tests_are_pinned():
    assert processor.status().startswith(processor.PINNED) or processor.SWITCH in os.environ


def test_workers_pinned_in_another_way_are_refused():
    executor._check_pins({"tcp://a": processor.status()}, "tcp://s")
    with pytest.raises(InputError, match=r"tcp://b .*'python -m pipeline\.dask_worker tcp://s'"):
        executor._check_pins({"tcp://a": processor.status(), "tcp://b": "not pinned: numpy"}, "tcp://s")
    with pytest.raises(InputError, match="other last digits"):  # one that joins after that
        executor._call_there(abs, 1, None, "not pinned: numpy", "tcp://s")


def test_stage_notes_that_it_is_not_pinned(tmp_path):
    code = "from pipeline.stages.sensor import run\nrun(['--params'])\nprint(json.dumps(0))"
    environment = {k: v for k, v in os.environ.items() if k not in VARIABLES} | {processor.SWITCH: "off"}
    command = [sys.executable, "-c", "import json\n" + code]
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    environment["PYTHONPATH"] = str(ROOT)
    ran = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert f"note: not pinned: {processor.SWITCH} is off" in ran.stderr
