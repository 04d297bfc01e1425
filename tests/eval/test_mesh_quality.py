"""Tears, coverage, roughness, sharpness and free space on made meshes, whose figures are known."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.eval.boundary import open_boundary, pieces, sides
from room2dgs.eval.mesh_quality import KnownView, measure
from room2dgs.eval.patches import heights, residuals, slopes
from room2dgs.eval.sightlines import ray_depth
from room2dgs.eval.surface import Surface

PLACES = ((0, 0, 0), (0.3, 0.2, -0.2), (-0.4, 0.1, 0.2))


@pytest.fixture
def seen_from_inside(make):
    """Three places of six cameras each; with the depth of a surface if one is given."""

    def views(known=None):
        cameras = [camera for place in PLACES for camera in make.all_around(place)]
        surface = None if known is None else Surface(known)
        return [KnownView(one, () if surface is None else (ray_depth(surface, one),)) for one in cameras]

    return views


def without(mesh, dropped):
    return trimesh.Trimesh(mesh.vertices, np.asarray(mesh.faces)[~dropped], process=False)


def middles(mesh):
    return np.asarray(mesh.triangles).mean(axis=1)


def holed(make, spacing=0.05, low=(-0.5, -0.25), high=(0.5, 0.25)):
    """A room with a rectangle cut out of its floor, and the length around it."""
    mesh = make.room(spacing=spacing)
    x, y, z = middles(mesh).T
    dropped = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]) & (z < -1.2)
    return without(mesh, dropped), 2 * (high[0] - low[0] + high[1] - low[1])


def test_a_closed_room_has_no_tears_and_covers_everything(make, seen_from_inside):
    figures = measure(make.room(spacing=0.25), seen_from_inside()).figures
    assert figures["tears_m"] == figures["boundary_m"] == 0
    assert not any(figures["holes"].values())
    assert figures["pieces"] == 1
    assert figures["islands"] == 0
    assert figures["coverage"] == 1
    assert figures["coverage_known"] is figures["in_free_space"] is None  # nothing is known
    assert measure(make.room(), seen_from_inside(make.room())).figures["in_free_space"] == 0
    assert figures["seen_m2"] == pytest.approx(2 * (12 + 7.5 + 10), rel=1e-6)
    assert figures["roughness_2cm_deg"] == pytest.approx(0, abs=0.01)


def test_a_cut_hole_is_as_long_as_its_rim_whatever_is_known(make, seen_from_inside):
    mesh, around = holed(make)
    for known in (None, make.room()):
        figures = measure(mesh, seen_from_inside(known)).figures
        assert figures["tears_m"] == pytest.approx(around)
        assert figures["tears_per_m"] == pytest.approx(around / figures["seen_m2"])
        assert figures["holes"] == {"under_3cm": 0, "3_to_10cm": 0, "10_to_30cm": 0, "over_30cm": 1}


def test_holes_are_told_apart_by_size_and_two_that_touch_in_a_corner_are_one(make, seen_from_inside):
    mesh = make.room(spacing=0.05)
    x, y, z = middles(mesh).T
    floor = z < -1.2
    small = floor & (np.abs(x - 0.775) < 0.03) & (np.abs(y - 0.775) < 0.03)
    touching = floor & (((x > 0) & (x < 0.1) & (y > 0) & (y < 0.1)) | ((x < 0) & (x > -0.1) & (y < 0) & (y > -0.1)))
    figures = measure(without(mesh, small | touching), seen_from_inside(make.room())).figures
    assert figures["holes"] == {"under_3cm": 0, "3_to_10cm": 1, "10_to_30cm": 1, "over_30cm": 0}
    assert figures["tears_m"] == pytest.approx(0.2 + 2 * 0.4)


def test_a_real_edge_is_no_tear_if_views_see_past_it(make, seen_from_inside):
    table = make.quad((-0.4, -0.4, -0.7), (0.8, 0, 0), (0, 0.8, 0), 16)
    mesh = make.join(make.room(spacing=0.25), table)
    figures = measure(mesh, seen_from_inside(mesh)).figures
    assert figures["tears_m"] == 0
    assert figures["boundary_m"] == pytest.approx(4 * 0.8)
    assert not any(figures["holes"].values())
    # where no depth is known, nothing says that the table ends there
    assert measure(mesh, seen_from_inside()).figures["tears_m"] == pytest.approx(4 * 0.8)


def test_boundary_where_no_view_looks_is_no_tear(make, seen_from_inside):
    shelf = make.quad((-2.5, -2, -1.1), (5, 0, 0), (0, 4, 0))  # hides the floor and its hole
    mesh, _ = holed(make)
    assert measure(make.join(mesh, shelf), seen_from_inside()).figures["tears_m"] == 0


def test_a_flake_is_a_piece_in_free_space_and_tears_nothing(make, seen_from_inside):
    flake = make.quad((0.8, 0.8, -0.5), (0.2, 0, 0), (0, 0.2, 0.1), 4)
    mesh = make.join(make.room(spacing=0.25), flake)
    figures = measure(mesh, seen_from_inside(make.room())).figures
    area = 0.2 * np.hypot(0.2, 0.1)
    assert figures["pieces"] == 2
    assert figures["islands"] == pytest.approx(area / (59 + area), rel=1e-6)
    assert figures["in_free_space_m2"] == pytest.approx(area, rel=0.1)
    assert figures["tears_m"] == 0
    assert figures["coverage"] == 1


def test_a_ray_through_a_hole_onto_something_behind_is_not_covered(make, seen_from_inside):
    mesh, _ = holed(make)
    cellar = make.quad((-3, -3, -3), (6, 0, 0), (0, 6, 0))
    through = measure(make.join(mesh, cellar), seen_from_inside(make.room())).figures
    open_ = measure(mesh, seen_from_inside(make.room())).figures
    assert through["coverage_known"] == open_["coverage_known"] < 1
    assert measure(make.join(mesh, cellar), seen_from_inside()).figures["coverage"] == 1


def test_pixels_that_a_mask_excludes_do_not_count(make):
    half = make.walls()["east"]
    camera = make.camera_at((0, 0, 0), (1, 0, 0))
    mask = np.zeros((160, 160), bool)
    mask[60:100, 60:100] = True
    assert measure(half, [KnownView(camera, usable=mask)] * 3).figures["coverage"] == 1
    assert measure(half, [KnownView(camera)] * 3).figures["coverage"] < 0.6


def test_roughness_is_that_of_a_known_wave(make, seen_from_inside):
    """Waves along x of amplitude a and length l: over a square of size s the slope is that of the least-squares line
    through three points, so its amplitude is 2 a sin(pi s / l) / s."""
    amplitude, length = 0.001, 0.2
    mesh = make.room(spacing=0.01)
    vertices = np.array(mesh.vertices)
    floor = vertices[:, 2] < -1.249
    vertices[floor, 2] += amplitude * np.sin(2 * np.pi * vertices[floor, 0] / length)
    mesh = trimesh.Trimesh(vertices, mesh.faces, process=False)
    figures = measure(mesh, seen_from_inside(make.room()), truth=make.walls()["floor"]).figures
    for size in (0.02, 0.10):
        slope = 2 * amplitude * np.sin(np.pi * size / length) / size
        expected = np.degrees(slope / np.sqrt(2))
        assert figures[f"roughness_{size * 100:g}cm_deg"] == pytest.approx(expected, rel=0.03)


def test_roughness_of_noise_falls_with_the_square_it_is_taken_over(make, seen_from_inside):
    rng = np.random.default_rng(0)
    mesh = make.room(spacing=0.02)
    mesh.vertices = np.asarray(mesh.vertices) + rng.normal(0, 0.001, mesh.vertices.shape)
    figures = measure(mesh, seen_from_inside(make.room())).figures
    assert figures["roughness_2cm_deg"] > 3 * figures["roughness_10cm_deg"] > 0
    # planes found in the mesh itself tell nearly the same as the true ones
    true = measure(mesh, seen_from_inside(make.room()), truth=make.room()).figures
    assert figures["roughness_2cm_deg"] == pytest.approx(true["roughness_2cm_deg"], rel=0.1)


def test_a_blunt_crease_is_less_sharp_and_a_flat_truth_has_none(make, seen_from_inside):
    truth = make.room(spacing=0.1)
    sharp = measure(truth, seen_from_inside(truth), truth).figures
    assert sharp["crease_error_m"] == pytest.approx(0, abs=1e-5)
    blunt = make.room(spacing=0.02)
    low = np.abs(np.asarray(blunt.vertices)) > np.array(make.SIZE) / 2 - 1e-6
    blunt = without(blunt, (low.sum(axis=1) >= 2)[np.asarray(blunt.faces)].any(axis=1))
    figures = measure(blunt, seen_from_inside(truth), truth).figures
    assert 0.002 < figures["crease_error_m"] < 0.02
    flat = measure(truth, seen_from_inside(truth), make.walls()["floor"]).figures
    assert flat["crease_error_m"] is None


def test_twice_is_the_same(make, seen_from_inside):
    mesh, _ = holed(make)
    first, second = (measure(mesh, seen_from_inside(make.room()), make.room()).figures for _ in range(2))
    assert {**first, "quality_seconds": 0} == {**second, "quality_seconds": 0}


def test_a_mesh_without_faces_covers_nothing(make, seen_from_inside):
    figures = measure(trimesh.Trimesh(), seen_from_inside(make.room()), make.room()).figures
    assert figures["coverage"] == figures["coverage_known"] == 0
    assert figures["tears_per_m"] is figures["roughness_2cm_deg"] is None
    assert figures["pieces"] == 0


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.1, 0.9))
def test_boundary_is_that_of_trimesh(seed, share):
    mesh = trimesh.creation.icosphere(subdivisions=2)
    kept = np.random.default_rng(seed).random(len(mesh.faces)) < share
    faces = np.asarray(mesh.faces)[kept]
    found = open_boundary(np.asarray(mesh.vertices), faces)
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    ends = mesh.vertices[unique[count == 1]]
    assert found.length.sum() == pytest.approx(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())
    part = trimesh.Trimesh(mesh.vertices, faces, process=False)
    expected = trimesh.graph.connected_components(part.face_adjacency, nodes=np.arange(len(faces)))
    assert pieces(faces, sides(faces)).max(initial=-1) + 1 == len(expected)
    # each loop is closed: its ends come in pairs
    for loop in range(found.loop.max(initial=-1) + 1):
        points = np.round(found.ends[found.loop == loop].reshape(-1, 3), 9)
        assert (np.unique(points, axis=0, return_counts=True)[1] % 2 == 0).all()


@settings(max_examples=20, deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.integers(0, 2**31))
def test_heights_of_a_tilted_plane_have_its_slope(a, b, seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    point = rng.normal(size=3)
    axes = np.linalg.svd(normal[None])[2][1:]
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.2
    lifted = corners @ axes + (corners @ [a, b])[:, None] * normal + point
    surface = Surface(trimesh.Trimesh(lifted, [[0, 1, 2], [0, 2, 3]], process=False))
    height = heights(surface, point[None], normal[None], 0.1, 5, 0.05)
    middle, right, up = slopes(height, 0.1)
    assert middle == pytest.approx(0, abs=1e-5)
    assert np.hypot(right, up) == pytest.approx(np.hypot(a, b), abs=1e-3)
    assert np.abs(residuals(height, 0.1)).max() < 1e-5
