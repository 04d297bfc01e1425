"""PLY meshes as other programs write them: any polygons, types and byte orders; headers that promise too much."""

from __future__ import annotations

import struct
import tracemalloc
from collections.abc import Sequence

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs.captures.ply_elements import Lists
from room2dgs.errors import InputError
from room2dgs.mesh.io import read_mesh
from room2dgs.mesh.ply_mesh import triangles

CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
MIXED = [[0, 3, 2], [0, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
CUBE = [[0, 3, 2, 1], *MIXED[2:]]
CODES = {"uchar": "B", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d", "char": "b", "short": "h"}
FORMS = ("ascii", "binary_little_endian", "binary_big_endian")


def ply(
    vertices: Sequence,
    faces: Sequence[Sequence[int]],
    form: str = "binary_little_endian",
    *,
    kind: str = "float",
    count: str = "uchar",
    index: str = "int",
    colors: Sequence | None = None,
    more: bool = False,
    space: str = " ",
    end: str = "\n",
    name: str = "vertex_indices",
) -> bytes:
    """A file by the format's own rules; `more` puts other elements and properties around those of the mesh."""
    order = ">" if form.endswith("big_endian") else "<"
    head = ["ply", f"format {form} 1.0", "comment a cube", "obj_info made by hand"]
    if more:
        head += ["element camera 2", "property float f", "property list uchar short seen"]
    head += [f"element vertex {len(vertices)}", *(f"property {kind} {axis}" for axis in "xyz")]
    head += [f"property uchar {channel}" for channel in ("red", "green", "blue", "alpha")] if colors is not None else []
    head += ["property double quality"] if more else []
    head += [f"element face {len(faces)}"]
    head += ["property uchar flags"] if more else []
    head += [f"property list {count} {index} {name}"]
    head += ["property list uchar float texcoord"] if more else []
    rows: list[list[tuple[str, float]]] = []
    if more:
        rows += [[("float", 1.5), ("uchar", 2), ("short", -3), ("short", 4)], [("float", 2.5), ("uchar", 0)]]
    for number, point in enumerate(vertices):
        row = [(kind, value) for value in point]
        row += [("uchar", value) for value in colors[number]] if colors is not None else []
        rows.append([*row, ("double", 0.25)] if more else row)
    for face in faces:
        row = [("uchar", 7)] if more else []
        row += [(count, len(face)), *((index, corner) for corner in face)]
        rows.append([*row, ("uchar", len(face) % 3), *[("float", 0.5)] * (len(face) % 3)] if more else row)
    text = end.join([line.replace(" ", space) for line in [*head, "end_header"]]) + end
    if form == "ascii":
        return (text + "".join(space.join(repr(value) for _, value in row) + end for row in rows)).encode()
    return text.encode() + b"".join(struct.pack(order + CODES[one], value) for row in rows for one, value in row)


def read(tmp_path, content: bytes) -> trimesh.Trimesh:
    path = tmp_path / "mesh.ply"
    path.write_bytes(content)
    return read_mesh(path)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("faces", [MIXED, CUBE], ids=["triangles and quads", "quads"])
@pytest.mark.parametrize(
    "options",
    [{}, {"more": True}, {"space": "\t"}, {"end": "\r\n"}, {"kind": "double", "count": "int", "index": "uint"},
     {"index": "ushort", "space": "  ", "name": "vertex_index"}],
)  # fmt: skip
def test_a_cube_is_a_cube_however_it_is_written(tmp_path, form, faces, options):
    colors = np.arange(32).reshape(8, 4) * 8
    mesh = read(tmp_path, ply(CORNERS, faces, form, colors=colors.tolist(), **options))
    assert len(mesh.faces) == 12 and mesh.area == pytest.approx(6) and mesh.volume == pytest.approx(1)
    assert np.array_equal(mesh.vertices, CORNERS)
    assert np.array_equal(mesh.visual.vertex_colors, colors)


def test_lists_whose_lengths_are_the_first_one_s_on_average_are_not_taken_for_equal_ones(tmp_path):
    """A quad, a triangle and a pentagon have as many bytes as three quads."""
    plane = [[x, y, 0] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1), (1.5, 2))]
    faces = [[0, 1, 2, 3], [2, 5, 6], [1, 4, 5, 6, 2]]
    mesh = read(tmp_path, ply(plane, faces))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [2, 5, 6], [1, 4, 5], [1, 5, 6], [1, 6, 2]]


def test_polygons_of_fewer_than_three_corners_are_no_surface(tmp_path):
    mesh = read(tmp_path, ply(CORNERS, [[0], [0, 1], [], [0, 1, 2], [1, 2]]))
    assert mesh.faces.tolist() == [[0, 1, 2]]


def test_doubles_stay_doubles(tmp_path):
    far = np.array(CORNERS) + np.array([4e5 + 1e-4, 5.5e6, 123.456])
    for form in FORMS:
        assert np.array_equal(read(tmp_path, ply(far.tolist(), MIXED, form, kind="double")).vertices, far)


