"""Dense depth of all views: matched, made consistent with each other, and filtered."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from room2dgs import _C
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.view_selection import neighbours_by_points
from room2dgs.kernels.builds import build_of
from room2dgs.parallel_map import parallel_map
from room2dgs.stereo.geometric_consistency import geometric_consistency
from room2dgs.stereo.patchmatch import Matching, Packed, Search, packed
from room2dgs.stereo.planes import plane_normals, resized_planes
from room2dgs.stereo.start import depth_range, planes_from_points

Progress = Callable[[str, int, int], None]  # stage, done, of how many
DISPARITY_ERROR_PX = 0.25  # of a match that is right
COARSEST_WIDTH = 240


class Options(NamedTuple):
    """Numbers of the search over all views; see config/groups/stereo.py.

    Attributes:
        num_source_views: views that a view is matched with; consistency_views: views whose depth it is compared with.
        iterations: sweeps of the first search; refinements: of each later one.
        rounds: searches with geometric consistency, at each image size.
        levels: image sizes, each half of the next.
        min_num_consistent, max_reprojection_px, max_relative_difference, max_cost: what a pixel must satisfy.
        device: what matches, as `render.device` names it.
    """

    num_source_views: int = 6
    consistency_views: int = 10
    iterations: int = 3
    refinements: int = 2
    rounds: int = 2
    levels: int = 1
    min_num_consistent: int = 2
    max_reprojection_px: float = 1.0
    max_relative_difference: float = 0.01
    max_cost: float = 0.6
    device: str = "cpu"


class Sight(NamedTuple):
    """Which sparse points a view sees: (N,) indices, (N, 2) pixels and (N,) depths in metres."""

    points: np.ndarray
    pixel: np.ndarray
    depth: np.ndarray


class DenseView(NamedTuple):
    """What stereo found in one view, at the size of its camera.

    Attributes:
        depth: (H, W) float32 z-depth, metres; 0 where the views do not agree.
        normal: (H, W, 3) float32 unit, world frame, facing the camera; 0 where there is no depth.
        num_consistent: (H, W) uint8, how many neighbours agree with the depth.
        error: (H, W) float32, expected error of the depth, metres; 0 where there is none.
        planes: (3, H, W) float32, the unfiltered planes.
    """

    depth: np.ndarray
    normal: np.ndarray
    num_consistent: np.ndarray
    error: np.ndarray
    planes: np.ndarray


def dense_views(
    photos: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    sights: Sequence[Sight],
    xyz: np.ndarray,
    options: Options,
    matching: Matching,
    progress: Progress = lambda *_: None,
    *,
    wanted: int | None = None,
) -> Iterator[DenseView]:
    """Stereo of posed photos, one view after the other: all of them at once would take most of the memory.

    The same photos give the same bits on any number of threads.

    Args:
        photos: V grey photos (H, W) uint8, of their cameras' sizes.
        cameras: V.
        sights: V, from the sparse points.
        xyz: (M, 3) sparse points, metres.
        progress: gets the stage, how many views are done, and of how many.
        wanted: the first so many views' depth is wanted; the others are searched, for their sake, at the
            smaller sizes only, if there are any. None: of all.

    Yields:
        As many results; a view without a neighbour has no depth at all.
    """
    near_views, ranges = near_and_ranges(cameras, sights, xyz, options)
    wanted = len(photos) if wanted is None else wanted
    planes: list[np.ndarray] = []
    coarse: list[DenseView] = []
    for level in reversed(range(options.levels)):
        views = [_at_level(photo, camera, level, options.device) for photo, camera in zip(photos, cameras, strict=True)]
        first = not planes
        if first:
            scales = [view.camera.width / camera.width for view, camera in zip(views, cameras, strict=True)]
            planes = [
                planes_from_points(sight.pixel * scale, sight.depth, view.camera)
                for sight, scale, view in zip(sights, scales, views, strict=True)
            ]
        else:
            for index, view in enumerate(views):
                planes[index] = resized_planes(planes[index], *view.camera.size)
        for search in range((0 if first else 1), options.rounds + 1):
            searched = wanted if level == 0 and not first else len(views)
            _search(views, planes, near_views, ranges, options, matching, search, level, progress, searched)
        if level == 1:
            coarse = list(_filtered(views, planes, near_views, options, matching, progress, wanted))
    for index, fine in enumerate(_filtered(views, planes, near_views, options, matching, progress, wanted)):
        yield _completed(fine, coarse[index]) if coarse else fine


def near_and_ranges(
    cameras: Sequence[Camera], sights: Sequence[Sight], xyz: np.ndarray, options: Options
) -> tuple[list[np.ndarray], list[tuple[float, float]]]:
    """Each view's neighbours, best first, and the nearest and farthest depth to search, metres."""
    count = max(options.num_source_views, options.consistency_views)
    near_views = neighbours_by_points(cameras, [sight.points for sight in sights], xyz, count)
    everywhere = np.concatenate([sight.depth for sight in sights])
    if not len(everywhere):
        everywhere = np.array([0.5, 5.0])  # a room, if no point says otherwise
    return near_views, [depth_range(sight.depth, everywhere) for sight in sights]


