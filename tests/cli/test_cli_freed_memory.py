"""Freed memory stays with the process: arrays of the next frame touch no new pages."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SCRIPT = """
import resource, sys, threading
import numpy as np
from pipeline.cli.freed_memory import keep_freed_memory

def frames():
    for _ in range(20):
        [np.ones(1 << 20) for _ in range(3)]

def pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for thread in [threading.Thread(target=frames) for _ in range(2)]:
        thread.start()
        thread.join()
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

kept = sys.argv[1] == "keep" and keep_freed_memory()
frames()
print(int(kept), pages())
"""


def measured(option: str) -> tuple[bool, int]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, option], capture_output=True, text=True, check=True, env=environment
    )
    kept, pages = done.stdout.split()
    return kept == "1", int(pages)


def test_arrays_of_the_next_frame_touch_no_new_pages():
    kept, pages = measured("keep")
    if not kept:
        pytest.skip("the C library is not glibc")
    assert pages < measured("leave")[1] / 2
