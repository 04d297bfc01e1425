"""The CUDA kernels compile, and stay within what they may use of a multiprocessor. Needs nvcc, not a GPU."""

from __future__ import annotations

import importlib.util
import re
import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

HERE = Path(__file__).parent
spec = importlib.util.spec_from_file_location("compiled", HERE / "compiled.py")
compiled = importlib.util.module_from_spec(spec)
spec.loader.exec_module(compiled)

with_nvcc = pytest.mark.skipif(shutil.which("nvcc") is None, reason="no nvcc")


class Limit(NamedTuple):
    """At most so many registers and bytes of shared memory, with blocks of so many threads; bytes spilled."""

    threads: int
    registers: int
    shared: int
    occupancy: float  # at least so much of an H100
    spilled: int = 0


HITS = ("SurfelHits", "GaussianHits")
BLENDED = [f"{hits}, {maps}" for hits in HITS for maps in ("false, false", "true, false", "true, true")]
BLENDED_BACKWARD = [*BLENDED, *(f"{hits}, false, true" for hits in HITS)]

# The surfels' double arithmetic has many values alive at once; pixels cost far more than surfels.
LIMITS: dict[str, Limit] = {
    "ReadView<SurfelKind>": Limit(32, 80, 0, 0.3),
    "ReadView<GaussianKind>": Limit(32, 80, 0, 0.3),
    "ProjectSurfels<SurfelKind>": Limit(128, 208, 128, 0.12),
    "ProjectSurfels<GaussianKind>": Limit(128, 128, 128, 0.25),
    "CountView": Limit(256, 40, 256, 0.7),
    "SurfelsBackward<SurfelKind>": Limit(128, 168, 1024, 0.18),
    "SurfelsBackward<GaussianKind>": Limit(128, 208, 1024, 0.12),
    "CameraBackward": Limit(256, 72, 1280, 0.4),
    "Gather": Limit(256, 24, 0, 1.0),
    "ListTiles": Limit(128, 32, 0, 1.0),
    "ListTallTiles<SurfelKind>": Limit(128, 160, 0, 0.18),
    "ListTallTiles<GaussianKind>": Limit(128, 88, 0, 0.3),
    "FindTiles": Limit(128, 24, 0, 1.0),
    **{f"BlendTiles<{args}>": Limit(256, 64, 16 * 1024, 0.5) for args in BLENDED},
    **{f"BlendTilesBackward<{args}>": Limit(256, 80, 24 * 1024, 0.37) for args in BLENDED_BACKWARD},
    "BackgroundOfTiles": Limit(256, 40, 256, 0.7),
    "BackgroundBackward": Limit(256, 40, 256, 0.7),
    "SsimOfPatches": Limit(256, 56, 13000, 0.5),
    "SsimGradient": Limit(256, 40, 14000, 0.6),
    "NormalConsistency": Limit(256, 64, 5000, 0.5),
    "DepthNormals": Limit(256, 40, 1400, 0.75),
    # the windows of both photos lie in local memory, beside the first-level cache: 1 KiB a thread, of 200 bytes used
    "StartPlanes": Limit(128, 72, 0, 0.4, 8),  # about a call; it runs once a search
    "SweepPlanes": Limit(128, 128, 0, 0.25),
    "CostOfPlanes": Limit(128, 72, 0, 0.4),
    "TouchBlocks": Limit(256, 32, 0, 1.0),
    "FuseBlocks": Limit(512, 32, 0, 1.0),
    "DepthMoments": Limit(256, 56, 1200, 0.5),
    "FitDepth": Limit(256, 56, 1200, 0.5),
    "DepthGradient": Limit(256, 48, 128, 0.6),
    "NormalPrior": Limit(256, 40, 256, 0.7),
    "MeanOfNormals": Limit(256, 40, 256, 0.7),
    "ComparePixels": Limit(256, 96, 512, 0.25),
    "MeansOfPixels": Limit(256, 40, 384, 0.7),
    "TotalOfBlocks<1>": Limit(256, 40, 128, 0.7),
    "TotalOfBlocks<2>": Limit(256, 40, 200, 0.5),
    "TotalOfBlocks<10>": Limit(256, 48, 800, 0.5),
}


@with_nvcc
def test_the_primitive_is_cheap(tmp_path):
    """20 sums over a block need no memory but the numbers themselves; barriers and votes none at all."""
    found = compiled.usage([HERE / "block_check.cu"], tmp_path)
    assert set(found) == {"SumKernel", "TurnKernel", "VoteKernel"}
    assert all(use.spilled == 0 and use.stack == 0 for use in found.values()), found
    assert found["SumKernel"].registers <= 40 and found["SumKernel"].shared == 400
    assert found["VoteKernel"].shared == 0


@with_nvcc
@pytest.mark.slow
def test_every_kernel_is_within_its_limits(tmp_path):
    found = compiled.usage(compiled.sources(), tmp_path)
    assert set(found) == set(LIMITS)
    for name, limit in LIMITS.items():
        use = found[name]
        assert use.spilled <= limit.spilled, (name, use)
        assert use.registers <= limit.registers and use.shared <= limit.shared, (name, use)
        assert use.occupancy(limit.threads) >= limit.occupancy, (name, use, use.occupancy(limit.threads))


def test_the_extra_asks_for_the_package_of_this_version():
    ours = (compiled.ROOT.parent / "pyproject.toml").read_text()
    theirs = (compiled.ROOT / "csrc" / "cuda" / "pyproject.toml").read_text()
    (version,) = re.findall(r'^version = "(.+)"', ours, re.MULTILINE)
    assert f'"room2dgs-cuda=={version}"' in ours
    assert re.findall(r'^version = "(.+)"', theirs, re.MULTILINE) == [version] and f'["room2dgs=={version}"]' in theirs
