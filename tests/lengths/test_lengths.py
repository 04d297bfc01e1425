"""Lengths between places whose errors are known, and what their deviations are made of."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.errors import InputError
from room2dgs.lengths.between import plane_to_plane, point_to_plane, point_to_point
from room2dgs.lengths.correlation import SHARED, mean_sigma
from room2dgs.lengths.length import Length
from room2dgs.lengths.plane_sigma import Faces, PlaneSigma, plane_sigma
from room2dgs.lengths.scale import GIVEN_SIGMA, LENGTH_SIGMA, scale_trust
from room2dgs.lengths.surface import FoundPlane, MeasuredMesh, Spot
from room2dgs.lengths.surface_error import UNSEEN_M, expected_errors
from room2dgs.lengths.targets import length_of, target_of
from room2dgs.mesh.io import read_mesh, write_mesh

numbers = st.floats(-1e4, 1e4).map(lambda value: round(value, 4))


def wall_faces(width: float, height: float, step: float, sigma_m: float) -> Faces:
    """A wall in the plane y = 0, facing +y."""
    x, z = np.meshgrid(np.arange(step / 2, width, step), np.arange(step / 2, height, step))
    middle = np.column_stack([x.ravel(), 0 * x.ravel(), z.ravel()])
    return Faces(
        middle, np.tile([0, 1.0, 0], (len(middle), 1)), np.full(len(middle), step**2), np.full(len(middle), sigma_m)
    )


@given(numbers, numbers, numbers, st.booleans())
def test_a_point_is_read_as_it_was_typed(x, y, z, plane):
    target = target_of(f"{'plane@' if plane else ''}{x},{y},{z}")
    np.testing.assert_array_equal(target.point, [x, y, z])
    assert target.plane == plane and not target.name


def test_pixels_and_names_are_told_from_points():
    pixel = target_of("plane@000012.jpg:210,145.5")
    assert pixel.photo == "000012.jpg" and pixel.plane and list(pixel.pixel) == [210, 145.5]
    assert target_of("a:b:1,2").photo == "a:b"
    assert target_of("wall_12").name == "wall_12" and target_of("floor").plane
    for text in ("wall_", "1,2", "1,2,3,4", "1,2,nan", "1e400,0,0", ":1,2", "", "x,y,z"):
        with pytest.raises(InputError, match=r"nothing to measure|no room has"):
            target_of(text)


def test_a_known_length_and_its_deviation():
    assert length_of("2.04", "length") == (2.04, None)
    assert length_of("2.04+-0.005", "length") == length_of("2.04±0.005", "length") == (2.04, 0.005)
    for text in ("0", "-1", "nan", "inf", "2+-", "2+-3", "two"):
        with pytest.raises(InputError, match="no length"):
            length_of(text, "length")


def test_a_thousand_pixels_are_not_a_thousand_words():
    """The deviation of a wall's plane does not shrink with the number of faces, and never below what all share."""
    coarse = plane_sigma(wall_faces(4, 2.5, 0.05, 0.01), np.array([0, 1.0, 0]), 0.0)
    fine = plane_sigma(wall_faces(4, 2.5, 0.01, 0.01), np.array([0, 1.0, 0]), 0.0)
    assert fine.surface_m == pytest.approx(coarse.surface_m, rel=0.02)
    assert 0.01 * np.sqrt(SHARED) < fine.surface_m < 0.01
    assert fine.fit_m == 0 and fine.area_m2 == pytest.approx(10)
    small = plane_sigma(wall_faces(0.5, 0.5, 0.01, 0.01), np.array([0, 1.0, 0]), 0.0)
    apart = [one.surface_m**2 - SHARED * 0.01**2 for one in (small, fine)]  # what is not shared becomes less with size
    assert apart[0] > 4 * apart[1]


def test_the_deviation_of_a_mean_is_that_of_correlated_values():
    """Against drawn values with the very correlation."""
    rng = np.random.default_rng(0)
    place, sigma = rng.uniform(0, 2, (12, 3)), rng.uniform(0.001, 0.02, 12)
    weight = rng.uniform(0.1, 1, 12)
    from room2dgs.lengths.correlation import correlation

    drawn = rng.multivariate_normal(np.zeros(12), correlation(place) * np.outer(sigma, sigma), 40_000)
    assert mean_sigma(place, sigma, weight) == pytest.approx(np.std(drawn @ (weight / weight.sum())), rel=0.02)


def test_an_uneven_wall_has_a_fit_part():
    faces = wall_faces(4, 2.5, 0.05, 0.001)
    faces.middle[:, 1] = 0.01 * np.sin(faces.middle[:, 0] * 3)
    assert plane_sigma(faces, np.array([0, 1.0, 0]), 0.0).fit_m > 0.002


def test_between_two_planes_all_parts_are_counted_once():
    one = FoundPlane(np.array([1.0, 0, 0]), 0.0, np.zeros(3), PlaneSigma(0.003, 0.001, 4.0), "wall_1")
    other = FoundPlane(np.array([-1.0, 0, 0]), -4.0, np.array([4.0, 0, 0]), PlaneSigma(0.004, 0.002, 6.0), "wall_2")
    length = plane_to_plane(one, other, 0.005)
    assert length.value == pytest.approx(4.0)
    assert length.surface_m == pytest.approx(0.005) and length.scale_m == pytest.approx(0.02)
    assert length.sigma == pytest.approx(np.sqrt(0.005**2 + 0.001**2 + 0.002**2 + 0.02**2))
    assert "wall_1 (4.0 m²" in length.rests_on
    tilted = FoundPlane(np.array([0, 1.0, 0]), 0.0, np.zeros(3), PlaneSigma(0, 0, 1), "floor")
    with pytest.raises(InputError, match="90 degrees from parallel"):
        plane_to_plane(one, tilted, 0.0)


