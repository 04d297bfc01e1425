"""Neighbours, agreement and the whole of stereo on a corner with exact depth."""

from __future__ import annotations

import os
from functools import partial

import numpy as np
import pytest

from room2dgs.errors import InputError
from room2dgs.geometry.view_selection import neighbours_by_points
from room2dgs.kernels.emulation import cuda_kernels_on_cpu
from room2dgs.splat import set_threads
from room2dgs.stereo.dense import Options, Sight, dense_views
from room2dgs.stereo.geometric_consistency import geometric_consistency
from room2dgs.stereo.patchmatch import Matching, PackedWhenAsked, packed
from room2dgs.stereo.second_pass import second_pass


def sparse(corner, count=60):
    """Points on the surfaces, and what each view sees of them."""
    random = np.random.default_rng(0)
    xyz = []
    for camera, _, depth, _ in corner:
        rows, columns = random.integers(4, 68, count), random.integers(4, 92, count)
        rays = np.stack([columns + 0.5, rows + 0.5, np.ones(count)], 1) @ np.linalg.inv(camera.K).T
        xyz.append((rays * depth[rows, columns, None] - camera.cam_from_world[:3, 3]) @ camera.cam_from_world[:3, :3])
    xyz = np.concatenate(xyz)
    sights = []
    for camera, _, depth, _ in corner:
        in_cam = xyz @ camera.cam_from_world[:3, :3].T + camera.cam_from_world[:3, 3]
        pixel = in_cam[:, :2] / in_cam[:, 2:] * camera.K[[0, 1], [0, 1]] + camera.K[:2, 2]
        inside = (pixel >= 0).all(1) & (pixel < (camera.width, camera.height)).all(1) & (in_cam[:, 2] > 0)
        column, row = np.where(inside[:, None], pixel, 0).astype(int).T
        index = np.flatnonzero(inside & (np.abs(depth[row, column] / in_cam[:, 2] - 1) < 0.02))
        sights.append(Sight(index, pixel[index], in_cam[index, 2]))
    return xyz, sights


def run(corner, options=Options(min_num_consistent=2)):  # noqa: B008
    xyz, sights = sparse(corner)
    photos, cameras = [photo for _, photo, _, _ in corner], [camera for camera, *_ in corner]
    return list(dense_views(photos, cameras, sights, xyz, options, Matching()))


def test_most_of_what_several_views_see_is_found_and_right(corner):
    for (camera, _, depth, normals), view in zip(corner[:3], run(corner), strict=False):
        kept = view.depth > 0
        assert kept.mean() > 0.6
        off = np.abs(view.depth - depth)[kept] / depth[kept]
        assert np.median(off) < 0.003 and np.mean(off < 0.02) > 0.97
        in_cam = view.normal[kept] @ camera.cam_from_world[:3, :3].T
        angle = np.degrees(np.arccos((in_cam * normals[kept]).sum(-1).clip(-1, 1)))
        assert np.median(angle) < 8
        assert (view.num_consistent[kept] >= 2).all() and (view.error[kept] > 0).all()
        assert (
            (view.normal[~kept] == 0).all()
            and (view.error[~kept] == 0).all()
            and (view.num_consistent[~kept] == 0).all()
        )


def test_coarse_to_fine_finds_it_too(corner):
    view = run(corner, Options(levels=2, rounds=1))[0]
    kept = view.depth > 0
    off = np.abs(view.depth - corner[0][2])[kept] / corner[0][2][kept]
    assert view.depth.shape == (72, 96) and kept.mean() > 0.6 and np.median(off) < 0.004


def test_a_second_pass_mends_depth_that_is_all_but_right(corner):
    """Begun at half size with depth that waves by 1 %, where the points say that everything is much nearer."""
    rows, columns = np.mgrid[:36, :48]
    photos, cameras = [photo for _, photo, _, _ in corner], [camera for camera, *_ in corner]
    start = [depth[::2, ::2] * (1 + 0.01 * np.sin(rows / 10 + columns / 14)) for _, _, depth, _ in corner]
    xyz, sights = sparse(corner)
    nearer = [sight._replace(depth=0.1 * sight.depth) for sight in sights]
    options = Options(levels=2, rounds=1, refinements=1)
    views = [packed(photo, camera) for photo, camera in zip(photos, cameras, strict=True)]
    known = [partial(np.copy, depth) for depth in start]
    found, num_consistent = next(second_pass(views, cameras, nearer, xyz, known, options, Matching()))
    depth, kept = corner[0][2], found > 0
    off = np.abs(found - depth)[kept] / depth[kept]
    assert (num_consistent[kept] >= 2).all() and not num_consistent[~kept].any()
    assert kept.mean() > 0.6 and np.median(off) < 0.006 and np.mean(off < 0.02) > 0.97


