"""The state of CUDA here: driver, compiler, the package's kernels, torch, and what is missing."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from room2dgs.cuda_extension import BUILD, cuda_extension


class Part(NamedTuple):
    """One of the four that a run on a GPU needs, or of the compiler, which a build needs.

    Attributes:
        there: it works.
        text: what was found, or why it is not there.
    """

    there: bool
    text: str


def driver() -> Part:
    """NVIDIA's driver, asked by itself: torch may be a build for CPUs."""
    try:
        library = ctypes.CDLL("libcuda.so.1")
    except OSError:
        return Part(False, "none (no libcuda.so.1: no NVIDIA driver is installed, or a container does not pass it on)")
    error = library.cuInit(0)
    if error:
        return Part(False, f"libcuda.so.1 is there, but finds no GPU (cuInit gives {error})")
    version, count = ctypes.c_int(), ctypes.c_int()
    library.cuDriverGetVersion(ctypes.byref(version))
    library.cuDeviceGetCount(ctypes.byref(count))
    if not count.value:
        return Part(False, "a driver without a GPU (or CUDA_VISIBLE_DEVICES hides it)")
    names = []
    for k in range(count.value):
        device, name = ctypes.c_int(), ctypes.create_string_buffer(128)
        library.cuDeviceGet(ctypes.byref(device), k)
        library.cuDeviceGetName(name, len(name), device)
        capability = [ctypes.c_int(), ctypes.c_int()]
        for value, attribute in zip(capability, (75, 76), strict=True):  # compute capability, major and minor
            library.cuDeviceGetAttribute(ctypes.byref(value), attribute, device)
        names.append(f"{name.value.decode(errors='replace')} (sm_{capability[0].value}{capability[1].value})")
    return Part(True, f"for CUDA {version.value // 1000}.{version.value % 1000 // 10}: {', '.join(names)}")


def compiler_path() -> str | None:
    """nvcc on the PATH, or where CUDA puts it."""
    homes = [Path(home) / "bin" for name in ("CUDA_HOME", "CUDA_PATH") if (home := os.environ.get(name))]
    places = [os.environ.get("PATH", ""), *map(str, homes), "/usr/local/cuda/bin"]
    return shutil.which("nvcc", path=os.pathsep.join(places))


def compiler() -> Part:
    """nvcc; only a build needs it."""
    path = compiler_path()
    if path is None:
        return Part(False, "none (no nvcc on the PATH or in CUDA_HOME; only a build needs it)")
    text = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=20, check=True).stdout
    release = next((line for line in text.splitlines() if "release" in line), "")
    return Part(True, f"{release.partition('release')[2].partition(',')[0].strip() or 'of unknown version'}, {path}")


def kernels() -> Part:
    """The extension `_cuda`."""
    found = cuda_extension()
    if not found.built:
        return Part(False, f"not built ({BUILD})")
    if found.module is None:
        return Part(False, f"built, but cannot be loaded ({found.reason})")
    return Part(True, "built")


def in_torch() -> Part:
    """torch's own CUDA."""
    import torch

    if torch.version.cuda is None:
        return Part(False, f"none (torch {torch.__version__} is a build for CPUs; pytorch.org says how to get another)")
    if not torch.cuda.is_available():
        return Part(False, f"built for CUDA {torch.version.cuda}, which finds no GPU here")
    return Part(True, f"{torch.version.cuda}, {torch.cuda.get_device_name(0)}")


def missing() -> list[str]:
    """What a run on a GPU lacks, by name; empty if it can run."""
    parts = {
        "an NVIDIA driver with a GPU": driver,
        "the extension's CUDA kernels": kernels,
        "torch with CUDA": in_torch,
    }
    return [name for name, find in parts.items() if not find().there]
