"""What a run's metrics.json says beside the scores: seconds, memory, versions, machine."""

from __future__ import annotations

import math
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from room2dgs import __version__
from room2dgs.captures.world_offset import AT_ORIGIN, Origin
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
    "depth_to_truth_m",
    "eval_seconds",
    "f_score_",
    "normal_consistency",
    "precision_",
    "protocol",
    "recall_",
    "threshold_m",
    "truth_from_same_depth",
    "where_the_error_sits",
)


class Stages(dict[str, float]):
    """Seconds by stage, as `timed` fills them in, and the memory.

    Attributes:
        peak_memory_mb: by stage, the largest resident memory of the process up to its end.
        cpu: by stage, seconds of all cores together: on a machine with other work they say more.
    """

    def __init__(self) -> None:
        super().__init__()
        self.peak_memory_mb: dict[str, float] = {}
        self.cpu: dict[str, float] = {}


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Adds the block's wall time to `seconds[stage]`; `Stages` keep its memory too. What it freed is given back."""
    start, cpu = time.perf_counter(), time.process_time()
    yield
    give_back()
    seconds[stage] = seconds.get(stage, 0.0) + round(time.perf_counter() - start, 3)
    if isinstance(seconds, Stages):
        seconds.peak_memory_mb[stage] = peak_memory_mb()
        seconds.cpu[stage] = seconds.cpu.get(stage, 0.0) + round(time.process_time() - cpu, 3)


def by_stage(seconds: Stages) -> dict[str, dict[str, float]]:
    """Stage -> "wall" and "cpu" seconds (all cores together)."""
    return {stage: {"wall": wall, "cpu": seconds.cpu.get(stage, 0.0)} for stage, wall in seconds.items()}


def record(out: Path, part: dict[str, Any], seconds: dict[str, float]) -> dict[str, Any]:
    """Sets `part` in the run's metrics.json, and what every command adds to it.

    Returns:
        All that the file now holds.
    """
    before = {key: value for key, value in earlier(out).items() if value is not None}
    memory = max(peak_memory_mb(), before.get("peak_memory_mb", 0.0))
    common = {
        "seconds": {**before.get("seconds", {}), **seconds},
        "peak_memory_mb": memory,
        "stage_peak_memory_mb": {**before.get("stage_peak_memory_mb", {}), **getattr(seconds, "peak_memory_mb", {})},
        "cpu_seconds": {**before.get("cpu_seconds", {}), **getattr(seconds, "cpu", {})},
        "versions": versions(),
        "commit": commit(),
        "machine": machine(),
    }
    return update_json(out / METRICS, {**part, **common})


def earlier(out: Path) -> dict[str, Any]:
    """What the run's metrics.json holds so far; nothing without the file.

    Raises:
        InputError: the file is damaged, or a figure in it is of another kind than it should be.
    """
    path = out / METRICS
    return checked(read_json(path), path) if os.path.lexists(path) else {}


def origin_of_run(out: Path) -> Origin | None:
    """`Scene.origin_m` as the run noted it; None if nothing whole is noted."""
    capture = earlier(out).get("capture")
    noted = capture.get("origin_m", AT_ORIGIN) if isinstance(capture, dict) else None  # runs from before had none
    if not isinstance(noted, (list, tuple)) or len(noted) != 3:
        return None
    if not all(type(value) in (int, float) and math.isfinite(value) for value in noted):
        return None
    x, y, z = map(float, noted)
    return x, y, z


def stale(out: Path, beginnings: tuple[str, ...]) -> dict[str, None]:
    """Null for what metrics.json says under keys that begin so: what it was measured on is gone."""
    return dict.fromkeys(key for key in earlier(out) if key.startswith(beginnings))


def peak_memory_mb() -> float:
    """The largest resident memory of this process so far, in 10^6 bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6, 1)


def versions() -> dict[str, str]:
    """Version of the package, of Python and of the libraries that decide a result."""
    found = {"room2dgs": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "missing"
    return found


def commit() -> str | None:
    """The checkout's commit, "+" behind it when files differ from it; None outside a checkout."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None
    try:
        head = _git(root, "rev-parse", "HEAD")
        return head + "+" if _git(root, "status", "--porcelain") else head
    except (OSError, subprocess.SubprocessError):
        return None


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


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True, timeout=10)
    return done.stdout.strip()
