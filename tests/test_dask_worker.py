"""A worker of Dask started by this package is pinned, though Dask loads NumPy before anything that it preloads."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline import processor

ROOT = Path(__file__).resolve().parents[1]
FEATURES = {"avx2", "fma", "avx512f"}
PRELOADED = """
import os, sys
from pipeline import processor
assert "numpy" in sys.modules
print("status:", processor.status(), flush=True)
os._exit(0)
"""


@pytest.mark.skipif(not processor.pins(processor.cpu_features()), reason="the processor has no AVX2")
def test_a_worker_is_pinned(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the dask extra is not installed")
    (tmp_path / "preloaded.py").write_text(PRELOADED)
    pins = {*processor.pins(FEATURES), processor.SWITCH}
    environment = {name: value for name, value in os.environ.items() if name not in pins}
    environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), str(tmp_path)])
    words = ["pipeline.dask_worker", "tcp://127.0.0.1:9", "--preload-nanny", "preloaded", "--no-dashboard"]
    command = [sys.executable, "-m", *words, "--local-directory", str(tmp_path)]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert f"status: {processor.PINNED}\n" in done.stdout, done.stderr


def test_without_dask_it_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "distributed.py").write_text("raise ImportError\n")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    command = [sys.executable, "-m", "pipeline.dask_worker", "tcp://127.0.0.1:9"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == "error: the package 'distributed' is not installed: pip install '.[dask]'\n"