@pytest.mark.parametrize("form", FORMS)
def test_vertices_that_no_face_uses_may_be_nan_and_those_in_use_may_not(tmp_path, form):
    nan = float("nan")
    vertices = [[nan, 0, 0], *CORNERS, [0, float("inf"), 0]]
    colors = [[200, 0, 0, 255], *[[10 * k, 0, 0, 255] for k in range(8)], [100, 0, 0, 255]]
    faces = [[corner + 1 for corner in face] for face in MIXED]
    content = ply(vertices, faces, form, colors=colors).replace(b"nan", b"-nan(ind)")
    mesh = read(tmp_path, content)
    assert np.array_equal(mesh.vertices, CORNERS) and mesh.area == pytest.approx(6)
    assert mesh.visual.vertex_colors[:, 0].tolist() == [10 * k for k in range(8)]
    with pytest.raises(InputError, match="has 1 vertices that are NaN"):
        read(tmp_path, ply(vertices, [*faces, [0, 1, 2]], form))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data(), st.sampled_from(FORMS), st.booleans())
def test_any_polygons_come_back(tmp_path, data, form, more):
    vertices = data.draw(
        st.lists(st.tuples(*[st.floats(-1e3, 1e3, width=32, allow_subnormal=False)] * 3), min_size=3, max_size=9)
    )
    corner = st.integers(0, len(vertices) - 1)
    faces = [*data.draw(st.lists(st.lists(corner, max_size=6), max_size=8)), [0, 1, 2]]
    mesh = read(tmp_path, ply(vertices, faces, form, more=more))
    expected = [[face[0], face[k], face[k + 1]] for face in faces for k in range(1, len(face) - 1)]
    assert np.array_equal(mesh.vertices, np.array(vertices)) and mesh.faces.tolist() == expected


def test_triangles_tell_whose_they_are():
    faces, polygon = triangles(Lists(np.array([3, 0, 5, 2]), np.arange(10)))
    assert polygon.tolist() == [0, 2, 2, 2]
    assert faces.tolist() == [[0, 1, 2], [3, 4, 5], [3, 5, 6], [3, 6, 7]]


GOOD = ply(CORNERS, MIXED)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (GOOD.replace(b"element vertex 8", b"element vertex 1000000000000"), "cut short: it announces 1000000000000"),
        (GOOD.replace(b"element face 7", b"element face 999999999"), "cut short"),
        (ply(CORNERS, MIXED, "ascii").replace(b"face 7", b"face 70000000"), "cut short"),
        (GOOD[:-5], "cut short among its face"),
        (GOOD + b"abc", "3 more bytes than its header announces"),
        (GOOD.replace(b"element face 7", b"element face 6"), "more bytes"),
        (ply(CORNERS, MIXED, "ascii") + b"5 6", "2 more numbers"),
        # as a transfer in text mode leaves it
        (ply(CORNERS * 2, [[0, 1, 10]]).replace(b"\n", b"\r\n"), "1 more bytes"),
        (GOOD.replace(b"float y", b"float x"), "'x' twice"),
        (GOOD.replace(b"float y", b"float z2"), "no vertices with x, y and z"),
        (GOOD.replace(b"float y", b"string y"), "header has the line 'property string y'"),
        (GOOD.replace(b"list uchar", b"list float"), "no whole numbers"),
        (GOOD.replace(b"element face", b"element vertex"), "header has the line"),
        (GOOD.replace(b"element vertex 8", b"element vertex -8"), "header has the line"),
        (GOOD.replace(b"binary_little", b"binary_middle"), "header has the line"),
        (GOOD.replace(b"format binary_little_endian 1.0\n", b""), "names no format"),
        (GOOD.replace(b"end_header", b"end_of"), "its header has no end"),
        (b"ply\n" + b"comment \x1b[31m\n" * 3 + b"what \x1b[31m\nend_header\n", r"'what \\x1b\[31m'"),
        (b"hello", "does not begin with 'ply'"),
        (b"", "does not begin with 'ply'"),
        (ply(CORNERS, MIXED, "ascii").replace(b"0 1 5 4", b"0 1 five 4"), "something that is none"),
        (ply(CORNERS, [[0, 1, 8]]), "vertices which are not there"),
        (ply(CORNERS, [[0, 1, -1]]), "vertices which are not there"),
        (ply(CORNERS, []), "holds no triangles"),
        (ply([], []), "holds no triangles|no vertices"),
        (ply(CORNERS, [[0, 1]]), "holds no triangles"),
        (ply([[1e300, 0, 0], *CORNERS[1:]], MIXED, kind="double"), "coordinates up to 1e\\+300"),
        (ply(CORNERS, MIXED, count="char").replace(b"\x04\x04\0\0\0", b"\xff\x04\0\0\0"), "cut short"),
        (ply(CORNERS, [[300, 0, 1]], "ascii", index="uchar"), "do not fit into uint8"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_a_sentence(tmp_path, content, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        read(tmp_path, content)
    assert str(tmp_path / "mesh.ply") in str(caught.value) and "\x1b" not in str(caught.value)


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data(), st.sampled_from(FORMS), st.booleans())
def test_any_damage_is_a_sentence_or_a_mesh_within_bounded_memory(tmp_path, data, form, more):
    content = bytearray(ply(CORNERS, MIXED, form, more=more))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        change = data.draw(st.sampled_from(("set", "cut", "grow")))
        if change == "set":
            content[at] = data.draw(st.integers(0, 255))
        elif change == "cut":
            del content[at : at + data.draw(st.integers(1, 9))]
        else:
            content[at:at] = data.draw(st.sampled_from((b"9", b"999999999", b"\n", b"\xff\xff\xff\x7f", b"\0" * 8)))
        if not content:
            break
    tracemalloc.start()
    try:
        mesh = read(tmp_path, bytes(content))
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(mesh.vertices).all() and mesh.faces.max() < len(mesh.vertices)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 5_000_000
