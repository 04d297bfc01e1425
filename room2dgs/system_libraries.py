"""The system's own libraries and tools that wheels take for granted, and Debian's names for them.

    python -m room2dgs.system_libraries

Standard library alone: the Makefile runs this file, with --install, before anything is installed.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

# shared object -> Debian and Ubuntu package; open3d links all of them, torch the last
LIBRARIES = {
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libX11.so.6": "libx11-6",
    "libudev.so.1": "libudev1",
    "libidn2.so.0": "libidn2-0",
    "libgomp.so.1": "libgomp1",
}


def missing_libraries() -> list[str]:
    """Debian packages of the shared objects that this machine cannot load."""
    return [package for name, package in LIBRARIES.items() if not _loads(name)]


def missing_build_tools() -> list[str]:
    """Debian packages of what building from a checkout lacks: a C++ compiler, Python's headers, venv."""
    packages = []
    compiler = os.environ.get("CXX", "c++").split()[0]
    if not (shutil.which(compiler) or shutil.which("g++") or shutil.which("clang++")):
        packages.append("g++")
    if not (Path(sysconfig.get_paths()["include"]) / "Python.h").is_file():
        packages.append("python3-dev")
    if importlib.util.find_spec("ensurepip") is None:
        packages.append("python3-venv")
    return packages


def package_of(error: BaseException) -> str | None:
    """The Debian package that an ImportError about a shared object asks for, if it is a known one."""
    return next((package for name, package in LIBRARIES.items() if name in str(error)), None)


def main(arguments: list[str]) -> int:
    """Say how to install what is missing; with --install, as root and where apt-get is, install it.

    Returns:
        0 when nothing is missing in the end, else 1.
    """
    if sys.version_info < (3, 10):  # noqa: UP036 - whatever Python the Makefile met
        print(f"Python 3.10 or newer is needed, {sys.executable} is {sys.version.split()[0]}", file=sys.stderr)
        return 1
    missing = missing_build_tools() + (missing_libraries() if sys.platform == "linux" else [])
    if not missing:
        return 0
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    if "--install" in arguments and root and shutil.which("apt-get"):
        return _install(missing)
    sudo = "" if root else "sudo "
    print(
        f"Some system packages are missing; on Debian or Ubuntu: {sudo}apt-get install {' '.join(missing)}",
        file=sys.stderr,
    )
    return 1


def _install(packages: list[str]) -> int:
    print(f"installing system packages: {' '.join(packages)}", flush=True)
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for arguments in (["update", "-qq"], ["install", "-y", "-qq", "--no-install-recommends", *packages]):
        code = subprocess.call(["apt-get", *arguments], env=environment, stdout=subprocess.DEVNULL)
        if code:
            print(f"apt-get {arguments[0]} failed ({code}); install by hand: {' '.join(packages)}", file=sys.stderr)
            return 1
    return 0


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
