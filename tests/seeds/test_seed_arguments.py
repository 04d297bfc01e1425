"""What seeds are made of: a result or a sentence."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.seeds.neighbourhood import local_normals, spacing
from room2dgs.seeds.prune import transparent
from room2dgs.seeds.seeds import seed_points
from room2dgs.seeds.spawn import spawn
from room2dgs.seeds.voxelise import cell_keys, voxelise

POINTS = np.random.default_rng(0).uniform(0, 1, (60, 3))
COLOURS = np.full((60, 3), 128, np.uint8)
CONFIG = load_config(["scene.path=room", "out=run"]).seeds
CENTRES = np.array([[0.5, 0.5, -2.0]])
NOT_POINTS = (None, "x", POINTS.ravel(), POINTS[:, :2], POINTS.astype(object), POINTS > 0.5, POINTS[None])
WITH_NAN = np.where(np.arange(180).reshape(60, 3) == 7, np.nan, POINTS)
DOORS = {
    "cell_keys": lambda points: cell_keys(points, 0.1),
    "voxelise": lambda points: voxelise(points, COLOURS, 0.1),
    "seed_points": lambda points: seed_points(points, COLOURS, CENTRES, CONFIG),
    "local_normals": lambda points: local_normals(points, POINTS[:5], 8, CENTRES[0]),
    "local_normals at": lambda points: local_normals(POINTS, points, 8, CENTRES[0]),
    "spacing": lambda points: spacing(points, 0.01, 0.5),
}


@pytest.mark.parametrize("door", DOORS)
def test_what_are_no_points_is_refused(door):
    assert DOORS[door](POINTS) is not None and DOORS[door](POINTS.tolist()) is not None
    for points in NOT_POINTS:
        with pytest.raises((TypeError, ValueError)):
            DOORS[door](points)
    with pytest.raises((InputError, ValueError), match="finite"):
        DOORS[door](WITH_NAN)


def test_colours_and_cameras_are_of_the_points():
    for colours in (COLOURS[:-1], COLOURS[:, :2], None):
        with pytest.raises((TypeError, ValueError)):
            voxelise(POINTS, colours, 0.1)
        with pytest.raises((TypeError, ValueError)):
            seed_points(POINTS, colours, CENTRES, CONFIG)
    for centres in (CENTRES[0], CENTRES[:0], CENTRES * np.nan, None):
        with pytest.raises((TypeError, ValueError)):
            seed_points(POINTS, COLOURS, centres, CONFIG)


@pytest.mark.parametrize("edge", [0, -1.0, float("nan"), "1", None])
def test_lengths_are_above_zero(edge):
    for run in (lambda: cell_keys(POINTS, edge), lambda: voxelise(POINTS, COLOURS, edge),
                lambda: spacing(POINTS, 0.01, edge)):  # fmt: skip
        with pytest.raises((TypeError, ValueError), match=r"voxel_m|high_m"):
            run()


@pytest.mark.parametrize("count", [0, -1, 2.5, "3", None, True])
def test_numbers_are_whole(count):
    seeds = seed_points(POINTS, COLOURS, CENTRES, CONFIG)
    assert spawn(seeds, 2, 0.5, 0).offsets.shape == (len(seeds), 2, 3)
    with pytest.raises((TypeError, ValueError), match="per_seed"):
        spawn(seeds, count, 0.5, 0)
    with pytest.raises((TypeError, ValueError), match="neighbours"):
        local_normals(POINTS, POINTS, count, CENTRES[0])


def test_opacities_are_of_surfels():
    assert transparent(np.array([[0.1, 0.6], [0.1, 0.2]]), 0.5).tolist() == [False, True]
    for opacities in (np.zeros(4), np.zeros((4, 0))):
        with pytest.raises(ValueError, match="opacities"):
            transparent(opacities, 0.5)