def least_consistent(near: np.ndarray | Sequence[int], options: Options) -> int:
    """Views that have to agree with one that is compared with these: all, where there are fewer than wanted."""
    return max(1, min(options.min_num_consistent, len(near)))


def _completed(fine: DenseView, coarse: DenseView) -> DenseView:
    """The fine result; where its views did not agree, the coarse one's: a smaller photo has less noise and blur."""
    height, width = fine.depth.shape
    planes = resized_planes(coarse.planes * (coarse.depth > 0), width, height)
    row = np.minimum((np.arange(height) + 0.5) * coarse.depth.shape[0] // height, coarse.depth.shape[0] - 1).astype(int)
    column = np.minimum((np.arange(width) + 0.5) * coarse.depth.shape[1] // width, coarse.depth.shape[1] - 1).astype(
        int
    )
    added = (fine.depth == 0) & (planes[0] > 0)
    depth = np.divide(1, planes[0], out=np.zeros_like(fine.depth), where=added)

    def joined(name: str, there: np.ndarray) -> np.ndarray:
        theirs = getattr(coarse, name)[row[:, None], column]
        return np.where(there if theirs.ndim == 2 else there[..., None], theirs, getattr(fine, name))

    return DenseView(
        np.where(added, depth, fine.depth),
        joined("normal", added),
        joined("num_consistent", added),
        joined("error", added),
        fine.planes,
    )


def _at_level(photo: np.ndarray, camera: Camera, level: int, device: str) -> Packed:
    kernels = build_of(device)
    if level == 0:
        return packed(photo, camera, kernels)
    width, height = max(8, round(camera.width / 2**level)), max(8, round(camera.height / 2**level))
    smaller = cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA)
    return packed(smaller, camera.resized(width, height), kernels)


def _search(
    views: Sequence[Packed],
    planes: list[np.ndarray],
    near_views: Sequence[np.ndarray],
    ranges: Sequence[tuple[float, float]],
    options: Options,
    matching: Matching,
    search: int,
    level: int,
    progress: Progress,
    searched: int,
) -> None:
    """The first so many views once, in place; all see the others' depths as they were before."""
    before = [plane[0].copy() for plane in planes] if search else []
    for index, view in enumerate(views[:searched]):
        near = near_views[index][: options.num_source_views]
        if not len(near):
            planes[index] = np.zeros_like(planes[index])
            continue
        inverse = [before[other] for other in near] if search else None
        run = Search(view, [views[other] for other in near], matching, ranges[index], index + 1, inverse)
        draw = 1000 * level + 100 * search
        if search:
            size = 0.5 / search
            thrifty = level == 0  # at smaller sizes what is missed is missed for good
            planes[index] = run.run(
                planes[index], options.refinements, perturbation=size, first_draw=draw, thrifty=thrifty
            )
        else:
            planes[index] = run.run(planes[index], options.iterations, random_depths=2, first_draw=draw)
        progress(f"stereo at {view.camera.width} pixels, search {search + 1}", index + 1, searched)


def _filtered(
    views: Sequence[Packed],
    planes: Sequence[np.ndarray],
    near_views: Sequence[np.ndarray],
    options: Options,
    matching: Matching,
    progress: Progress,
    wanted: int,
) -> Iterator[DenseView]:
    def filtered(index: int) -> DenseView:
        view, near = views[index], near_views[index]
        camera = view.camera
        if not len(near):
            nothing = np.zeros(planes[index].shape[1:], np.float32)
            blank = np.zeros((*nothing.shape, 3), np.float32)
            return DenseView(nothing, blank, nothing.astype(np.uint8), nothing, planes[index])
        others = [views[other] for other in near[: options.num_source_views]]
        cost, _ = Search(view, others, matching, (0.1, 100.0), 0).costs(planes[index])
        compared = geometric_consistency(
            camera,
            planes[index][0],
            [(views[other].camera, planes[other][0]) for other in near[: options.consistency_views]],
            options.max_reprojection_px,
            options.max_relative_difference,
        )
        kept = (compared.num_consistent >= least_consistent(near[: options.consistency_views], options)) & (
            cost < options.max_cost
        )
        depth = np.divide(1, compared.inverse_depth, out=np.zeros_like(compared.inverse_depth), where=kept)
        normal = camera.turned_to_world(plane_normals(planes[index], camera))
        baseline = np.median([np.linalg.norm(views[other].camera.centre - camera.centre) for other in near])
        # a match is off by a part of a pixel; views that are averaged differ by what they are off
        by_disparity = DISPARITY_ERROR_PX * depth / (camera.K[0, 0] * max(float(baseline), 1e-6))
        error = depth * np.hypot(by_disparity, compared.sigma)
        planes_kept = np.stack([np.where(kept, compared.inverse_depth, planes[index][0]), *planes[index][1:]])
        return DenseView(
            depth.astype(np.float32),
            np.where(kept[..., None], normal, 0).astype(np.float32),
            np.where(kept, compared.num_consistent, 0).astype(np.uint8),
            np.where(kept, error, 0).astype(np.float32),
            planes_kept.astype(np.float32),
        )

    order = range(wanted)
    # a GPU is chosen for the thread that asks for it
    done = parallel_map(filtered, order, _C.threads()) if options.device == "cpu" else map(filtered, order)
    for index, found in enumerate(done):
        progress("stereo, filter", index + 1, wanted)
        yield found
