"""A mesh's area is that of all parts that it is looked at in."""

import pytest
import trimesh

from room2dgs.mesh import area
from room2dgs.mesh.area import area_m2


def test_area_is_that_of_all_parts(monkeypatch):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.7)
    monkeypatch.setattr(area, "PART", 100)
    assert area_m2(ball.vertices, ball.faces) == pytest.approx(ball.area, rel=1e-12)
    assert area_m2(ball.vertices, ball.faces[:0]) == 0
