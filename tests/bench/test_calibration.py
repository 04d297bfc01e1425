"""Expected against true errors of meshes: shares, ranking, parts, and a run from end to end."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from room2dgs import cli
from room2dgs.bench.calibration import SurfaceErrors, barycentric, calibration, calibrations, errors_at, tables
from room2dgs.bench.matched_surface import Matched
from room2dgs.config import load_config
from room2dgs.eval.sampling import Samples, sample_by_area
from room2dgs.mesh.io import write_mesh
from room2dgs.mesh.vertex_source import EXPECTED_ERROR, INFERRED, MEASURED, SOURCE, VIEWS
from room2dgs.runs.folder import write_config


def normal_errors(count: int = 20_000, told: float = 1.0) -> SurfaceErrors:
    """Of a normal distribution whose deviation, times `told`, is what is expected; few views where it is large."""
    rng = np.random.default_rng(0)
    sigma = rng.uniform(0.002, 0.05, count)
    true = np.abs(rng.normal(0, sigma))
    return SurfaceErrors(told * sigma, true, np.where(sigma < 0.026, 8, 2), np.ones(count, bool))


@pytest.mark.parametrize(("told", "within"), [(1.0, (0.683, 0.954, 0.997)), (0.5, (0.383, 0.683, 0.866))])
def test_shares_are_those_of_a_normal_distribution(told, within):
    found = calibration(normal_errors(told=told))
    assert found.within == pytest.approx(within, abs=0.01)


def test_what_tells_errors_apart_ranks_better_than_a_count_of_views():
    found = calibration(normal_errors())
    assert found.ranking.ause < found.by_views.ause < found.by_views.ause_random
    errors = normal_errors()
    order = SurfaceErrors(errors.true, errors.true, errors.views, errors.measured)
    assert calibration(order).ranking.ause == pytest.approx(0, abs=1e-9)


def test_parts_are_by_views_and_by_what_was_measured():
    errors = normal_errors()
    errors.measured[:1000] = False
    found = calibrations(errors)
    assert found["inferred"].share == pytest.approx(0.05) and found["measured"].share == pytest.approx(0.95)
    assert "3-5 views" not in found  # none has so many
    assert found["1-2 views"].share + found["6+ views"].share == pytest.approx(0.95)
    assert found["1-2 views"].true_m > 2 * found["6+ views"].true_m
    parts, tenths = tables({"run": found})
    assert len(parts.frame) == 5 and len(tenths.frame) == 10


def test_parts_are_by_what_stereo_matched_where_the_run_tells():
    errors = normal_errors()
    assert not any("stereo" in name for name in calibrations(errors))
    matched = np.arange(len(errors.true)) % 4  # 0 to 3 views
    on_plane = np.arange(len(errors.true)) % 8 == 4
    errors = SurfaceErrors(errors.expected, errors.true, errors.views, errors.measured, Matched(matched, on_plane))
    errors.measured[matched == 3] = False
    found = calibrations(errors)
    assert "stereo of 3+ views" not in found  # inferred, all of it
    assert found["stereo of 1-2 views"].share == pytest.approx(0.5)
    assert found["planes without stereo"].share == pytest.approx(0.125)
    assert found["other without stereo"].share == pytest.approx(0.125)


@given(st.integers(0, 10_000))
def test_barycentric_weights_give_the_point_back(seed):
    rng = np.random.default_rng(seed)
    corners, weights = rng.normal(size=(5, 3, 3)), rng.dirichlet((1, 1, 1), 5)
    found = barycentric(corners, np.einsum("nk,nkc->nc", weights, corners))
    np.testing.assert_allclose(found, weights, atol=1e-6)


def test_samples_have_what_lies_between_the_vertices():
    triangle = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    triangle.vertex_attributes[EXPECTED_ERROR] = np.float32([0.01, 0.02, 0.03])
    triangle.vertex_attributes[VIEWS] = np.uint8([1, 4, 9])
    triangle.vertex_attributes[SOURCE] = np.uint8([MEASURED, INFERRED, MEASURED])
    points = np.array([[0.25, 0.5, 0], [0.9, 0.05, 0], [0.1, 0.1, 0]])
    found = errors_at(triangle, Samples(points, np.zeros(3, np.int64)), np.array([0.1, 0.2, 0.6]))
    assert found.expected[:2] == pytest.approx([0.01 * 0.25 + 0.02 * 0.25 + 0.03 * 0.5, 0.01 * 0.05 + 0.018 + 0.0015])
    assert list(found.views) == [9, 4, 1] and list(found.measured) == [True, False, True]


@pytest.fixture
def run(wall, tmp_path):
    """A run whose mesh is the wall's, 1 cm off, and half of it says so."""
    out = tmp_path / "run"
    out.mkdir()
    write_config(out, load_config([f"scene.path={wall}", f"out={out}", "eval.samples=2000"]))
    mesh = trimesh.load_mesh(wall / "gt_mesh.ply", process=False).subdivide_to_size(0.1)
    mesh.vertices += (0.0, 0.0, -0.01)
    mesh.vertex_attributes[EXPECTED_ERROR] = np.where(mesh.vertices[:, 0] < 0, 0.012, 0.002).astype(np.float32)
    write_mesh(out / "mesh.ply", mesh)
    return out


def test_a_run_is_held_against_its_truth(run, tmp_path, capsys):
    to = tmp_path / "calibration.json"
    assert cli.main(["bench", "calibration", str(run), f"to={to}"]) == 0
    found = json.loads(to.read_text())["run"]["all"]
    assert found["true_m"] == pytest.approx(0.01, abs=1e-5)
    assert 0.33 < found["within"][0] < 0.45 and found["within"][2] < 0.45
    assert "AUSE" in capsys.readouterr().out


def test_what_cannot_be_calibrated_is_said(run, wall, tmp_path, capsys):
    assert cli.main(["bench", "calibration"]) == 2 and "no run is given" in capsys.readouterr().err
    write_mesh(run / "mesh.ply", trimesh.load_mesh(wall / "gt_mesh.ply", process=False))
    assert cli.main(["bench", "calibration", str(run)]) == 2
    assert f"does not say how sure it is; make it again with `room2dgs mesh {run}`" in capsys.readouterr().err
    capture = tmp_path / "capture"
    capture.mkdir()
    for path in wall.iterdir():
        if path.name != "gt_mesh.ply":
            (capture / path.name).symlink_to(path)
    write_config(run, load_config([f"scene.path={capture}", f"out={run}"]))
    assert cli.main(["bench", "calibration", str(run)]) == 2
    assert "has no gt_mesh.ply to compare" in capsys.readouterr().err


def test_samples_by_area_serve_it():
    """What `errors_at` is given: a face's number and a point on it."""
    mesh = trimesh.creation.box((1.0, 1.0, 1.0))
    samples = sample_by_area(mesh, 100, 0)
    weights = barycentric(np.asarray(mesh.vertices)[mesh.faces[samples.triangle]], samples.points)
    again = np.einsum("nk,nkc->nc", weights, np.asarray(mesh.vertices)[mesh.faces[samples.triangle]])
    np.testing.assert_allclose(again, samples.points, atol=1e-9)
