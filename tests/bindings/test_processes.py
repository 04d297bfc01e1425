"""The kernels in processes of their own: few threads to be had, forks, another default dtype."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

HERE = Path(__file__).resolve().parent
CSRC = HERE.parents[1] / "room2dgs" / "csrc"


def python(program: str, *arguments: str | Path) -> str:
    """What a program prints in a fresh interpreter."""
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)], check=False, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, f"exit code {done.returncode}\n{done.stderr}"
    return done.stdout


LOSS = """
import sys, numpy as np
from room2dgs import _C
random = np.random.default_rng(0)
rendered, target = random.random((2, 400, 300, 3), np.float32)

def loss():
    gradient = np.full_like(rendered, np.nan)
    return _C.rgb_loss(rendered, target, 0.2, gradient), gradient.tobytes()
"""


def test_threads_that_the_system_refuses_are_not_counted():
    """Scratch was sized for the threads that were asked for before, or for fewer than there were."""
    program = (
        LOSS
        + """
import resource
_C.set_threads(1)
wanted = loss()
size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (size + (90 << 20), resource.RLIM_INFINITY))
started = _C.set_threads(64)
assert _C.threads() == started
assert 1 < started < 64, started
try:
    assert loss() == wanted
except MemoryError:  # the stacks took it all
    pass
assert _C.set_threads(2) == 2
assert loss() == wanted
resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
assert _C.set_threads(64) == 64
assert loss() == wanted
print("same")
"""
    )
    assert python(program) == "same\n"


def test_memory_that_the_system_refuses_is_an_exception():
    program = """
import numpy as np, resource
from room2dgs import _C
n, side = 40000, 1600
random = np.random.default_rng(0)
surfels = [random.random(s, np.float32) for s in [(n, 3), (n, 4), (n, 2), (n,), (n, 1, 3)]]
surfels[0][:, 2] += 2
K = np.array([[1500.0, 0, 800], [0, 1500, 800], [0, 0, 1]])
maps = [np.empty((side, side, 3)[: 3 - k], np.float32) for k in (0, 1, 1, 1)]
_C.set_threads(3)
frame = _C.RasterFrame()

def draw():
    return frame.forward(*surfels, np.eye(4), K, side, side, 0.05, 1 / 255, np.zeros(3, np.float32), *maps, None, None)

size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (size + (60 << 20), resource.RLIM_INFINITY))
try:
    draw()
except MemoryError:
    print("refused")
try:
    _C.bench.count_pairs(frame, *maps, np.empty_like(maps[0]))
except (ValueError, MemoryError):
    print("no view")
resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
surfels = [x[:200].copy() for x in surfels]
draw()
assert np.isfinite(maps[0]).all()
print("drawn")
"""
    assert python(program) == "refused\nno view\ndrawn\n"


def test_a_forked_child_computes_the_same():
    program = (
        LOSS
        + """
import os
_C.set_threads(3)
wanted = loss()
child = os.fork()
if child == 0:
    os._exit(0 if loss() == wanted and _C.set_threads(2) == 2 and loss() == wanted else 1)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
assert loss() == wanted
print("same")
"""
    )
    assert python(program) == "same\n"


@pytest.mark.parametrize("sanitize", ["", "thread"])
def test_the_pool_itself(tmp_path, sanitize):
    compiler = os.environ.get("CXX", "g++")
    options = [f"-fsanitize={sanitize}", "-g"] if sanitize else []
    command = [
        compiler, "-std=c++17", "-O1", "-pthread", *options, "-I", CSRC,
        HERE / "parallel_check.cpp", CSRC / "parallel.cpp", "-o", tmp_path / "check",
    ]  # fmt: skip
    subprocess.run(command, check=True)
    options = {"TSAN_OPTIONS": f"die_after_fork=0:suppressions={HERE / 'tsan.supp'}"}
    done = subprocess.run(
        [tmp_path / "check"], check=False, capture_output=True, text=True, timeout=300, env={**os.environ, **options}
    )
    assert done.returncode == 0, done.stdout + done.stderr


DTYPE = """
import sys, torch
torch.set_default_dtype(getattr(torch, sys.argv[1]))
from room2dgs import losses, splat
from room2dgs.geometry.depth_maps import depth_to_normals

def random(*shape):
    return torch.rand(shape, generator=generator, dtype=torch.float32)

generator = torch.Generator().manual_seed(0)
n, height, width = 300, 40, 53
f32 = torch.float32
surfels = splat.Surfels(
    random(n, 3) * 2 + torch.tensor([-1, -1, 1.5], dtype=f32), random(n, 4) - 0.5, 0.2 * random(n, 2) + 0.01,
    random(n), random(n, 4, 3),
)
leaves = splat.Surfels(*(x.requires_grad_() for x in surfels))
pose = torch.eye(4, dtype=f32, requires_grad=True)
K = torch.tensor([[50, 0, 23], [0, 55, 19], [0, 0, 1]], dtype=f32)
center_px = torch.zeros(n, 2, dtype=f32, requires_grad=True)
results = []
for options in ({}, {"with_normal": False, "with_distortion": False}):
    out = splat.render(leaves, K, pose, width, height, center_px=center_px, **options)
    photo, prior = random(height, width, 3), random(height, width) + 1
    normals = torch.nn.functional.normalize(random(height, width, 3) - 0.5, dim=-1)
    valid = torch.ones(height, width, dtype=torch.bool)
    terms = [
        losses.rgb_loss(out.color, photo, 0.2),
        losses.normal_consistency(out, K, pose),
        losses.distortion(out),
        losses.depth_prior_loss(out.depth, out.alpha, prior, valid),
        losses.normal_prior_loss(out.normal, out.alpha, normals, valid),
    ]
    gradients = torch.autograd.grad(sum(terms), [*leaves, pose, center_px])
    results += [*out, *terms, *gradients, depth_to_normals(out.depth.detach(), K, pose.detach())]
torch.save([x.detach() for x in results], sys.argv[2])
"""


def test_the_default_dtype_changes_no_bit(tmp_path):
    results = []
    for dtype in ("float32", "float64"):
        python(DTYPE, dtype, tmp_path / dtype)
        results.append(torch.load(tmp_path / dtype, weights_only=True))
    assert len(results[0]) == 2 * (6 + 5 + 7 + 1)
    for k, (plain, other) in enumerate(zip(*results, strict=True)):
        assert torch.isfinite(plain).all() and plain.dtype == other.dtype == torch.float32, k
        assert torch.equal(plain, other), k
