"""Dense depth once more, begun with a depth of every pixel: one search at full size, in little memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from room2dgs import _C
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.view_selection import neighbours_by_points
from room2dgs.parallel_map import parallel_map
from room2dgs.stereo.dense import Options, Progress, Sight, least_consistent, near_and_ranges
from room2dgs.stereo.geometric_consistency import geometric_consistency
from room2dgs.stereo.patchmatch import Matching, Packed, Search
from room2dgs.stereo.planes import planes_of_depth, resized_planes
from room2dgs.stereo.start import wider_range

PERTURBATION = 0.5  # of the planes that it begins with, as in the first pass's second search
FIRST_DRAW = 100


def second_pass(
    views: Sequence[Packed],
    cameras: Sequence[Camera],
    sights: Sequence[Sight],
    xyz: np.ndarray,
    start: Sequence[Callable[[], np.ndarray]],
    options: Options,
    matching: Matching,
    progress: Progress = lambda *_: None,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Depth of posed photos that is nearly known, one view after the other.

    The first search asks for geometric consistency already. A view's slopes are forgotten when its cost is known, and
    the depth that it began with when no other view needs it any more: of each view about one inverse depth is in
    memory. The same photos give the same bits on any number of threads.

    Args:
        views: V; needed again and again, so that they may be packed when they are (`PackedWhenAsked`).
        cameras: V, theirs.
        sights: V, from the sparse points.
        xyz: (M, 3) sparse points, metres.
        start: functions that give (h, w) z-depth in metres, 0 = unknown, of any size, of the first views: the ones
            whose depth is wanted; each is called twice.
        progress: gets the stage, how many views are done, and of how many.

    Yields:
        (H, W) float32 z-depth, metres, 0 where the views do not agree, and (H, W) uint8, how many neighbours agree.
    """
    near_views, ranges = near_and_ranges(cameras, sights, xyz, options)
    matched = [near[: options.num_source_views].tolist() for near in near_views[: len(start)]]
    last_needed = {other: index for index, near in enumerate(matched) for other in near}
    before = {other: _nothing(cameras[other]) for other in last_needed if other >= len(start)}
    for index, depth in enumerate(made() for made in start):
        ranges[index] = wider_range(ranges[index], depth)
        if index in last_needed:
            before[index] = _planes(depth, cameras[index])[0].copy()
    found, photo_consistent = [], []
    for index, near in enumerate(matched):
        if not near:
            found.append(_nothing(cameras[index]))
            photo_consistent.append(found[index] > 0)
            continue
        view, others = views[index], [views[other] for other in near]
        inverse = [before[other] for other in near]
        search = Search(view, others, matching, ranges[index], index + 1, inverse)
        planes = search.run(
            _planes(start[index](), view.camera),
            options.refinements,
            perturbation=PERTURBATION,
            first_draw=FIRST_DRAW,
            thrifty=True,
        )
        cost, _ = search.costs(planes)
        found.append(planes[0].copy())
        photo_consistent.append(cost < options.max_cost)
        for other in near:
            if last_needed[other] == index:
                del before[other]
        progress(f"stereo at {view.camera.width} pixels, from the completed depth", index + 1, len(start))
    if len(start) < len(cameras):  # the others have no depth that could agree
        with_depth = cameras[: len(start)], [sight.points for sight in sights[: len(start)]]
        near_views = neighbours_by_points(*with_depth, xyz, options.consistency_views)

    def filtered(index: int) -> tuple[np.ndarray, np.ndarray]:
        near = near_views[index][: options.consistency_views]
        others = [(cameras[other], found[other]) for other in near]
        compared = geometric_consistency(
            cameras[index], found[index], others, options.max_reprojection_px, options.max_relative_difference
        )
        kept = photo_consistent[index] & (compared.num_consistent >= least_consistent(near, options))
        depth = np.divide(1, compared.inverse_depth, out=np.zeros_like(compared.inverse_depth), where=kept)
        return depth, np.where(kept, compared.num_consistent, np.uint8(0))

    yield from parallel_map(filtered, range(len(start)), _C.threads())


def _nothing(camera: Camera) -> np.ndarray:
    return np.zeros((camera.height, camera.width), np.float32)


def _planes(depth: np.ndarray, camera: Camera) -> np.ndarray:
    return resized_planes(planes_of_depth(depth), *camera.size)
