"""Memory that a stage has freed."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

PROGRAM = """
from pathlib import Path
import numpy as np
from room2dgs.runs.metrics import StageTimes, timed

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20

with timed(StageTimes(), "first"):
    pass
before = resident_mb()
with timed(StageTimes(), "second"):
    blocks = [np.ones(8192) for _ in range(4000)]  # 64 KiB each
    most = resident_mb()
    stays = blocks[::100]
    del blocks
print(before, most, resident_mb(), len(stays))
"""

THREADS = """
import ctypes, re, sys, tempfile
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from room2dgs import cli

if len(sys.argv) > 1:
    cli.main(["--version"])
libc, together = ctypes.CDLL(None), Barrier(4)
libc.malloc.restype, libc.fopen.restype = ctypes.c_void_p, ctypes.c_void_p
libc.malloc_info.argtypes, libc.fclose.argtypes = [ctypes.c_int, ctypes.c_void_p], [ctypes.c_void_p]

def take(_):
    together.wait()
    return libc.malloc(10000)

with ThreadPoolExecutor(4) as pool:
    list(pool.map(take, range(4)))
with tempfile.NamedTemporaryFile() as told:
    file = libc.fopen(told.name.encode(), b"w")
    libc.malloc_info(0, file)
    libc.fclose(file)
    print(len(re.findall("<heap nr", told.read().decode())))
"""


def heaps(*arguments: str) -> int:
    ran = subprocess.run([sys.executable, "-c", THREADS, *arguments], capture_output=True, text=True, check=True)
    return int(ran.stdout.split()[-1])


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc has several")
def test_threads_of_a_command_allocate_from_one_heap():
    assert heaps() > 1
    assert heaps("command") == 1


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc keeps it")
def test_what_a_stage_frees_between_what_stays_is_given_back():
    """Blocks too small to be mapped on their own, and every hundredth of them stays in use: the heap cannot shrink.

    In a process of its own: in one that has run other tests they would lie in holes that those have left.
    """
    ran = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    before, most, after, stays = map(float, ran.stdout.split())
    assert most - before > 200
    assert after - before < 0.3 * (most - before)
    assert stays == 40
