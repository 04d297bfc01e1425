"""Builds the extension with sanitizers and runs the tests of this folder on it. Called by `make sanitize`.

    python tests/bindings/sanitize.py [address] [thread]

A finding ends the tests' process with a report. Python is preloaded with the sanitizer's library, since it was built
without; what these libraries say about Python itself is kept out by the options and suppressions below.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BLOCKS = ("test_block_frame.py", "test_block_losses.py", "test_block_stereo.py", "test_block_fusion.py")
TESTS = {
    "address": ("test_arguments.py", "test_threads.py", *BLOCKS),
    "thread": ("test_threads.py", *BLOCKS),
}
BUILDS = {"address": "address,undefined", "thread": "thread"}
LIBRARIES = {"address": ("asan", "ubsan"), "thread": ("tsan",)}
OPTIONS = {
    "address": {
        # Python frees little at its end; with malloc instead of its own arenas every object has its fences
        "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0:allocator_may_return_null=1:detect_stack_use_after_return=1",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONMALLOC": "malloc",
    },
    "thread": {"TSAN_OPTIONS": f"suppressions={HERE / 'tsan.supp'}:halt_on_error=1:second_deadlock_stack=1"},
}


def build(name: str) -> Path:
    """The extension with this sanitizer, in build/sanitize/<name>."""
    folder = ROOT / "build" / "sanitize" / name
    cmake = [sys.executable, "-m", "cmake"]
    subprocess.run(
        [
            *cmake, "-S", ROOT, "-B", folder, "-G", "Unix Makefiles", "-DCMAKE_BUILD_TYPE=RelWithDebInfo",
            f"-DROOM2DGS_SANITIZE={BUILDS[name]}", f"-DPython_EXECUTABLE={sys.executable}",
        ],
        check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    subprocess.run([*cmake, "--build", folder, "--parallel", "2"], check=True, stdout=subprocess.DEVNULL)
    (extension,) = folder.glob("_C.*.so")
    return extension


def library(name: str) -> str:
    """The sanitizer's shared library that belongs to the compiler."""
    compiler = os.environ.get("CXX", "g++")
    asked = subprocess.run([compiler, f"-print-file-name=lib{name}.so"], check=True, capture_output=True, text=True)
    return asked.stdout.strip()


def corpus() -> Path:
    """The hard scenes in a file: they are made by torch, which stays out of the tests' process."""
    path = ROOT / "build" / "sanitize" / "corpus.npz"
    code = (
        "import numpy, sys\n"
        f"sys.path.insert(0, {str(HERE)!r})\n"
        "from test_block_frame import CORPUS\n"
        "arrays = {f'{name}/{key}': x for name, scene in CORPUS.items() for key, x in scene.items()}\n"
        f"numpy.savez({str(path)!r}, **arrays)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
    return path


def run(name: str) -> int:
    """Exit code of the tests under one sanitizer."""
    extension = build(name)
    environment = {
        **os.environ,
        **OPTIONS[name],
        "LD_PRELOAD": " ".join(library(lib) for lib in LIBRARIES[name]),
        "ROOM2DGS_EXTENSION": str(extension),
        "ROOM2DGS_CORPUS": str(corpus()),
    }
    # shared fixtures would import torch, whose own threads are none of our business here
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:cacheprovider",
        f"--confcutdir={HERE}",
        *(HERE / file for file in TESTS[name]),
    ]
    print(f"== {BUILDS[name]}", flush=True)
    return subprocess.run(command, env=environment, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(max(run(name) for name in sys.argv[1:] or BUILDS))
