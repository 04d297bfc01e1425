"""Where the depth prior contradicts the unit of the poses, the words name scene.unit with the number."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from room2dgs.pipeline.units import unit_doubt
from tests.pipeline.unknown_unit import WALL_Z, capture_of, run

FIFTIETH = 0.02


@pytest.mark.parametrize(("factor", "unit"), [(FIFTIETH, "50"), (0.04, "25"), (0.001, "1000")])
def test_a_tiny_room_of_a_wrong_unit_is_told_the_right_one(wall, tmp_path, capsys, factor, unit):
    """Whether its points are far enough to count as seen (5 cm) or not."""
    capture = capture_of(wall, tmp_path / "tiny", factor)
    assert run(capture, tmp_path / "out", "mesh.min_triangles=50", "scene.unit=1") == 2
    said = capsys.readouterr().err
    assert f"give scene.unit={unit}" in said
    assert "add photos" not in said and "larger voxels" not in said


def test_its_unit_mends_it(wall, tmp_path, capsys):
    """Points of a file are metres."""
    capture = capture_of(wall, tmp_path / "tiny", FIFTIETH)
    trimesh.load(wall / "points.ply").export(capture / "points.ply")
    out = tmp_path / "out"
    assert run(capture, out, "mesh.voxel_m=0.04", "scene.unit=50") == 0
    assert "scene.unit=5" not in capsys.readouterr().out.replace("scale: scene.unit=50 metres", "")
    assert json.loads((out / "metrics.json").read_text())["prior_scale"] == pytest.approx(1, abs=0.02)
    assert np.median(trimesh.load(out / "mesh.ply").vertices[:, 2]) == pytest.approx(WALL_Z, abs=0.01)


@pytest.mark.parametrize(
    ("scale", "metric", "unit", "words"),
    [
        (0.0203, False, None, "give scene.unit=49"),
        (0.45, False, None, "give scene.unit=2.2"),
        (0.6, False, None, None),
        (1.9, False, None, None),
        (2.1, False, None, "give scene.unit=0.48"),
        (0.45, True, None, None),
        (0.3, True, None, "if they are not, give scene.unit=3.3"),
        (1000.0, True, None, "give scene.unit=0.001"),
        (0.45, False, 2.0, None),
        (0.1, False, 0.001, "give scene.unit=0.01"),
        (10.0, True, 1.0, "give scene.unit=0.1"),
        (None, False, None, None),
    ],
)
def test_when_a_unit_is_doubted(scale, metric, unit, words):
    said = unit_doubt(scale, SimpleNamespace(metric=metric), unit)
    assert said is None if words is None else said.endswith(words)


def test_a_capture_that_tells_no_unit_and_has_no_prior_may_have_another(wall, tmp_path, capsys):
    """Without a prior nobody knows, but that too is said."""
    capture = capture_of(wall, tmp_path / "tiny", FIFTIETH)
    assert run(capture, tmp_path / "out", "mesh.source=points", "prior=none", "mesh.min_triangles=100000") == 2
    said = capsys.readouterr().err
    assert "scene.unit" in said and "does not say its unit" in said
