"""What public functions on meshes are given: a result or a sentence, never an address that is not theirs."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from room2dgs.config import load_config
from room2dgs.mesh.area import area_m2, twice_areas
from room2dgs.mesh.clean import clean
from room2dgs.mesh.contracted import contracted, expanded
from room2dgs.mesh.decimation import decimation
from room2dgs.mesh.edges import edges_and_faces, is_closed
from room2dgs.mesh.fill import holes_filled, watertight
from room2dgs.mesh.finish import cleaned, finished
from room2dgs.mesh.simplify import Measure, colors_at, decimated, measured, simplified
from room2dgs.mesh.smooth import smoothed

BALL = trimesh.creation.icosphere(2)
VERTICES, FACES = np.array(BALL.vertices), np.array(BALL.faces)


def ball(vertices: np.ndarray = VERTICES, faces: np.ndarray = FACES, **options) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False, **options)


def changed(values: np.ndarray, value: float) -> np.ndarray:
    values = values.copy()
    values[5, 1] = value
    return values


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    folder = tmp_path_factory.mktemp("config")
    return replace(load_config([f"scene.path={folder}", f"out={folder / 'out'}"]).mesh, voxel_m=0.1)


@pytest.fixture(params=["clean", "smoothed", "holes_filled", "watertight", "decimation", "simplified", "decimated",
                        "decimated by open3d", "measured", "measured against", "Measure", "colors_at", "cleaned",
                        "finished"])  # fmt: skip
def door(request, config):
    """A public function of a mesh alone."""
    return {
        "clean": clean,
        "smoothed": lambda mesh: smoothed(mesh, 1),
        "holes_filled": lambda mesh: holes_filled(mesh, 0.2),
        "watertight": lambda mesh: watertight(mesh, 0.3),
        "decimation": lambda mesh: decimation(mesh, 0.05),
        "simplified": lambda mesh: simplified(mesh, 100),
        "decimated": lambda mesh: decimated(mesh, 100),
        "decimated by open3d": lambda mesh: decimated(mesh, 100, careful=True),
        "measured": lambda mesh: measured(mesh, ball()),
        "measured against": lambda mesh: measured(ball(), mesh),
        "Measure": Measure,
        "colors_at": lambda mesh: colors_at(mesh, VERTICES),
        "cleaned": lambda mesh: cleaned(mesh, config, lambda _: None),
        "finished": lambda mesh: finished(mesh, config, lambda _: None),
    }[request.param]


@pytest.mark.parametrize("vertex", [len(VERTICES), 2**31 + 5, 2**62, -1, -(10**9)])
def test_faces_that_name_vertices_which_are_not_there_are_refused(door, vertex):
    with pytest.raises(ValueError, match="faces name vertices"):
        door(ball(faces=changed(FACES, vertex)))


@pytest.mark.parametrize("what", [None, "mesh", VERTICES, [VERTICES, FACES], trimesh.PointCloud(VERTICES),
                                  trimesh.Scene(BALL)], ids=lambda what: type(what).__name__)  # fmt: skip
def test_what_is_no_mesh_is_refused(door, what):
    with pytest.raises(TypeError, match=r"trimesh\.Trimesh"):
        door(what)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e200])
def test_vertices_that_cannot_be_are_refused_or_dropped(door, value):
    try:
        found = door(ball(changed(VERTICES, value)))
    except ValueError as error:
        assert "NaN, infinite or farther" in str(error)
    else:  # cleaning drops what is not finite
        assert np.isfinite(found.vertices).all() and len(found.faces) <= len(FACES)


@pytest.mark.parametrize("mesh", [trimesh.Trimesh(process=False), ball(faces=np.zeros((0, 3), int)),
                                  ball(VERTICES * 0), ball(VERTICES * [1, 0, 0])])  # fmt: skip
def test_a_mesh_without_a_surface_is_no_accident(door, mesh):
    try:
        door(mesh)
    except ValueError as error:
        assert any(words in str(error) for words in ("no faces", "no colours", "no size", "fewer than"))


def test_good_meshes_come_through(door):
    door(ball(vertex_colors=np.full((len(VERTICES), 4), 200, np.uint8)))


NUMBERS = (-1, 1.5, float("nan"), "3", True, [1])


@pytest.mark.parametrize(
    "run",
    [
        *(lambda value, name=name: clean(ball(), **{name: value}) for name in ("min_triangles", "keep_clusters")),
        lambda value: smoothed(ball(), value),
        lambda value: simplified(ball(), faces=value),
        lambda value: decimated(ball(), value),
        lambda value: edges_and_faces(FACES, value),
    ],
)
@pytest.mark.parametrize("value", NUMBERS)
def test_whole_numbers_are_asked_for(run, value):
    with pytest.raises((TypeError, ValueError), match=r"whole number"):
        run(value)


@pytest.mark.parametrize(
    "run",
    [
        lambda value: holes_filled(ball(), value),
        lambda value: watertight(ball(), value),
        lambda value: decimation(ball(), value),
        lambda value: simplified(ball(), max_error_m=value or float("nan")),
        lambda value: contracted(VERTICES, value),
        lambda value: expanded(VERTICES, value),
    ],
)
@pytest.mark.parametrize("value", [-1, float("nan"), float("inf"), "3", None, [1, 2]])
def test_lengths_are_asked_for(run, value):
    with pytest.raises((TypeError, ValueError), match=r"number|finite|above|or more"):
        run(value)


@pytest.mark.parametrize("faces", [FACES.astype(float), FACES > 3, FACES.ravel(), np.zeros((4, 4), int), None,
                                   changed(FACES, len(VERTICES)), changed(FACES, -1)])  # fmt: skip
@pytest.mark.parametrize(
    "run",
    [
        lambda faces: area_m2(VERTICES, faces),
        lambda faces: list(twice_areas(VERTICES, faces)),
        lambda faces: edges_and_faces(faces, len(VERTICES)),
        lambda faces: is_closed(faces, len(VERTICES)),
    ],
)
def test_rows_of_faces_are_checked(run, faces):
    with pytest.raises((TypeError, ValueError), match="faces"):
        run(faces)


@pytest.mark.parametrize("points", [VERTICES.ravel(), VERTICES[:, :2], VERTICES.astype(object), None, np.array(["a"])])
@pytest.mark.parametrize(
    "run", [lambda points: area_m2(points, FACES), lambda points: contracted(points, 1.0),
            lambda points: expanded(points, 1.0)],
)  # fmt: skip
def test_rows_of_points_are_checked(run, points):
    with pytest.raises((TypeError, ValueError), match=r"not numbers|not \(N, 3\)"):
        run(points)


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.int32, np.uint32, np.uint64])
def test_any_whole_numbers_name_vertices(dtype):
    """Keys of edges are larger than what small types hold."""
    many = 100_000
    strip = np.stack([np.arange(many - 2), np.arange(1, many - 1), np.arange(2, many)], axis=1)
    faces, count = (FACES, len(VERTICES)) if dtype in (np.uint8, np.int16) else (strip, many)
    for found, expected in zip(edges_and_faces(faces.astype(dtype), count), edges_and_faces(faces, count), strict=True):
        assert np.array_equal(found, expected)
    assert is_closed(FACES.astype(dtype), len(VERTICES))


def test_lists_and_strides_are_arrays_too():
    expected = area_m2(VERTICES, FACES)
    assert area_m2(VERTICES.tolist(), FACES.tolist()) == expected
    assert area_m2(np.asfortranarray(VERTICES), np.asfortranarray(FACES)) == expected


def test_a_filled_mesh_owns_its_faces():
    """open3d's filling frees what it gave: faces that only pointed there were overwritten later."""
    for source in (ball(), trimesh.creation.box()):
        filled = [holes_filled(source, 0.2) for _ in range(20)]
        gc.collect()
        noise = [np.full((len(source.faces), 3), 7) for _ in range(50)]
        assert all(np.array_equal(one.faces, source.faces) for one in filled) and len(noise) == 50
