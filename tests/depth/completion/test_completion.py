"""Completion: a view's depth drawn to what stereo found, and how far it is to be trusted."""

from __future__ import annotations

import weakref
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import pytest

from room2dgs import _C
from room2dgs.captures.lazy_maps import LazyMaps
from room2dgs.captures.point_cloud import PointCloud, Tracks
from room2dgs.captures.scene import Frame
from room2dgs.captures.uncertainty import completed_weight
from room2dgs.depth.completion import solve
from room2dgs.depth.completion.expected_error import expected_relative_error
from room2dgs.depth.completion.interpolate import system_of
from room2dgs.depth.completion.low_res import low_res_input
from room2dgs.depth.completion.photo_edges import ties_across_edges
from room2dgs.depth.completion.solve import normal_slopes, prior_slopes
from room2dgs.stereo.geometric_consistency import GeometricConsistency
from room2dgs.stereo.passes import StereoMap


def solved(sample, trust, prior, weight=0.0, tie=1.0, photo=None, slopes=None):
    shape = prior.shape
    edges = ties_across_edges(np.zeros((*shape, 3)) if photo is None else photo)
    trusted, weights, ties = (np.full(shape, value) for value in (trust, weight, tie))
    own = prior_slopes(prior) if slopes is None else slopes
    given = solve.system(sample, trusted, prior, weights, own, ties, edges, by_normals=slopes is not None)
    return solve.solved([given])[0]


def test_a_few_samples_correct_the_scale_everywhere():
    prior = np.full((30, 40), 2.0)
    sample = np.zeros_like(prior)
    sample[::7, ::7] = 2.1
    assert np.abs(np.exp(solved(sample, 1.0, prior)) * prior - 2.1).max() < 1e-3


def test_a_wrong_sample_among_right_ones_is_overruled():
    prior = np.full((30, 40), 2.0)
    sample = np.zeros_like(prior)
    sample[::5, ::5] = 2.0
    sample[15, 20] = 3.0
    assert np.abs(np.exp(solved(sample, 1.0, prior, weight=0.2)) - 1).max() < 0.01


def test_what_one_surface_says_does_not_cross_an_edge():
    """Two walls at 2 and 4 m; samples on the near one say that it is 5 % farther, and nothing of the other."""
    prior = np.full((30, 40), 2.0)
    prior[:, 20:] = 4.0
    sample = np.zeros_like(prior)
    sample[:, :18] = 2.1
    r = solved(sample, 1.0, prior, weight=0.3)
    assert abs(np.exp(r[:, :18]).mean() - 1.05) < 0.01
    assert abs(np.exp(r[:, 24:]).mean() - 1) < 0.01


def test_a_curtain_ends_where_the_photo_shows_an_edge():
    """A curtain at 2 m and the wall behind it, which the network has as one surface; stereo knows the curtain well and
    little of the wall, at the far side of the photo."""
    prior = np.full((30, 40), 2.0)
    sample = np.zeros_like(prior)
    sample[:, :20] = 2.0
    sample[::3, 36:] = 2.5
    photo = np.full((30, 40, 3), 120.0)
    photo[:, 20:] -= [60, 70, 80]
    known = np.where(sample > 2.2, 0.5, 1.0)
    for given, least, most in ((photo, 2.45, 2.55), (None, 1.95, 2.4)):
        depth = np.exp(solved(sample, known, prior, weight=0.01, photo=given)) * prior
        assert least < np.median(depth[:, 21:26]) < most
        assert np.abs(depth[:, :19] - 2).max() < 0.02


def test_edges_go_by_the_difference_of_neighbours_along_either_axis():
    photo = np.zeros((6, 9, 3), np.uint8)
    photo[:, 5:] = 8
    photo[2:, :] += np.uint8(40)
    right, down = ties_across_edges(photo)
    assert right.shape == (6, 8) and down.shape == (5, 9)
    assert np.allclose(right[:, 4], 0.51) and np.allclose(np.delete(right, 4, axis=1), 1)
    assert (down[1] < 0.07).all() and np.allclose(np.delete(down, 1, axis=0), 1)


