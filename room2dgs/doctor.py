"""A report of what is installed, what the machine has, and which device does what."""

from __future__ import annotations

import importlib
import os
import platform
from collections.abc import Callable

from room2dgs import __version__, cuda_state
from room2dgs.cores import available_cores
from room2dgs.errors import first_line
from room2dgs.system_libraries import package_of

# module -> (distribution, what it is here for); every one is needed
MODULES = {
    "numpy": ("numpy", "arrays"),
    "torch": ("torch", "autograd and the optimiser"),
    "cv2": ("opencv-contrib-python-headless", "images"),
    "pycolmap": ("pycolmap", "sparse points"),
    "open3d": ("open3d", "depth fusion, ray casting"),
    "trimesh": ("trimesh", "mesh files"),
    "fast_simplification": ("fast-simplification", "meshes with fewer faces"),
    "scipy": ("scipy", "nearest neighbours"),
    "kornia": ("kornia", "image scores"),
    "onnxruntime": ("onnxruntime", "depth and normal priors"),
    "hydra": ("hydra-core", "configuration"),
    "safetensors": ("safetensors", "checkpoints"),
    "rich": ("rich", "progress and tables"),
    "tensorboard": ("tensorboard", "training curves"),
    "matplotlib": ("matplotlib", "pictures of the error"),
}


def examine() -> tuple[list[str], bool]:
    """Look at everything that a run needs.

    Returns:
        Lines to print, and whether a run will work.
    """
    system = f"{platform.system()} {platform.machine()}"
    lines = [f"room2dgs {__version__}, Python {platform.python_version()}, {system}", ""]
    problems: list[str] = []
    for name, (distribution, purpose) in MODULES.items():
        found, problem = _library(name, distribution)
        lines.append(f"  {distribution:<32} {found:<14} {purpose}")
        problems += [problem] if problem else []
    kernels, problem = _kernels()
    problems += [problem] if problem else []
    lines += ["", f"  {'cores':<32} {available_cores()} for this process, {os.cpu_count()} in the machine"]
    lines += [f"  {'kernels':<32} {kernels}"]
    lines += [f"  {name:<32} {text}" for name, text in _cuda().items()]
    lines += [""]
    if problems:
        lines += ["This will not run yet:", *(f"  - {problem}" for problem in problems)]
    else:
        lines.append("Points, training, mesh and scores will run on the CPU. Nothing is missing.")
    return lines, not problems


def _library(name: str, distribution: str) -> tuple[str, str | None]:
    """Its version, and a sentence if it cannot be used."""
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        return "missing", f"{error.name or name} is not installed; pip install {distribution}"
    except Exception as error:  # a broken library may raise anything when imported
        package = package_of(error)
        fix = (
            f"on Debian or Ubuntu: apt-get install {package}"
            if package
            else f"reinstall it: pip install {distribution}"
        )
        return "broken", f"{distribution} cannot be loaded ({first_line(error)}); {fix}"
    return _version(module, distribution), None


def _version(module: object, distribution: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(distribution)
    except PackageNotFoundError:  # under another name, e.g. opencv with a screen
        return str(getattr(module, "__version__", "unknown"))


def _kernels() -> tuple[str, str | None]:
    try:
        from room2dgs import _C
    except ImportError as error:
        return (
            "missing",
            f"the compiled kernels cannot be loaded ({first_line(error)}); build them: pip install .",
        )
    return f"{_C.isa()} instructions", None


def _cuda() -> dict[str, str]:
    """What there is of CUDA; nothing needs it."""
    return {
        "CUDA driver": _tried(lambda: cuda_state.driver().text),
        "CUDA compiler": _tried(lambda: cuda_state.compiler().text),
        "CUDA kernels": _tried(lambda: cuda_state.kernels().text),
        "CUDA in torch": _tried(lambda: cuda_state.in_torch().text),
        "rendering on a GPU": _tried(_on_gpu),
        "networks in onnxruntime run on": _tried(_onnx_providers),
    }


def _on_gpu() -> str:
    lacking = cuda_state.missing()
    return f"no, it lacks {', '.join(lacking)}" if lacking else "can be tried: make gpu-check"


def _onnx_providers() -> str:
    import onnxruntime

    there = onnxruntime.get_available_providers()
    return "cpu, cuda (prior.provider=auto takes it)" if "CUDAExecutionProvider" in there else "cpu"


def _tried(question: Callable[[], str]) -> str:
    try:
        return question()
    except Exception as error:  # whatever a driver does, the rest of the report matters more
        return f"unknown ({first_line(error)})"
