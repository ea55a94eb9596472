"""What is freed is used again without new pages from the system."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

from pipeline import freed_memory

ROUNDS = """
import resource
def take():
    return [b"x" * (24 << 20) for _ in range(4)]
take()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    take()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
KEEP = "import os\nfrom pipeline import freed_memory\nassert freed_memory.keep(os.environ)\n"

FRAMES = """
import resource, sys, threading
import numpy as np
from pipeline import freed_memory

def frames():
    for _ in range(20):
        [np.ones(1 << 20) for _ in range(3)]

def pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for thread in [threading.Thread(target=frames) for _ in range(2)]:
        thread.start()
        thread.join()
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

if sys.argv[1:] == ["keep"]:
    assert freed_memory.keep()
if sys.argv[1:] == ["camera"]:
    import pipeline.camera.chain
frames()
print(pages())
"""

glibc = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is not glibc")


def page_faults(program: str, *arguments: str, **variables: str) -> int:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MALLOC_")} | variables
    result = subprocess.run(
        [sys.executable, "-c", program, *arguments], env=environment, capture_output=True, text=True, check=True
    )
    return int(result.stdout)


@glibc
def test_freed_blocks_are_used_again() -> None:
    assert page_faults(KEEP + ROUNDS) < 200


@glibc
def test_arrays_of_the_next_frame_touch_no_new_pages() -> None:
    usual = page_faults(FRAMES)
    assert page_faults(FRAMES, "keep") < usual / 2
    assert page_faults(FRAMES, "camera") < usual / 2


@glibc
@pytest.mark.parametrize("caller", ["keep", "camera"])
def test_values_of_the_environment_are_left(caller: str) -> None:
    variables = {"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}
    assert page_faults(FRAMES, caller, **variables) > page_faults(FRAMES, **variables) / 2


def test_the_environment_of_this_process_stays_as_it_is() -> None:
    program = "import os\nfrom pipeline import freed_memory\nbefore = dict(os.environ)\nfreed_memory.keep()\n"
    assert page_faults(program + "print(int(dict(os.environ) != before))") == 0


@glibc
def test_so_are_those_of_programs_started_with_the_environment() -> None:
    variables: dict[str, str] = {}
    freed_memory.keep(variables)
    assert page_faults(ROUNDS, **variables) < 200


def test_a_variable_that_is_set_keeps_its_value() -> None:
    variables = {"MALLOC_TRIM_THRESHOLD_": "131072"}
    freed_memory.keep(variables)
    assert variables["MALLOC_TRIM_THRESHOLD_"] == "131072"
    assert variables["MALLOC_MMAP_THRESHOLD_"] == str(freed_memory.BLOCK_BYTES)