def test_a_second_pass_keeps_nothing_that_passes_unlike_the_other_photos(corner):
    """Something stands before one camera alone; the views' depth, with which all begin, agrees there, too."""
    cameras, xyz_sights = [camera for camera, *_ in corner], sparse(corner)
    photos = [photo.copy() for _, photo, _, _ in corner]
    box = (slice(20, 50), slice(30, 66))
    photos[0][box] = 255 - photos[0][box]
    known = [partial(np.copy, depth) for _, _, depth, _ in corner]
    kept = []
    for limit in (0.6, 2.0):
        options = Options(rounds=1, refinements=1, min_num_consistent=1, max_cost=limit)
        views = [packed(photo, camera) for photo, camera in zip(photos, cameras, strict=True)]
        depth, _ = next(second_pass(views, cameras, xyz_sights[1], xyz_sights[0], known, options, Matching()))
        kept.append(np.mean(depth[26:44, 36:60] > 0))  # windows that see nothing else
    assert kept[0] == 0 and kept[1] > 0.1


@pytest.mark.parametrize("levels", [1, 2])
def test_depth_of_some_views_is_found_by_comparing_them_with_all(corner, levels):
    xyz, sights = sparse(corner)
    photos, cameras = [photo for _, photo, _, _ in corner], [camera for camera, *_ in corner]
    options, done = Options(levels=levels, rounds=1), []
    found = dense_views(photos, cameras, sights, xyz, options, Matching(), lambda *one: done.append(one), wanted=1)
    (view,) = found
    kept = view.depth > 0
    off = np.abs(view.depth - corner[0][2])[kept] / corner[0][2][kept]
    assert kept.mean() > 0.5 and np.median(off) < 0.004
    searched = {stage for stage, number, _ in done if "search" in stage and number == 5}
    everywhere = 96 if levels == 1 else 48  # pixels
    assert searched == {f"stereo at {everywhere} pixels, search {one}" for one in (1, 2)}


def test_a_second_pass_at_some_views_is_held_to_the_others_photos(corner):
    """Of one view alone: without depth of the others nobody could agree, but two of five views have some."""
    photos, cameras = [photo for _, photo, _, _ in corner], [camera for camera, *_ in corner]
    xyz, sights = sparse(corner)
    views = PackedWhenAsked(photos, cameras, at_once=2)
    known = [partial(np.copy, depth) for _, _, depth, _ in corner[:3]]
    rest = (cameras, sights, xyz, known, Options(rounds=1, refinements=1), Matching())
    found = list(second_pass(views, *rest))
    assert len(found) == 3
    packed_before = [packed(photo, camera) for photo, camera in zip(photos, cameras, strict=True)]
    for one, same in zip(found, second_pass(packed_before, *rest), strict=True):
        np.testing.assert_array_equal(one, same)
    depth, num_consistent = found[0]
    kept, exact = depth > 0, corner[0][2]
    off = np.abs(depth - exact)[kept] / exact[kept]
    assert kept.mean() > 0.5 and num_consistent.max() == 2 and np.median(off) < 0.004


def test_a_second_pass_asks_the_views_that_have_depth(corner):
    """Photos beside the keyframes would be the best neighbours of some, but cannot agree."""
    order = [0, 1, 2, 4, 3]
    photos, cameras = [corner[view][1] for view in order], [corner[view][0] for view in order]
    xyz, sights = sparse([corner[view] for view in order])
    known = [partial(np.copy, corner[view][2]) for view in order[:3]]
    options = Options(rounds=1, refinements=1, consistency_views=2)
    assert {4, 3} & set(neighbours_by_points(cameras, [sight.points for sight in sights], xyz, 2)[0])
    views = PackedWhenAsked(photos, cameras)
    depth, num_consistent = next(second_pass(views, cameras, sights, xyz, known, options, Matching()))
    assert (depth > 0).mean() > 0.5 and num_consistent.max() == 2


def test_two_photos_are_enough_for_depth(corner):
    for view in run(corner[:2], Options(min_num_consistent=2)):
        kept = view.depth > 0
        assert kept.mean() > 0.3 and view.num_consistent.max() == 1
    view = run(corner[:2], Options(min_num_consistent=2))[0]
    off = np.abs(view.depth / corner[0][2] - 1)[view.depth > 0]
    assert np.median(off) < 0.01


