"""What lies beyond a mesh's boundary, by what views have seen."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from room2dgs.eval.boundary import open_boundary
from room2dgs.eval.boundary_kinds import FREE, NAMES, NOT_SEEN, NOT_TRUSTED, judged
from room2dgs.eval.sightlines import Sightlines, sightlines
from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera

WIDTH, HEIGHT = 160, 120


def camera() -> Camera:
    K = np.array([[120.0, 0, WIDTH / 2], [0, 120.0, HEIGHT / 2], [0, 0, 1]])
    return Camera(K, WIDTH, HEIGHT, np.eye(4))


def square(z: float = 2.0, half: float = 0.4) -> trimesh.Trimesh:
    corners = [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]]
    return trimesh.Trimesh(corners, [[0, 2, 1], [0, 3, 2]], process=False)


def view(depth: np.ndarray | float, *before: trimesh.Trimesh) -> Sightlines:
    mesh = trimesh.util.concatenate([square(), *before]) if before else square()
    return sightlines(camera(), Surface(mesh), (np.full((HEIGHT, WIDTH), depth, np.float32),))


def kinds(*views: Sightlines) -> np.ndarray:
    mesh = square()
    found = judged(open_boundary(mesh.vertices, np.asarray(mesh.faces, np.int64)), views)
    assert sum(found.metres.values()) == pytest.approx(3.2) and tuple(found.metres) == NAMES
    return found.kind


@pytest.mark.parametrize(
    ("depth", "before", "kind"),
    [
        (4.0, (), FREE),  # the wall behind is seen past the square's edge
        (2.0, (), NOT_TRUSTED),  # a depth there goes on, and the mesh does not
        (0.0, (), NOT_TRUSTED),  # nobody knows the depth there
        (1.0, (), NOT_SEEN),  # something in front hides it
        (0.0, (square(1.0, 0.45),), NOT_SEEN),  # the mesh itself does
    ],
)
def test_a_boundary_is_of_the_kind_that_views_tell(depth, before, kind):
    assert (kinds(*[view(depth, *before)] * 3) == kind).all()
    assert (kinds(*[view(depth, *before)] * 2) == (FREE if kind == FREE else NOT_SEEN)).all()  # two are few


def test_more_views_that_see_through_than_surface_make_it_free():
    through, surface = view(4.0), view(2.0)
    assert (kinds(through, through, surface) == FREE).all()
    assert (kinds(through, surface, surface) == NOT_TRUSTED).all()


def test_each_side_has_its_own_kind():
    depth = np.zeros((HEIGHT, WIDTH), np.float32)
    depth[:, : WIDTH // 2] = 4.0
    mesh = square()
    boundary = open_boundary(mesh.vertices, np.asarray(mesh.faces, np.int64))
    kind = judged(boundary, [view(depth)] * 3).kind
    left, right = boundary.middle[:, 0] < -0.39, boundary.middle[:, 0] > 0.39
    assert left.any() and (kind[left] == FREE).all() and (kind[right] == NOT_TRUSTED).all()


def test_a_closed_mesh_has_none():
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    found = judged(open_boundary(box.vertices, np.asarray(box.faces, np.int64)), [view(4.0)])
    assert not len(found.kind) and found.metres == dict.fromkeys(NAMES, 0.0)