def test_a_views_ties_are_weak_where_its_own_photo_has_an_edge(box_room, tmp_path):
    room = box_room(count=2, turn=0.1)
    frame, depth = room.frames[0], room.depths[0].astype(np.float32)
    photo = np.full((*depth.shape, 3), 50, np.uint8)
    edges = {}
    for name, left in (("blank", 50), ("edged", 200)):
        photo[:, : depth.shape[1] // 2] = left
        assert cv2.imwrite(str(tmp_path / f"{name}.png"), photo)
        shown = replace(frame, color_path=tmp_path / f"{name}.png")
        edges[name] = low_res_input(shown, depth, None, None, None, room.points, 0.0).edges
    assert all((ties == 1).all() for ties in edges["blank"])
    right, down = edges["edged"]
    weak = (right < 0.1).any(axis=0)
    assert 1 <= weak.sum() <= 2 and (right[:, weak] < 0.1).any(axis=1).all() and (right[:, ~weak] == 1).all()
    assert (down == 1).all()


def test_only_a_view_with_normals_follows_them(box_room):
    """Depth that begins to lean in the middle of a view, with and without the normals of a wall that faces it."""
    room = box_room(count=2, turn=0.1)
    frame, shape = room.frames[0], room.depths[0].shape
    leaning = np.broadcast_to(np.linspace(1.8, 2.2, shape[1], dtype=np.float32).clip(2.0), shape)
    facing = np.broadcast_to(-frame.camera.forward.astype(np.float32), (*shape, 3))
    without, following = (
        system_of(low_res_input(frame, leaning, None, normal, None, room.points, 0.0)) for normal in (None, facing)
    )
    assert (without.step_right == 0).all() and (without.step_down == 0).all()
    np.testing.assert_allclose(following.step_right.sum(axis=1), -np.log(1.1), atol=0.01)
    np.testing.assert_allclose(following.step_down, 0, atol=1e-6)


def test_nothing_is_made_where_the_prior_has_nothing():
    prior = np.full((30, 40), 2.0)
    prior[5:9] = 0
    sample = np.full_like(prior, 2.2)
    r = solved(sample, 1.0, prior)
    assert (r[5:9] == 0).all() and np.isfinite(r).all()
    assert np.abs(r[:5] - np.log(1.1)).max() < 1e-3


@pytest.mark.parametrize("lacking", [False, True])
def test_a_wall_stands_as_its_normals_say_though_the_prior_leans(lacking):
    """An upright wall at 4 m, of which the floor holds the foot; the prior has its top at 3.4 m."""
    prior = np.repeat(np.linspace(3.4, 4.0, 30)[:, None], 40, axis=1)
    sample = np.zeros_like(prior)
    sample[-2:] = 4.0
    upright = np.zeros_like(prior)
    if lacking:  # rows without normals keep the prior's slope, and those above are as upright as before
        upright[12:17] = np.nan
    depth = np.exp(solved(sample, 1.0, prior, weight=1e-4, slopes=(np.zeros_like(prior), upright))) * prior
    step = 4.0 * np.log(4.0 / 3.4) / 29
    assert np.abs(depth[18:] - 4).max() < 0.02
    assert np.abs(depth[:11] - (4 - lacking * 6 * step)).max() < 0.04
    kept = np.exp(solved(sample, 1.0, prior, weight=1e-4)) * prior
    assert np.abs(kept[0] - 3.4).max() < 0.02


@pytest.mark.parametrize(("behind", "within"), [(4.0, 0.01), (2.2, 0.025)])
def test_a_jump_of_the_prior_stays_where_normals_are_alike(behind, within):
    """Two parallel walls; only the near one, at 2 m, is held."""
    prior = np.full((30, 40), 2.0)
    prior[:, 20:] = behind
    sample = np.where(prior == 2, 2.0, 0)
    none = np.zeros_like(prior)
    depth = np.exp(solved(sample, 1.0, prior, weight=0.01, slopes=(none, none))) * prior
    assert np.abs(depth / prior - 1).max() < within


def test_slopes_are_those_of_the_plane():
    rng = np.random.default_rng(0)
    focal = (60.0, 62.0)
    y, x = np.mgrid[0:30, 0:40]
    rays = np.stack([(x + 0.5 - 20) / focal[0], (y + 0.5 - 15) / focal[1], np.ones(x.shape)], axis=-1)
    for _ in range(5):
        normal = np.array([*rng.uniform(-0.6, 0.6, 2), -1.0])
        normal /= np.linalg.norm(normal)
        depth = -3.0 / (rays @ normal)
        across, down = normal_slopes(np.broadcast_to(normal, rays.shape), rays, focal)
        np.testing.assert_allclose(0.5 * (across[:, :-1] + across[:, 1:]), np.diff(np.log(depth), axis=1), atol=1e-4)
        np.testing.assert_allclose(0.5 * (down[:-1] + down[1:]), np.diff(np.log(depth), axis=0), atol=1e-4)


def said(count: int, through: int = 0, hidden: int = 0) -> GeometricConsistency:
    shape = (20, 20)
    none = np.zeros(shape)
    return GeometricConsistency(none, *(np.full(shape, number, np.uint8) for number in (count, through, hidden)), none)


def sure_of(factor: float, others: GeometricConsistency, through: float = 0.0, trust: float = 1.0) -> float:
    """Confidence in a depth of 2 m whose samples are at `factor` times that."""
    depth = np.full((20, 20), 2.0)
    sample = factor * depth if trust else np.zeros_like(depth)
    error = expected_relative_error(depth, sample, np.full_like(depth, trust), others, np.full_like(depth, through))
    return float(completed_weight(error).mean())


def test_more_consistent_views_and_no_contradiction_are_trusted_more():
    by_count = [sure_of(1.0, said(count), trust=0.0) for count in (0, 2, 7)]
    assert all(np.diff(by_count) > 0) and by_count[0] < 0.1 and by_count[-1] > 0.7
    assert sure_of(1.0, said(5)) > 0.9 and sure_of(1.2, said(5)) < 0.35
    assert sure_of(1.0, said(5), through=0.8) < 0.2


def test_samples_where_there_is_no_depth_tell_nothing_of_what_is_around():
    """A hole of the prior, in which stereo has depth."""
    depth, sample = np.full((20, 20), 2.0), np.zeros((20, 20))
    depth[:, 10:] = 0
    sample[:, :8] = 2.0
    holed = sample + 2.0 * (depth == 0)
    one, other = (
        expected_relative_error(depth, some, np.ones((20, 20)), said(5), np.zeros((20, 20)))[:, :10]
        for some in (sample, holed)
    )
    np.testing.assert_array_equal(one, other)


def test_views_that_pass_through_a_depth_count_against_it_and_views_that_cannot_see_it_hardly():
    assert sure_of(1.0, said(2)) - sure_of(1.0, said(2, through=2)) > 0.6
    assert sure_of(1.0, said(7)) > sure_of(1.0, said(7, through=2)) > sure_of(1.0, said(2, through=2)) + 0.1
    assert sure_of(1.0, said(5, hidden=3)) > 0.9 * sure_of(1.0, said(5))
    # what nobody else sees is not wrong for that; but where all others see something nearer it is
    assert sure_of(1.0, said(0)) > 0.7
    assert sure_of(1.0, said(0, hidden=6)) < 0.2


@pytest.fixture
def room_normals(box_room):
    return box_room(count=12, turn=0.3).normals


@pytest.fixture
def views(box_room):
    room = box_room(count=12, turn=0.3)
    frames: list[Frame] = room.frames
    depths = {frame.name: depth.astype(np.float32) for frame, depth in zip(frames, room.depths, strict=True)}
    return frames, depths


@pytest.fixture
def everything(complete_views):
    def run(frames, depths, points, stereo=None, residuals=None, normals=None, planes=True):
        return complete_views(frames, depths, normals or {}, points, stereo=stereo, residuals=residuals, planes=planes)

    return run


def samples_at(frames, depths, step=4) -> PointCloud:
    """Every few pixels of the depth maps as points that one photo sees."""
    xyz, frame_of, pixels = [], [], []
    for index, frame in enumerate(frames):
        y, x = (part.ravel() for part in np.mgrid[step // 2 : 60 : step, step // 2 : 80 : step])
        pixel = np.stack([x, y], axis=1) + 0.5
        xyz.append(frame.camera.unproject(pixel, depths[frame.name][y, x]))
        pixels.append(pixel)
        frame_of.append(np.full(len(pixel), index))
    names, count = tuple(frame.name for frame in frames), sum(map(len, xyz))
    tracks = Tracks(names, np.concatenate(frame_of), np.arange(count), np.concatenate(pixels).astype(np.float32))
    return PointCloud(np.concatenate(xyz), np.zeros((count, 3), np.uint8), tracks)


class Watched(LazyMaps):
    """Maps made anew each time, and the most of them that were in memory at once."""

    def __init__(self, maps):
        super().__init__()
        self.alive = self.most = 0
        for name, one in maps.items():
            self.add(name, partial(self._made, one))

    def _made(self, one):
        made = one.copy()
        self.alive += 1
        self.most = max(self.most, self.alive)
        weakref.finalize(made, self._gone)
        return made

    def _gone(self):
        self.alive -= 1


def test_of_many_views_a_few_maps_are_in_memory_at_full_size(everything, views):
    frames, depths = views
    watched = Watched(depths)
    before = _C.threads()
    try:
        _C.set_threads(2)
        found = everything(frames, watched, samples_at(frames, depths))
    finally:
        _C.set_threads(before)
    assert len(found) == len(frames) == 12 and watched.most <= 4 and watched.alive == 0


def test_a_map_that_fitted_badly_bends_more_to_its_samples(everything, views):
    frames, depths = views
    wrong = {name: (depth * 1.025).astype(np.float32) for name, depth in depths.items()}
    points = samples_at(frames, depths, step=8)
    off = []
    for misfit in (float("nan"), 0.02, 0.25):  # half at 0.1
        found = everything(frames, wrong, points, residuals={frame.name: misfit for frame in frames})
        off.append(np.median([np.median(np.abs(found[name][0] / depths[name] - 1)) for name in found]))
    assert off[2] < 0.5 * off[1] and off[0] == pytest.approx(off[1], rel=0.1)


def test_one_view_that_fitted_badly_bends_no_more_than_the_others(everything, views):
    """A single view's misfit says little where it has few points: the median over the views counts."""
    frames, depths = views
    wrong = {name: (depth * 1.025).astype(np.float32) for name, depth in depths.items()}
    points, alike = samples_at(frames, depths, step=8), {frame.name: 0.02 for frame in frames}
    plain = everything(frames, wrong, points, residuals=alike)
    outlier = everything(frames, wrong, points, residuals={**alike, frames[0].name: 5.0})
    assert all(np.array_equal(plain[name][0], outlier[name][0]) for name in depths)


def test_samples_mend_what_the_maps_have_wrong(everything, views):
    frames, depths = views
    wrong = {name: (depth * 1.04).astype(np.float32) for name, depth in depths.items()}
    found = everything(frames, wrong, samples_at(frames, depths, step=1))
    off = [np.abs(found[name][0] / depth - 1).mean() for name, depth in depths.items()]
    assert max(off) < 0.01


def test_a_map_of_noise_has_next_to_no_confidence_and_the_others_keep_theirs(everything, views):
    frames, depths = views
    bad = frames[2].name
    noise = np.random.default_rng(0).uniform(0.5, 6.0, depths[bad].shape).astype(np.float32)
    found = everything(frames, {**depths, bad: noise}, samples_at(frames, {**depths, bad: noise}, step=90))
    mean = {name: float(sure.mean()) for name, (_, sure) in found.items()}
    assert mean[bad] < 0.15
    assert np.median([value for name, value in mean.items() if name != bad]) > 3 * mean[bad]


def test_fine_stereo_stands_where_it_is_not_contradicted(everything, views):
    frames, depths = views
    name = frames[0].name
    fine = depths[name] * 1.002
    fine[:, :40] = depths[name][:, :40] * 1.5
    stereo = {name: StereoMap(fine, np.full(fine.shape, 5, np.uint8))}
    depth, _ = everything(frames, depths, samples_at(frames, depths), stereo)[name]
    inner = (slice(None), slice(45, None))
    assert np.abs(depth[inner] / fine[inner] - 1).max() < 1.2e-4
    assert np.abs(depth[:, :35] / depths[name][:, :35] - 1).max() < 0.02


def test_the_same_bits_on_one_thread_and_on_two(everything, views, room_normals):
    from room2dgs.splat import set_threads

    frames, depths = views
    points = samples_at(frames, depths)
    normals = {
        frame.name: (normal @ frame.camera.rotation).astype(np.float32)
        for frame, normal in zip(frames, room_normals, strict=True)
    }
    bits = []
    for count in (1, 2):
        set_threads(count)
        found = everything(frames, depths, points, normals=normals)
        bits.append([b"".join(part.tobytes() for part in one) for one in found.values()])
    set_threads(None)
    assert bits[0] == bits[1]
