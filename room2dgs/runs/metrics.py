"""What a run's metrics.json says beside the scores: seconds, memory, versions, machine."""

from __future__ import annotations

import math
import os
import platform
import resource
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from room2dgs import __version__
from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.commit import commit
from room2dgs.cores import available_cores
from room2dgs.freed_memory import give_back
from room2dgs.json_files import read_json, update_json
from room2dgs.runs.folder import METRICS
from room2dgs.runs.schema import checked

PACKAGES = (
    "torch",
    "numpy",
    "pycolmap",
    "open3d",
    "opencv-contrib-python-headless",
    "kornia",
    "trimesh",
    "scipy",
    "hydra-core",
)
# What a mesh's scores in metrics.json begin with
MESH_SCORES = (
    "accuracy_m",
    "align",
    "chamfer_m",
    "completion_m",
    "depth_scores",
    "depth_to_truth_m",
    "eval_seconds",
    "f_score_",
    "mesh_quality",
    "normal_consistency",
    "precision_",
    "protocol",
    "recall_",
    "threshold_m",
    "truth_from_same_depth",
    "where_the_error_sits",
)


# and those of its held-out views
IMAGE_SCORES = ("psnr_db", "psnr_fitted_db", "ssim", "test_views")


class StageTimes(dict[str, float]):
    """Seconds by stage, as `timed` fills them in, and the memory.

    Attributes:
        peak_memory_mb: by stage, the largest resident memory of the process up to its end.
        cpu: by stage, seconds of all cores together: on a machine with other work they say more.
        begun: is told each stage as it begins.
    """

    def __init__(self, begun: Callable[[str], None] = lambda stage: None) -> None:
        super().__init__()
        self.begun = begun
        self.peak_memory_mb: dict[str, float] = {}
        self.cpu: dict[str, float] = {}


@contextmanager
def timed(times: StageTimes, stage: str) -> Iterator[None]:
    """Adds the block's time to a stage's, and notes its memory. What the block freed is given back to the system."""
    times.begun(stage)
    start, cpu = time.perf_counter(), time.process_time()
    yield
    give_back()
    times[stage] = times.get(stage, 0.0) + round(time.perf_counter() - start, 3)
    times.peak_memory_mb[stage] = peak_memory_mb()
    times.cpu[stage] = times.cpu.get(stage, 0.0) + round(time.process_time() - cpu, 3)


def by_stage(times: StageTimes) -> dict[str, dict[str, float]]:
    """Stage -> "wall" and "cpu" seconds (all cores together)."""
    return {stage: {"wall": wall, "cpu": times.cpu.get(stage, 0.0)} for stage, wall in times.items()}


def record(out: Path, part: dict[str, Any], times: StageTimes | None = None) -> dict[str, Any]:
    """Sets `part` in the run's metrics.json, and what every command adds to it.

    Returns:
        All that the file now holds.
    """
    times = StageTimes() if times is None else times
    before = {key: value for key, value in read_metrics(out).items() if value is not None}
    memory = max(peak_memory_mb(), before.get("peak_memory_mb", 0.0))
    common = {
        "seconds": {**before.get("seconds", {}), **times},
        "peak_memory_mb": memory,
        "stage_peak_memory_mb": {**before.get("stage_peak_memory_mb", {}), **times.peak_memory_mb},
        "cpu_seconds": {**before.get("cpu_seconds", {}), **times.cpu},
        "versions": versions(),
        "commit": commit(),
        "machine": machine(),
    }
    return update_json(out / METRICS, {**part, **common})


def read_metrics(out: Path) -> dict[str, Any]:
    """What the run's metrics.json holds so far; nothing without the file.

    Raises:
        InputError: the file is damaged, or a figure in it is of another kind than it should be.
    """
    path = out / METRICS
    return checked(read_json(path), path) if os.path.lexists(path) else {}


def origin_of_run(out: Path) -> Origin | None:
    """`Scene.origin_m` as the run noted it; None if nothing whole is noted."""
    capture = read_metrics(out).get("capture")
    noted = capture.get("origin_m", AT_ORIGIN) if isinstance(capture, dict) else None  # runs from before had none
    if not isinstance(noted, (list, tuple)) or len(noted) != 3:
        return None
    if not all(type(value) in (int, float) and math.isfinite(value) for value in noted):
        return None
    x, y, z = map(float, noted)
    return x, y, z


def cleared(out: Path, beginnings: tuple[str, ...]) -> dict[str, None]:
    """Null for each key of metrics.json that begins so, for `record`: what was measured is gone."""
    return dict.fromkeys(key for key in read_metrics(out) if key.startswith(beginnings))


def peak_memory_mb() -> float:
    """The largest resident memory of this process so far, in 10^6 bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6, 1)


def versions() -> dict[str, str]:
    """Version of the package, of Python and of the libraries that decide a result."""
    libraries = {package: _version(package) for package in PACKAGES}
    return {"room2dgs": __version__, "python": platform.python_version(), **libraries}


@cache
def _version(package: str) -> str:
    """Asked for once: a process keeps the libraries that it began with."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "missing"


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, memory."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": processor(),
        "cores": available_cores(),
        "memory_gb": round(memory, 1),
    }


def processor() -> str:
    """The processor's name as the system gives it."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