def test_an_error_across_the_line_is_none_along_it():
    """Two points on one wall: its error moves both alike; across from each other, both errors count."""
    up = np.array([0, 0, 1.0])
    on_floor = [Spot(np.array([x, 0, 0.0]), up, 0.01) for x in (0.0, 2.0)]
    assert point_to_point(*on_floor, 0.0, 0.01).surface_m == 0
    assert point_to_point(*on_floor, 0.0, 0.01).fit_m == pytest.approx(np.sqrt(2) * 0.005)
    ceiling = Spot(np.array([0, 0, 2.5]), -up, 0.02)
    length = point_to_point(on_floor[0], ceiling, 0.0, 0.01)
    assert length.value == 2.5 and length.surface_m == pytest.approx(np.hypot(0.01, 0.02)) and length.fit_m == 0
    floor = FoundPlane(up, 0.0, np.zeros(3), PlaneSigma(0.003, 0, 5), "floor")
    assert point_to_plane(ceiling, floor, 0.0).surface_m == pytest.approx(np.hypot(0.003, 0.02))
    with pytest.raises(InputError, match="the same"):
        point_to_point(ceiling, ceiling, 0.0, 0.01)


def test_the_plane_around_a_point_leaves_out_what_stands_before_it():
    table = trimesh.creation.box(extents=(1.2, 0.8, 0.04)).subdivide_to_size(0.08)
    table.apply_translation((0, 0, 0.73))
    vase = trimesh.creation.box(extents=(0.2, 0.2, 0.3)).subdivide_to_size(0.08)
    vase.apply_translation((0.3, 0, 0.9))
    mesh = trimesh.util.concatenate([table, vase])
    surface = MeasuredMesh(mesh, np.full(len(mesh.faces), 0.002), 0.01)
    plane = surface.plane_around(surface.nearest(np.array([-0.2, 0.1, 0.75]), "the table"), "the table")
    assert plane.offset_m == pytest.approx(0.75, abs=1e-6) and plane.normal[2] == pytest.approx(1, abs=1e-6)
    with pytest.raises(InputError, match="off the mesh"):
        surface.nearest(np.array([0, 0, 2.0]), "0,0,2")


def test_the_plane_around_a_point_lies_where_its_faces_are_surest():
    up = np.array([0, 0, 1.0])
    board = trimesh.creation.box(extents=(1.0, 0.8, 0.02)).subdivide_to_size(0.05)
    raised = (np.abs(board.vertices[:, 0]) > 0.2) & (board.vertices[:, 2] > 0)
    board.vertices[raised, 2] += 0.01
    sigma = np.where(np.abs(board.triangles_center[:, 0]) > 0.2, 0.02, 0.002)
    at = Spot(np.array([0, 0, 0.01]), up, 0.002)
    plane, even = (
        MeasuredMesh(board, one, 0.01).plane_around(at, "the board") for one in (sigma, np.full(len(sigma), 0.01))
    )
    assert plane.offset_m == pytest.approx(0.01, abs=1e-3) and even.offset_m > 0.015


def test_the_scale_says_where_it_comes_from():
    assert scale_trust(True, {"source": "capture"}, None).sigma == GIVEN_SIGMA
    assert scale_trust(True, {"source": "capture"}, None, 0.0).sigma == 0
    assert scale_trust(True, {"source": "scene.unit", "metres": 0.5}, None).words.startswith("scene.unit=0.5")
    network = scale_trust(True, {"source": "depth prior", "sigma": 0.3, "metres": 2.0}, None)
    assert network.sigma == 0.3 and "network" in network.words
    assert (
        scale_trust(True, {"source": "known length", "sigma": 0.002}, {"source": "network", "sigma": 0.3}).sigma
        == 0.002
    )
    assert scale_trust(True, None, {"source": "length", "sigma": None, "words": "x"}).sigma == LENGTH_SIGMA
    unknown = scale_trust(False, {"source": "assumed", "metres": 1.0}, None)
    assert not unknown.known and unknown.unit == "units"
    assert Length(4.0, 0.01, 0, 0, "").text(unknown.unit) == "4 ± 0.01 units"


def test_the_mesh_s_own_errors_are_read(tmp_path):
    mesh = trimesh.creation.box()
    mesh.vertex_attributes["expected_error"] = np.linspace(0.001, 0.008, 8, dtype=np.float32)
    mesh.vertex_attributes["expected_error"][3] = np.nan
    write_mesh(tmp_path / "mesh.ply", mesh)
    found = expected_errors(read_mesh(tmp_path / "mesh.ply"))
    known = np.linspace(0.001, 0.008, 8)
    known[3] = UNSEEN_M
    np.testing.assert_allclose(found, known[mesh.faces].mean(axis=1), rtol=1e-6)
    assert expected_errors(trimesh.creation.box()) is None
