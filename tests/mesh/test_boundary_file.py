"""boundary.ply: there and back, read by others, and what is refused."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.errors import InputError
from room2dgs.mesh.boundary_file import BoundaryEdges, read_boundary, write_boundary

COLORS = np.array([[0, 0, 255], [128, 128, 128], [255, 0, 0]], np.uint8)
ORIGIN = (0.0, 0.0, 0.0)


def edges(count: int, seed: int = 0) -> BoundaryEdges:
    rng = np.random.default_rng(seed)
    return BoundaryEdges(rng.normal(size=(count, 2, 3)), rng.integers(0, 3, count).astype(np.uint8))


@settings(max_examples=20)
@given(st.integers(0, 40), st.integers(0, 1000), st.sampled_from([ORIGIN, (5e5, -4e6, 300.0)]))
def test_it_comes_back_wherever_the_world_begins(tmp_path_factory, count, seed, origin):
    path, given_edges = tmp_path_factory.mktemp("boundary") / "boundary.ply", edges(count, seed)
    write_boundary(path, given_edges, COLORS, origin)
    found = read_boundary(path, 3, origin)
    np.testing.assert_allclose(found.ends, given_edges.ends, atol=1e-6)
    np.testing.assert_array_equal(found.kind, given_edges.kind)


def test_open3d_reads_its_lines_with_their_colours(tmp_path):
    given_edges = edges(7)
    write_boundary(tmp_path / "boundary.ply", given_edges, COLORS, ORIGIN)
    lines = o3d.io.read_line_set(str(tmp_path / "boundary.ply"))
    ends = np.asarray(lines.points)[np.asarray(lines.lines)]
    np.testing.assert_allclose(ends, given_edges.ends, atol=1e-6)
    np.testing.assert_allclose(np.asarray(lines.colors) * 255, COLORS[given_edges.kind], atol=0.5)


@pytest.mark.parametrize(
    ("old", "new"), [(b"kind", b"sort"), (b"vertex1", b"vertexA"), (b"edge", b"side"), (b"ply", b"pli")]
)
def test_no_such_file_is_refused_by_name(tmp_path, old, new):
    path = tmp_path / "boundary.ply"
    write_boundary(path, edges(3), COLORS, ORIGIN)
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(InputError, match=r"boundary\.ply .*"):
        read_boundary(path, 3, ORIGIN)


def test_kinds_and_vertices_that_are_not_there_are_refused(tmp_path):
    path = tmp_path / "boundary.ply"
    write_boundary(path, edges(9), COLORS, ORIGIN)
    with pytest.raises(InputError, match=r"boundary\.ply is damaged; mesh the run again"):
        read_boundary(path, 1, ORIGIN)
    data = path.read_bytes()
    path.write_bytes(data[: -9 * 12] + (99).to_bytes(4, "little") + data[-9 * 12 + 4 :])
    with pytest.raises(InputError, match="is damaged"):
        read_boundary(path, 3, ORIGIN)
