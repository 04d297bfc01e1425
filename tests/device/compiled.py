"""What nvcc says of the CUDA kernels: registers, spills, shared memory, and what follows for occupancy."""

from __future__ import annotations

import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2] / "room2dgs"
INCLUDES = [f"-I{ROOT / folder}" for folder in ("csrc", "splat/csrc", "losses/csrc", "stereo/csrc")]
# as csrc/cuda/CMakeLists.txt has them
FLAGS = ["-std=c++17", "-fmad=false", "-DR2_CUDA", "-DR2_ISA=isa_cuda", *INCLUDES]
LIBRARY = "sort_scan.cu"  # CUB's kernels, not ours: they are compiled by a build alone

# An H100's multiprocessor (sm_90): 32-bit registers, bytes of shared memory with 1 KiB a block its own, warps, blocks.
REGISTERS, SHARED, SHARED_OF_A_BLOCK, WARPS, BLOCKS = 65536, 228 * 1024, 1024, 64, 32


class Usage(NamedTuple):
    """One kernel's resources: of a thread but for `shared`, bytes a block."""

    registers: int
    spilled: int
    stack: int
    shared: int

    def occupancy(self, threads: int) -> float:
        """Share of an H100's warps that blocks of so many threads can fill."""
        warps = threads // 32
        by_registers = REGISTERS // (-(-self.registers // 8) * 8 * 32 * warps)
        by_shared = SHARED // (self.shared + SHARED_OF_A_BLOCK)
        return min(by_registers, by_shared, BLOCKS, WARPS // warps) * warps / WARPS


def sources() -> list[Path]:
    """Files with kernels of ours."""
    return sorted(path for path in ROOT.rglob("csrc/*.cu") if path.name != LIBRARY)


def usage(files: list[Path], folder: Path, arch: str = "sm_90") -> dict[str, Usage]:
    """Kernels by the name of their struct, template arguments and all, compiled for one architecture into a folder.

    Raises:
        AssertionError: one of them does not compile.
    """

    def compile_one(path: Path) -> str:
        command = [
            "nvcc",
            *FLAGS,
            f"-arch={arch}",
            "-Xptxas",
            "-v",
            "-cubin",
            "-o",
            folder / f"{path.stem}.cubin",
            path,
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stderr

    with ThreadPoolExecutor(2) as pool:
        text = "\n".join(pool.map(compile_one, files))
    return parse(text)


def parse(text: str) -> dict[str, Usage]:
    """The report of `ptxas -v`; several of them may follow one another."""
    found = {}
    names = re.findall(r"Compiling entry function '(\w+)'", text)
    plain = subprocess.run(["c++filt"], input="\n".join(names), capture_output=True, text=True, check=True).stdout
    for part, name in zip(text.split("Compiling entry function")[1:], plain.splitlines(), strict=True):
        shared = re.search(r"(\d+) bytes smem", part)
        (struct,) = re.findall(r"block_kernel<(.*)>\(", name)
        struct = re.sub(r"\w+::|\(anonymous namespace\)::", "", struct)
        found[struct.strip()] = Usage(
            int(re.search(r"Used (\d+) registers", part)[1]),
            int(re.search(r"(\d+) bytes spill stores", part)[1]),
            int(re.search(r"(\d+) bytes stack frame", part)[1]),
            int(shared[1]) if shared else 0,
        )
    return found
