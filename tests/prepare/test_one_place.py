"""Whom `prepare` tells to walk: who only turned, and nobody else."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.colmap import pycolmap
from room2dgs.prepare.one_place import FLAT, TURNED, walked, why_no_parallax, why_small_angles
from room2dgs.sfm.one_place import WALK


def pairs(kind_of, count: int = 12, reach: int = 6) -> dict[tuple[int, int], tuple[int, str]]:
    """Pairs of photos up to `reach` apart; `kind_of` tells a pair's kind by how far apart they are."""
    return {(i, i + k): (80, kind_of(k)) for k in range(1, reach + 1) for i in range(count - k)}


def test_who_only_turned_is_told_to_walk():
    assert WALK in why_no_parallax("v.mp4", pairs(lambda apart: TURNED))
    said = why_no_parallax("v.mp4", pairs(lambda apart: TURNED if apart % 2 else FLAT))
    assert WALK not in said and "one flat wall" in said


def test_a_slow_walk_whose_neighbours_have_no_parallax_is_no_turn():
    slow = pairs(lambda apart: TURNED if apart < 5 else "CALIBRATED")
    assert sum(kind == TURNED for _, kind in slow.values()) > len(slow) / 2
    assert why_no_parallax("v.mp4", slow) is None


def test_pairs_with_hardly_any_match_tell_nothing():
    turn = pairs(lambda apart: TURNED)
    turn |= {(i, i + 9): (5, "CALIBRATED") for i in range(3)}
    assert WALK in why_no_parallax("v.mp4", turn)


def rebuilt(apart: float) -> pycolmap.Reconstruction:
    """Six cameras along a line in front of points 3 to 4 units away."""
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_frames_per_rig, options.num_points3D = 1, 6, 60
    model = pycolmap.synthesize_dataset(options)
    random = np.random.default_rng(3)
    for number, image_id in enumerate(model.reg_image_ids()):
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(), np.array([-apart * number / 5, 0, 0]))
        model.image(image_id).frame.rig_from_world = pose
    for point in model.points3D.values():
        point.xyz = random.uniform((-1, -1, 3), (1, 1, 4))
    return model


@pytest.mark.parametrize(("apart", "one"), [(0.0, False), (0.02, False), (0.5, True)])
def test_cameras_of_a_reconstruction_walked_beside_the_distance_of_its_points(apart, one):
    assert walked(rebuilt(apart)) == one
    assert walked(scaled(rebuilt(apart), 40.0)) == one


def scaled(model: pycolmap.Reconstruction, by: float) -> pycolmap.Reconstruction:
    model.transform(pycolmap.Sim3d(by, pycolmap.Rotation3d(), np.zeros(3)))
    return model


def test_small_angles_of_a_walk_are_not_called_one_place():
    assert WALK in why_small_angles("v.mp4", 0.4, False)
    said = why_small_angles("v.mp4", 1.2, True)
    assert WALK not in said and "was taken from one place" not in said and "1.2 degrees" in said
