"""Hard input for the joint depth optimisation: its gradient against float64, and maps that nothing asks to change."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
import torch

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.depth.joint import optimise, reference
from room2dgs.depth.joint.draws import drawn
from room2dgs.depth.joint.energy import Energy
from room2dgs.depth.joint.overlap import overlap
from room2dgs.geometry.camera import Camera
from room2dgs.splat import set_threads
from room2dgs.tools.numerics.compare import relative_error
from room2dgs.tools.numerics.wall import HEIGHT, WALL_M, WIDTH, StageResult, camera_at, photo_of

FEW_STEPS = 4  # of each stage
SAMPLES = 3000  # of each term
NOTHING = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))


@contextmanager
def _few_steps() -> Iterator[None]:
    whole = optimise.STAGES
    optimise.STAGES = tuple(stage._replace(steps=FEW_STEPS) for stage in whole)  # type: ignore[assignment]
    try:
        yield
    finally:
        optimise.STAGES = whole


@contextmanager
def _frames(cameras: list[Camera], textured: bool) -> Iterator[list[Frame]]:
    with TemporaryDirectory() as folder:
        frames = []
        for index, camera in enumerate(cameras):
            path = Path(folder) / f"{index}.png"
            cv2.imwrite(str(path), np.repeat(photo_of(camera, textured)[..., None], 3, axis=2))
            frames.append(Frame(f"{index:06d}", camera, path))
        yield frames


def _on_threads(work: Callable[[], Any]) -> list[Any]:
    """What it gives on one thread and on three."""
    found = []
    try:
        for threads in (1, 3):
            set_threads(threads)
            found.append(work())
    finally:
        set_threads()
    return found


def _joint(cameras: list[Camera], textured: bool, depth: Callable[[], np.ndarray] | None = None) -> StageResult:
    """Where nothing says otherwise a map must stay as it is."""
    map_of = depth or (lambda: np.full((HEIGHT, WIDTH), WALL_M, np.float32))
    with _frames(cameras, textured) as frames, _few_steps():
        depths = {frame.name: map_of() for frame in frames}
        found = _on_threads(lambda: dict(optimise.joint_depths(frames, depths, {}, NOTHING).depths))
    valid = {name: np.isfinite(depth) & (depth > 0) for name, depth in depths.items()}
    off = max(
        (float(np.abs(found[0][name] / depths[name] - 1)[v].max()) for name, v in valid.items() if v.any()), default=0.0
    )
    finite = all(np.isfinite(found[0][name][v]).all() for name, v in valid.items())
    same = all(np.array_equal(a, found[1][name], equal_nan=True) for name, a in found[0].items())
    return StageResult("largest relative change of a map", off, 1e-3, finite, same)


def _gradient(
    cameras: list[Camera], textured: bool, depth: Callable[[], np.ndarray] | None = None, nan: bool = False
) -> StageResult:
    """The kernel's energy and gradient against the float64 reference, at grids that are rough."""
    random = np.random.default_rng(0)
    points = PointCloud(random.uniform((-0.9, -0.7, 1.9), (0.9, 0.7, 2.1), (300, 3)), np.zeros((300, 3), np.uint8))
    with _frames(cameras, textured) as frames:
        depths = {frame.name: (depth or _bumpy)() for frame in frames}
        normals = {}
        for frame in frames:
            normal = np.array([0.0, 0.0, -1.0]) + random.uniform(-0.15, 0.15, (HEIGHT, WIDTH, 3))
            normal[: HEIGHT // 2 if nan else 0] = np.nan
            normals[frame.name] = (normal / np.linalg.norm(normal, axis=2, keepdims=True)).astype(np.float32)
        views = overlap(frames, depths, normals, points)
    rough = torch.Generator().manual_seed(0)
    grid = 0.05 * torch.randn(len(views), 6, 8, generator=rough)
    stiffness = 0.1 + torch.rand(grid.shape, generator=rough)
    axes = torch.eye(3)[[1, 0, 2]]
    energy = Energy(views, optimise.weights_of(optimise.STAGES[-1]), stiffness, axes)
    draws = drawn(views, SAMPLES, rough, True)

    def differentiated() -> tuple[torch.Tensor, torch.Tensor]:
        gradient = torch.empty_like(grid)
        return torch.tensor(energy.gradient(grid, draws, gradient), dtype=torch.float64), gradient

    found = _on_threads(differentiated)
    leaf = grid.double().requires_grad_()
    wide = (reference.in_float64(views), leaf, draws, energy.weights, stiffness.double(), axes.double())
    expected = reference.energy(*wide)
    expected.backward()
    assert leaf.grad is not None
    off = max(relative_error(*pair) for pair in zip(found[0], (expected.detach(), leaf.grad), strict=True))
    same = all(torch.equal(a, b) for a, b in zip(*found, strict=True))
    return StageResult("energy and gradient against float64", off, 1e-4, bool(np.isfinite(off)), same)


def joint() -> StageResult:
    """Nothing hard: maps of one wall, which agree."""
    return _joint([camera_at(x) for x in (0.0, 0.15, -0.15)], True)


def _bumpy() -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return (WALL_M + 0.3 * np.sin(0.2 * x) + 0.01 * y).astype(np.float32)


def _nothing() -> np.ndarray:
    return np.zeros((HEIGHT, WIDTH), np.float32)


def _half_nan() -> np.ndarray:
    depth = np.full((HEIGHT, WIDTH), WALL_M, np.float32)
    depth[:, : WIDTH // 2] = np.nan
    return depth


def joint_no_overlap() -> StageResult:
    return _joint([camera_at(0.0), camera_at(0.1, turned=True)], True, _bumpy)


def joint_one_view() -> StageResult:
    return _joint([camera_at(0.0)], True, _bumpy)


def joint_no_texture() -> StageResult:
    return _joint([camera_at(x) for x in (0.0, 0.15, -0.15)], False)


def joint_no_depth() -> StageResult:
    """Maps without a single valid pixel."""
    return _joint([camera_at(x) for x in (0.0, 0.15)], True, _nothing)


def joint_nan_depth() -> StageResult:
    """The left half of each map, which must not spoil the right one."""
    return _joint([camera_at(x) for x in (0.0, 0.15)], True, _half_nan)


def joint_gradient() -> StageResult:
    """Nothing hard: points, normals, and maps that do not agree."""
    return _gradient([camera_at(x) for x in (0.0, 0.15, -0.15)], True)


def joint_gradient_no_overlap() -> StageResult:
    return _gradient([camera_at(0.0), camera_at(0.1, turned=True)], True)


def joint_gradient_one_view() -> StageResult:
    return _gradient([camera_at(0.0)], False)


def joint_gradient_no_texture() -> StageResult:
    return _gradient([camera_at(x) for x in (0.0, 0.15, -0.15)], False)


def joint_gradient_no_depth() -> StageResult:
    return _gradient([camera_at(x) for x in (0.0, 0.15)], False, _nothing)


def joint_gradient_nan_depth_and_normals() -> StageResult:
    return _gradient([camera_at(x) for x in (0.0, 0.15)], False, _half_nan, nan=True)


ALL: tuple[Callable[[], StageResult], ...] = (
    joint, joint_no_overlap, joint_one_view, joint_no_texture, joint_no_depth, joint_nan_depth, joint_gradient,
    joint_gradient_no_overlap, joint_gradient_one_view, joint_gradient_no_texture, joint_gradient_no_depth,
    joint_gradient_nan_depth_and_normals,
)  # fmt: skip
