"""Hard input for stereo and the joint depth optimisation: where there is nothing to go by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from room2dgs.geometry.camera import Camera
from room2dgs.splat import set_threads
from room2dgs.stereo.dense import Options, Sight, dense_views
from room2dgs.stereo.patchmatch import Matching, Search, packed
from room2dgs.stereo.planes import planes_of_depth
from room2dgs.stereo.reference import plane_costs
from room2dgs.tools.numerics import joint
from room2dgs.tools.numerics.wall import HEIGHT, WALL_M, WIDTH, StageResult, camera_at, photo_of


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
    settings = Matching(top_k=2)
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


ALL: tuple[Callable[[], StageResult], ...] = (
    stereo, stereo_no_overlap, stereo_one_view, stereo_no_texture, stereo_cost, stereo_cost_no_texture,
    stereo_cost_wild_planes, *joint.ALL,
)  # fmt: skip
STAGES: dict[str, Callable[[], StageResult]] = {case.__name__.replace("_", " "): case for case in ALL}
