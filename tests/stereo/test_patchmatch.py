"""PatchMatch kernels against the float64 reference, exact depth, and themselves on other numbers of threads."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from room2dgs.kernels.builds import CPU, PLAIN, set_order
from room2dgs.splat import set_threads
from room2dgs.stereo.patchmatch import Matching, Search, packed, warp
from room2dgs.stereo.planes import plane_normals, planes_of_depth
from room2dgs.stereo.reference import plane_costs

RANGE = (0.5, 8.0)


def search(corner, settings=Matching(), seed=1, inverse_depths=None, kernels=CPU, **kwargs):  # noqa: B008
    views = [packed(photo, camera, kernels) for camera, photo, _, _ in corner]
    return Search(views[0], views[1:], settings, RANGE, seed, inverse_depths, **kwargs)


def some_planes(corner, seed=0):
    """Exact planes of the first view, disturbed by up to 20 %."""
    random = np.random.default_rng(seed)
    planes = planes_of_depth(corner[0][2].astype(np.float32))
    planes[0] *= random.uniform(0.8, 1.2, planes[0].shape)
    planes[1:] += random.normal(size=planes[1:].shape) * 1e-3
    return planes.astype(np.float32)


@pytest.mark.parametrize("isa", ["avx2", "baseline"])
@pytest.mark.parametrize("settings", [Matching(), Matching(radius=3, step=1, top_k=2, sigma_grey=25.0)])
def test_costs_are_the_references(corner, settings, isa, monkeypatch):
    monkeypatch.setenv("ROOM2DGS_ISA", isa)
    planes = some_planes(corner)
    found, variance = search(corner, settings).costs(planes)
    others = [(photo, camera) for camera, photo, _, _ in corner[1:]]
    expected, expected_variance = plane_costs((corner[0][1], corner[0][0]), others, planes, settings)
    np.testing.assert_allclose(variance, expected_variance, atol=2e-3, rtol=1e-4)
    # a plane at the very limit of what a view judges may fall to either side of it
    off = np.abs(found - expected)
    assert np.mean(off > 2e-4) < 1e-3
    assert np.median(expected) < 1.2 and expected.min() < 0.2  # the case is not one of planes that nobody sees


def test_geometric_cost_is_the_references(corner):
    planes, settings = some_planes(corner, 3), Matching(geometric_weight=0.3)
    inverse = [(1 / depth).astype(np.float32) for _, _, depth, _ in corner[1:]]
    inverse[0][20:40, 30:60] = 0
    run = search(corner, settings, inverse_depths=inverse)
    same = run.run(planes, 0)  # no sweep: the planes come back as they were, within the limits
    np.testing.assert_array_equal(same[0], planes[0].clip(1 / RANGE[1], 1 / RANGE[0]))
    others = [(photo, camera) for camera, photo, _, _ in corner[1:]]
    with_depth, _ = plane_costs((corner[0][1], corner[0][0]), others, planes, settings, inverse)
    without, _ = plane_costs((corner[0][1], corner[0][0]), others, planes, settings)
    assert (with_depth >= without - 1e-9).all() and (with_depth > without + 0.1).mean() > 0.3
    # what the search minimises: exact depths of the others pull planes to the exact depth
    exact = corner[0][2]
    error = {}
    for name, depths in (("with", inverse), ("without", None)):
        found = search(corner, settings, inverse_depths=depths).run(planes, 2)
        error[name] = np.median(np.abs(1 / found[0] - exact) / exact)
    assert error["with"] < error["without"] < 0.05


def test_depth_and_normals_of_two_planes_are_found_from_nothing(corner):
    found = search(corner).run(np.zeros((3, *corner[0][1].shape), np.float32), 4, random_depths=3)
    camera, _, depth, normals = corner[0]
    inner = (slice(6, -6), slice(10, -10))
    relative = np.abs(1 / found[0] - depth)[inner] / depth[inner]
    assert np.median(relative) < 0.005
    assert np.mean(relative < 0.03) > 0.85
    cosine = (plane_normals(found, camera) * normals).sum(axis=-1)[inner]
    assert np.median(np.degrees(np.arccos(cosine.clip(-1, 1)))) < 8


def test_same_bits_on_any_number_of_threads(corner):
    results = []
    try:
        for count in (1, 2, 3):
            set_threads(count)
            start = np.zeros((3, *corner[0][1].shape), np.float32)
            results.append(search(corner).run(start, 3, random_depths=1, thrifty=True))
    finally:
        set_threads()
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])


@pytest.mark.parametrize("isa", ["avx2", "baseline"])
def test_each_of_many_views_is_asked_about_its_own_photo(corner, isa, monkeypatch):
    monkeypatch.setenv("ROOM2DGS_ISA", isa)
    others = [corner[1 + index % 4] for index in range(12)]
    others = [(np.roll(photo, index, axis=0), camera) for index, (camera, photo, _, _) in enumerate(others)]
    planes, settings = some_planes(corner), Matching(top_k=4)
    run = Search(packed(corner[0][1], corner[0][0]), [packed(*other) for other in others], settings, RANGE, 0)
    expected, _ = plane_costs((corner[0][1], corner[0][0]), others, planes, settings)
    assert np.mean(np.abs(run.costs(planes)[0] - expected) > 2e-4) < 2e-3


def test_thrift_after_the_first_iteration_costs_little(corner):
    _, _, depth, _ = corner[0]
    start = some_planes(corner)
    wrong = []
    for thrifty in (False, True):
        found = search(corner).run(start, 3, perturbation=0.5, thrifty=thrifty)
        wrong.append(np.mean(np.abs(1 / found[0] - depth)[6:-6, 10:-10] > 0.01 * depth[6:-6, 10:-10]))
    assert wrong[1] < wrong[0] + 0.01 and wrong[0] != wrong[1]  # and it is another search


@pytest.mark.parametrize(
    "settings",
    [Matching(), Matching(radius=3, step=1, top_k=2, geometric_weight=0.3), Matching(top_k=1, step=4)],
)
def test_the_kernels_for_a_gpu_find_the_same_bits(corner, settings, monkeypatch):
    """As plain C++, which has no fused multiply-add (a GPU has AVX2's); in any order of blocks and threads."""
    monkeypatch.setenv("ROOM2DGS_ISA", os.environ.get("ROOM2DGS_BLOCK_ISA", "baseline"))
    inverse = [(1 / depth).astype(np.float32) for _, _, depth, _ in corner[1:]]
    inverse[0][20:40, 30:60] = 0
    start = some_planes(corner)
    start[:, 30:50, 20:70] = 0  # drawn at random
    hints = planes_of_depth(corner[0][2].astype(np.float32))
    hints[:, :, 48:] = 0

    def found(kernels):
        first = search(corner, settings, kernels=kernels).run(start, 3, random_depths=1, hints=hints)
        later = search(corner, settings, inverse_depths=inverse, kernels=kernels)
        runs = [first, later.run(start, 3, perturbation=0.5, thrifty=True)]
        return [*runs, *search(corner, settings, kernels=kernels).costs(runs[0])]

    expected = found(CPU)
    try:
        for order in (0, 3):
            set_order(order)
            for a, b in zip(found(PLAIN), expected, strict=True):
                np.testing.assert_array_equal(a, b)
    finally:
        set_order(0)


def test_another_seed_gives_other_draws(corner):
    start = np.zeros((3, *corner[0][1].shape), np.float32)
    one, other = (search(corner, seed=seed).run(start, 1) for seed in (1, 2))
    assert np.mean(one[0] != other[0]) > 0.5


def test_a_hint_is_taken_where_it_is_better(corner):
    exact = planes_of_depth(corner[0][2].astype(np.float32))
    wrong = exact * np.float32(1.3)
    hints = exact.copy()
    hints[:, :, 48:] = 0  # no hint on the right
    run = search(corner)
    settled = run.run(wrong, 1, perturbation=0.0, hints=hints)
    left = np.abs(settled[0] / exact[0] - 1)[10:-10, 10:40]
    assert np.mean(left < 0.01) > 0.9


def test_blank_photos_have_no_preference_and_nothing_breaks(corner):
    blank = [(camera, np.full_like(photo, 200), depth, normals) for camera, photo, depth, normals in corner]
    cost, variance = search(blank).costs(some_planes(corner))
    assert np.isfinite(cost).all() and (variance == 0).all()
    assert np.mean(np.abs(cost - 1) < 1e-6) > 0.5  # NCC 0 where it is seen at all


def test_planes_behind_every_other_camera_cost_most(corner):
    camera, photo, _, _ = corner[0]
    turned = np.diag([-1.0, 1.0, -1.0, 1.0])
    away = replace(camera, cam_from_world=turned @ camera.cam_from_world)
    run = Search(packed(photo, camera), [packed(photo, away)], Matching(), RANGE, 0)
    cost, _ = run.costs(some_planes(corner))
    assert (cost == 2).all()


def test_values_that_are_not_finite_are_no_planes(corner):
    planes = some_planes(corner)
    planes[0, 5:9, 5:9] = np.nan
    planes[1, 20:24, 30:40] = np.inf
    found = search(corner).run(planes, 1)
    assert np.isfinite(found).all() and (found[0] > 0).all()


def test_warp_takes_a_point_to_its_pixel(corner):
    (camera, _, depth, _), (other, _, _, _) = corner[0], corner[1]
    row, column = 30, 40
    ray = np.linalg.inv(camera.K) @ [column + 0.5, row + 0.5, 1]
    world = camera.world_from_cam @ np.append(ray * depth[row, column], 1)
    in_other = other.K @ (other.cam_from_world @ world)[:3]
    there = warp(camera, other) @ [column, row, 1, 1 / depth[row, column]]
    np.testing.assert_allclose(there[:2] / there[2] + 0.5, in_other[:2] / in_other[2], atol=1e-9)


@pytest.mark.parametrize(
    "call",
    [
        lambda run, size: run.run(np.zeros((3, 5, 5), np.float32), 1),
        lambda run, size: run.run(np.zeros((3, *size), np.float32), -1),
        lambda run, size: run.run(np.zeros((3, *size), np.float32), 1, hints=np.zeros((3, 4, 4), np.float32)),
    ],
)
def test_arrays_of_another_size_are_refused(corner, call):
    with pytest.raises(ValueError):
        call(search(corner), corner[0][1].shape)


def test_impossible_settings_are_refused(corner):
    for settings in (Matching(radius=0), Matching(top_k=9), Matching(sigma_grey=0.0), Matching(radius=12, step=1)):
        with pytest.raises(ValueError):
            search([*corner, *corner, *corner], settings)
    camera, photo, _, _ = corner[0]
    with pytest.raises(ValueError):
        packed(photo[:4], camera)
    other, photo_there, depth, _ = corner[1]
    poses = warp(camera, other), warp(other, camera)
    with pytest.raises(ValueError, match="inverse_depth"):  # of one view and not of the others
        search(corner)._match.add_view(packed(photo_there, other).photo, *poses, depth.astype(np.float32))
    with pytest.raises(ValueError):
        Search(packed(photo, camera), [], Matching(), RANGE, 0).run(np.zeros((3, *photo.shape), np.float32), 1)