def test_same_bits_on_any_number_of_threads(corner):
    found = []
    try:
        for count in (1, 2):
            set_threads(count)
            found.append(run(corner, Options(rounds=1, iterations=2)))
    finally:
        set_threads()
    for one, other in zip(*found, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_camera_that_only_turned_is_no_neighbour_and_its_view_has_no_depth(corner):
    camera = corner[0][0]
    alone = [corner[0]] * 3
    xyz, sights = sparse(alone)
    near = neighbours_by_points([camera] * 3, [sight.points for sight in sights], xyz, 4)
    assert all(len(views) == 0 for views in near)
    for view in run(alone):
        assert not view.depth.any() and not view.normal.any()


def test_no_sparse_points_at_all_is_no_obstacle(corner):
    nothing = Sight(np.zeros(0, int), np.zeros((0, 2)), np.zeros(0))
    photos, cameras = [photo for _, photo, _, _ in corner], [camera for camera, *_ in corner]
    options = Options(iterations=5)
    view = next(dense_views(photos, cameras, [nothing] * 5, np.zeros((0, 3)), options, Matching()))
    kept = view.depth > 0
    assert kept.mean() > 0.4
    assert np.median(np.abs(view.depth - corner[0][2])[kept] / corner[0][2][kept]) < 0.005


def test_neighbours_stand_on_different_sides(corner):
    """Two views beside each other on the right and one on the left: the second choice is the left one."""
    cameras = [corner[0][0], corner[1][0], corner[4][0], corner[2][0]]
    nudged = corner[1][0].cam_from_world.copy()
    nudged[0, 3] -= 0.01
    cameras[2] = type(cameras[1])(cameras[1].K, 96, 72, nudged)
    xyz, sights = sparse([corner[0]])
    seen = [sights[0].points] * 4
    near = neighbours_by_points(cameras, seen, xyz, 2)[0]
    assert set(near) in ({1, 3}, {2, 3})


def test_exact_depths_agree_and_a_wrong_one_is_alone(corner):
    inverse = [(1 / depth).astype(np.float32) for _, _, depth, _ in corner]
    cameras = [camera for camera, *_ in corner]
    others = list(zip(cameras[1:], inverse[1:], strict=True))
    exact = geometric_consistency(cameras[0], inverse[0], others, 1.0, 0.01)
    assert np.mean(exact.num_consistent >= 2) > 0.85
    np.testing.assert_allclose(exact.inverse_depth, inverse[0], rtol=0.01)
    assert np.mean(exact.num_seen_through == 0) > 0.9
    wrong, part = inverse[0].copy(), (slice(30, 40), slice(40, 50))
    wrong[part] *= 1.2
    found = geometric_consistency(cameras[0], wrong, others, 1.0, 0.01)
    assert (found.num_consistent[part] == 0).all()
    np.testing.assert_array_equal(found.inverse_depth[part], wrong[part])
    # too near: the others look through it; too far: they see what hides it
    assert (found.num_seen_through[part] >= 2).all() and (found.num_hidden[part] == 0).all()
    wrong[part] /= 1.2**2
    found = geometric_consistency(cameras[0], wrong, others, 1.0, 0.01)
    assert (found.num_hidden[part] >= 2).all() and (found.num_seen_through[part] == 0).all()


@pytest.mark.parametrize("value", [0.0, np.float32(1e-9)])
def test_unknown_depth_has_nobody_that_agrees(corner, value):
    inverse = np.full((72, 96), value, np.float32)
    found = geometric_consistency(
        corner[0][0], inverse, [(corner[1][0], (1 / corner[1][2]).astype(np.float32))], 1.0, 0.01
    )
    assert (found.num_consistent == 0).all() and np.isfinite(found.inverse_depth).all()


def test_the_kernels_for_a_gpu_find_the_same_depth(corner, monkeypatch, without_gpu):
    """As plain C++, to the bit without fused arithmetic; and nobody's else than `device` names."""
    monkeypatch.setenv("ROOM2DGS_ISA", os.environ.get("ROOM2DGS_BLOCK_ISA", "baseline"))
    few = Options(iterations=1, rounds=1, refinements=1)
    with cuda_kernels_on_cpu():
        by_block_code = run(corner, few)
    for a, b in zip(run(corner, few), by_block_code, strict=True):
        assert all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
    with pytest.raises(InputError, match=r"render\.device=cuda lacks"):
        run(corner, few._replace(device="cuda"))
