"""The primitive of block code (csrc/block.h) as plain C++: barriers, sums, votes, scrambled orders."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
CSRC = HERE.parents[1] / "room2dgs" / "csrc"


def test_block_code_keeps_its_promises(tmp_path):
    compiler = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
    assert compiler, "the extension was built by a C++ compiler that is not on the path any more"
    program = tmp_path / "block_check"
    files = [HERE / "block_check.cu", CSRC / "sort_scan.cu", CSRC / "parallel.cpp"]
    command = [compiler, "-std=c++17", "-O1", "-pthread", "-fsanitize=address,undefined", "-DR2_ISA=isa_blocks"]
    subprocess.run([*command, "-I", CSRC, "-x", "c++", *files, "-o", program], check=True)
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
