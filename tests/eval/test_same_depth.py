"""Whether a truth was made from the depth maps that a run used."""

from __future__ import annotations

import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.eval.same_depth import SAME_M, distance_to_truth
from room2dgs.mesh.views import FusedView


@pytest.fixture
def room(make):
    return make.file(make.room())


def seen(make, room, off_m: float = 0.0):
    """What six cameras measure of the room, too far by `off_m`."""
    for camera in make.all_around():
        depth = room.surface.seen_by(camera).t.reshape(camera.height, camera.width) + np.float32(off_m)
        yield FusedView(camera, depth, np.zeros((*depth.shape, 3), np.uint8))


@pytest.mark.parametrize(("off_m", "same"), [(0.0, True), (0.012, False), (-0.05, False)])
def test_depth_on_the_truth_is_the_same_and_a_centimetre_off_is_not(make, room, off_m, same):
    config = load_config(["scene.path=a", "out=b", "mesh.min_weight=1"]).mesh
    distance = distance_to_truth((view for _ in range(2) for view in seen(make, room, off_m)), room, config)
    assert (distance <= SAME_M) == same
    assert distance == pytest.approx(abs(off_m), abs=0.003)


def test_no_depth_is_infinitely_far(room):
    config = load_config(["scene.path=a", "out=b"]).mesh
    assert distance_to_truth([], room, config) == np.inf
