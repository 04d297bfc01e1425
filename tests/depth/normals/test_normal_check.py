"""Normals without information are found out, with no depth prior."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.depth import depth_of_frames
from room2dgs.depth.normals.planar_points import planar_normals
from room2dgs.errors import InputError


@pytest.fixture
def load(room, prior_config, map_files):
    """`load(change, **settings)`: normals alone, changed by change(normal, i); priors and what was said."""

    def run(change, points=room.points, **settings):
        lines: list[str] = []
        folder = map_files(normal=change) / "normal"
        changes = {f"normal__{key}": value for key, value in settings.items()}
        config = prior_config("prior/normal=files", normal__path=folder, **changes)
        return depth_of_frames(room.frames, points, config, lines.append), "\n".join(lines)

    return run


def facing_noise(normal, i):
    random = np.random.default_rng(i).normal(size=normal.shape)
    random /= np.linalg.norm(random, axis=-1, keepdims=True)
    return random * -np.sign(random[..., 2:])


def test_noise_that_faces_the_camera_is_left_out_loudly(load):
    priors, said = load(facing_noise)
    assert not priors.by_frame
    assert "WARNING: the normals carry no information, views of the same points do not agree" in said
    assert "left out; prior.normal.check=false" in said


def test_noise_is_used_all_the_same_if_asked_for(load):
    priors, said = load(facing_noise, check="false")
    assert len(priors.by_frame) == 6
    assert "WARNING: the normals carry no information" in said and "used all the same" in said


def test_rough_normals_are_kept(load):
    def rough(normal, i):
        turned = normal + 0.6 * np.random.default_rng(i).normal(size=normal.shape) / np.sqrt(3)
        return turned / np.linalg.norm(turned, axis=-1, keepdims=True)

    priors, said = load(rough)
    assert len(priors.by_frame) == 6 and "WARNING" not in said


def test_normals_that_just_face_the_camera_are_warned_about(load):
    _, said = load(lambda normal, i: np.broadcast_to([0.0, 0.0, -1.0], normal.shape))
    assert "WARNING" in said


@pytest.mark.parametrize("axes", ["ldf", "ruf", "rdb", "luf"])
def test_any_negated_axis_is_noticed_without_depth(load, axes):
    signs = np.array([{"r": 1, "l": -1, "d": 1, "u": -1, "f": 1, "b": -1}[letter] for letter in axes])
    with pytest.raises(InputError, match="another convention") as refused:
        load(lambda normal, i: normal * signs)
    # the same thing may have two names
    names = {"ldf": "axes=opengl prior.normal.facing=away", "ruf": "axes=ruf", "rdb": "axes=rdb"}
    assert f"prior.normal.{names.get(axes, 'axes=rdb prior.normal.facing=away')} fits best" in str(refused.value)


def test_few_points_leave_good_normals_alone(load, room):
    few = PointCloud(room.points.xyz[:5], room.points.rgb[:5])
    priors, said = load(lambda normal, i: normal, points=few)
    assert len(priors.by_frame) == 6 and "WARNING" not in said


def test_planes_have_normals_and_clutter_has_none():
    rng = np.random.default_rng(0)
    wall = np.column_stack([rng.uniform(0, 2, (400, 2)), rng.normal(1.0, 0.002, 400)])
    clutter = rng.uniform(5, 6, (400, 3))
    line = np.column_stack([np.linspace(9, 12, 60), np.full(60, 3.0), rng.normal(0, 1e-4, 60)])
    cloud = np.concatenate([wall, clutter, line])
    order = rng.permutation(len(cloud))
    normals = np.empty_like(cloud)
    normals[order] = planar_normals(cloud, order)
    known = normals.any(axis=1)
    assert known[:400].mean() > 0.95 and known[400:800].mean() < 0.3 and not known[800:].any()
    assert np.abs(normals[:400][known[:400], 2]).min() > 0.99
    assert not planar_normals(wall[:10], np.arange(10)).any()
