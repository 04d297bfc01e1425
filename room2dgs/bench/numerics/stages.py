"""Hard input for stereo and the joint depth optimisation: where there is nothing to go by."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.geometry.camera import Camera
from room2dgs.priors.joint import optimise
from room2dgs.splat import set_threads
from room2dgs.stereo.dense import Options, Sight, dense_views
from room2dgs.stereo.patchmatch import Matching, Search, packed
from room2dgs.stereo.planes import planes_of_depth
from room2dgs.stereo.reference import plane_costs

WIDTH, HEIGHT, FOCAL, WALL_M = 64, 48, 60.0, 2.0
FEW_STEPS = 4  # of each stage of the joint optimisation
NOTHING = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))


class StageResult(NamedTuple):
    """What a stage made of a case.

    Attributes:
        asked: what `off` is.
        off: how far the answer is from the known one.
        bound: of it.
        finite: all numbers are.
        same: the same bits on any number of threads, and again.
    """

    asked: str
    off: float
    bound: float
    finite: bool
    same: bool

    @property
    def passed(self) -> bool:
        return self.finite and self.same and self.off <= self.bound


def camera_at(x: float, turned: bool = False) -> Camera:
    """Looks along z of the world, or away from it."""
    rotation = np.diag([-1.0, 1.0, -1.0]) if turned else np.eye(3)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ [x, 0.02, 0.0]
    return Camera(np.array([[FOCAL, 0, WIDTH / 2 + 1], [0, FOCAL, HEIGHT / 2 - 2], [0, 0, 1]]), WIDTH, HEIGHT, pose)


def photo_of(camera: Camera, textured: bool = True) -> np.ndarray:
    """(H, W) uint8 of a wall at z = 2 m, with a smooth pattern or without."""
    if not textured:
        return np.full((HEIGHT, WIDTH), 180, np.uint8)
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    X = (x - camera.K[0, 2]) / FOCAL * WALL_M + camera.centre[0]
    Y = (y - camera.K[1, 2]) / FOCAL * WALL_M
    wave = np.sin(19 * X + 5 * Y) + np.cos(23 * Y - 7 * X) + 0.7 * np.sin(41 * X) * np.cos(37 * Y)
    return np.clip(128 + 40 * wave, 0, 255).astype(np.uint8)


def _stereo(cameras: list[Camera], textured: bool) -> StageResult:
    """Share of pixels that are kept where nothing can be known, or the wall's error where it can."""
    photos = [photo_of(camera, textured) for camera in cameras]
    nothing = Sight(np.zeros(0, int), np.zeros((0, 2)), np.zeros(0))
    grid = np.stack(np.meshgrid(np.linspace(-0.8, 0.8, 7), np.linspace(-0.6, 0.6, 5), [WALL_M]), -1).reshape(-1, 3)
    sights = []
    for camera in cameras:
        pixel, depth = camera.project(grid)
        seen = np.flatnonzero((depth > 0) & (pixel > 1).all(1) & (pixel < [WIDTH - 1, HEIGHT - 1]).all(1))
        sights.append(Sight(seen, pixel[seen], depth[seen]) if len(seen) else nothing)
    found = []
    try:
        for threads in (1, 3):
            set_threads(threads)
            found.append(list(dense_views(photos, cameras, sights, grid, Options(rounds=1), Matching())))
    finally:
        set_threads()
    same = all(np.array_equal(a, b) for one, two in zip(*found, strict=True) for a, b in zip(one, two, strict=True))
    finite = all(np.isfinite(part).all() for view in found[0] for part in view)
    depth = np.stack([view.depth for view in found[0]])
    if textured and len(cameras) > 1 and sights[0].points.size and sights[1].points.size:
        off = float(np.median(np.abs(depth[depth > 0] / WALL_M - 1))) if (depth > 0).mean() > 0.3 else 1.0
        return StageResult("median relative error of depth", off, 5e-3, finite, same)
    return StageResult("share of pixels given a depth", float((depth > 0).mean()), 0.0, finite, same)


def stereo() -> StageResult:
    """Nothing hard."""
    return _stereo([camera_at(x) for x in (0.0, 0.15, -0.15, 0.3)], True)


def stereo_no_overlap() -> StageResult:
    return _stereo([camera_at(0.0), camera_at(0.1, turned=True)], True)


def stereo_one_view() -> StageResult:
    return _stereo([camera_at(0.0)], True)


def stereo_no_texture() -> StageResult:
    return _stereo([camera_at(x) for x in (0.0, 0.15, -0.15, 0.3)], False)


def _costs(textured: bool, spoilt: bool = False) -> StageResult:
    """The kernels' costs of planes against the float64 reference."""
    cameras = [camera_at(x) for x in (0.0, 0.15, -0.15)]
    photos = [photo_of(camera, textured) for camera in cameras]
    random = np.random.default_rng(0)
    planes = planes_of_depth(np.full((HEIGHT, WIDTH), WALL_M, np.float32))
    planes[0] *= random.uniform(0.9, 1.1, planes[0].shape)
    if spoilt:
        planes[0] = 10.0 ** random.uniform(-6, 4, planes[0].shape)
        planes[1:] = random.normal(size=planes[1:].shape)
    planes = planes.astype(np.float32)
    settings = Matching(best=2)
    views = [packed(photo, camera) for photo, camera in zip(photos, cameras, strict=True)]
    found = []
    try:
        for threads in (1, 3):
            set_threads(threads)
            found.append(Search(views[0], views[1:], settings, (0.5, 8.0), 1).costs(planes)[0])
    finally:
        set_threads()
    expected, _ = plane_costs(
        (photos[0], cameras[0]), list(zip(photos[1:], cameras[1:], strict=True)), planes, settings
    )
    # a plane at the very limit of what a view judges may fall to either side of it
    off = float(np.quantile(np.abs(found[0] - expected), 0.999))
    finite = bool(np.isfinite(found[0]).all())
    return StageResult("cost (0..2) against float64", off, 1e-3, finite, np.array_equal(found[0], found[1]))


def stereo_cost() -> StageResult:
    """Nothing hard."""
    return _costs(True)


def stereo_cost_no_texture() -> StageResult:
    return _costs(False)


def stereo_cost_wild_planes() -> StageResult:
    """Depths from 0.1 mm to 1000 km, slopes of any size."""
    return _costs(True, spoilt=True)


@contextmanager
def _few_steps() -> Iterator[None]:
    whole = optimise.STAGES
    optimise.STAGES = tuple(stage._replace(steps=FEW_STEPS) for stage in whole)
    try:
        yield
    finally:
        optimise.STAGES = whole


def _joint(cameras: list[Camera], textured: bool, depth: Callable[[], np.ndarray] | None = None) -> StageResult:
    """Where nothing says otherwise a map must stay as it is."""
    map_of = depth or (lambda: np.full((HEIGHT, WIDTH), WALL_M, np.float32))
    with TemporaryDirectory() as folder, _few_steps():
        frames, depths = [], {}
        for index, camera in enumerate(cameras):
            path = Path(folder) / f"{index}.png"
            cv2.imwrite(str(path), np.repeat(photo_of(camera, textured)[..., None], 3, axis=2))
            frames.append(Frame(f"{index:06d}", camera, path))
            depths[frames[-1].name] = map_of()
        found = [dict(optimise.joint_depths(frames, depths, {}, NOTHING).depths) for _ in range(2)]
    valid = {name: np.isfinite(depth) & (depth > 0) for name, depth in depths.items()}
    off = max(
        (float(np.abs(found[0][name] / depths[name] - 1)[v].max()) for name, v in valid.items() if v.any()), default=0.0
    )
    finite = all(np.isfinite(found[0][name][v]).all() for name, v in valid.items())
    same = all(np.array_equal(a, found[1][name], equal_nan=True) for name, a in found[0].items())
    return StageResult("largest relative change of a map", off, 1e-3, finite, same)


def joint() -> StageResult:
    """Nothing hard: maps of one wall, which agree."""
    return _joint([camera_at(x) for x in (0.0, 0.15, -0.15)], True)


def _bumpy() -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return (WALL_M + 0.3 * np.sin(0.2 * x) + 0.01 * y).astype(np.float32)


def joint_no_overlap() -> StageResult:
    return _joint([camera_at(0.0), camera_at(0.1, turned=True)], True, _bumpy)


def joint_one_view() -> StageResult:
    return _joint([camera_at(0.0)], True, _bumpy)


def joint_no_texture() -> StageResult:
    return _joint([camera_at(x) for x in (0.0, 0.15, -0.15)], False)


def joint_no_depth() -> StageResult:
    """Maps without a single valid pixel."""
    return _joint([camera_at(x) for x in (0.0, 0.15)], True, lambda: np.zeros((HEIGHT, WIDTH), np.float32))


def joint_nan_depth() -> StageResult:
    """The left half of each map, which must not spoil the right one."""
    depth = np.full((HEIGHT, WIDTH), WALL_M, np.float32)
    depth[:, : WIDTH // 2] = np.nan
    return _joint([camera_at(x) for x in (0.0, 0.15)], True, depth.copy)


ALL: tuple[Callable[[], StageResult], ...] = (
    stereo, stereo_no_overlap, stereo_one_view, stereo_no_texture, stereo_cost, stereo_cost_no_texture,
    stereo_cost_wild_planes, joint, joint_no_overlap, joint_one_view, joint_no_texture, joint_no_depth, joint_nan_depth,
)  # fmt: skip
STAGES: dict[str, Callable[[], StageResult]] = {case.__name__.replace("_", " "): case for case in ALL}
