"""A trained run's mesh leaves out what its prior depth is expected to be far off at, by the run's trust.npz."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from room2dgs.captures.read import read_scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import load_config
from room2dgs.eval.boundary_kinds import NAMES, NOT_TRUSTED
from room2dgs.mesh.boundary_file import read_boundary
from room2dgs.pipeline.mesh import make_mesh
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.trust import read_trust, write_trust
from tests.pipeline.test_mesh_on_device import surfels_of_wall

WALL_Z = 2.0


def maps_of(frame) -> ViewMaps:
    """Little trust in all that lies at x < 0; nothing is known of a stripe."""
    rays = frame.camera.rays() @ frame.camera.rotation
    x = (frame.camera.centre + rays * ((WALL_Z - frame.camera.centre[2]) / rays[..., 2])[..., None])[..., 0]
    depth = np.where(np.abs(x + 0.5) < 0.1, 0, WALL_Z).astype(np.float32)
    return ViewMaps(depth=depth, depth_confidence=np.where(x < 0, 0.001, 0.9).astype(np.float32) * (depth > 0))


@pytest.mark.parametrize(
    "given, left_out",
    [(["prior=room_prior"], True), (["prior=room_prior", "mesh.max_expected_m=null"], False), (["prior=none"], False)],
)
def test_what_is_expected_to_be_far_off_is_not_meshed(wall, tmp_path, given, left_out):
    more = ["mesh.max_error_m=null", "mesh.voxel_m=0.04", "mesh.min_triangles=1", "mesh.fill=none"]
    config = load_config([f"scene.path={wall}", f"out={tmp_path}", *more, *given])
    scene = read_scene(config.scene)
    write_trust(tmp_path / "trust.npz", scene.train, {frame.name: maps_of(frame) for frame in scene.train}, {})
    assert set(read_trust(tmp_path / "trust.npz")) == {frame.name for frame in scene.train}
    make_mesh(scene, surfels_of_wall(wall), config, RunFolder(tmp_path, lambda _: None))
    mesh = trimesh.load(tmp_path / "mesh.ply", process=False)
    x = mesh.triangles_center[:, 0]
    area = {
        k: mesh.area_faces[q].sum() for k, q in {"sure": x > 0.1, "unsure": (x < -0.1) & (abs(x + 0.5) > 0.2)}.items()
    }
    stripe = mesh.area_faces[np.abs(x + 0.5) < 0.06].sum()
    assert area["sure"] > 0.3 and stripe > 0.02  # nobody says that the stripe is off
    assert (area["unsure"] < 0.02) == left_out, area


def test_the_boundary_is_written_with_the_mesh_and_goes_with_the_trust_that_judged_it(wall, tmp_path):
    """The wall goes on where its half was left out, and no depth there is sure."""
    config = load_config([f"scene.path={wall}", f"out={tmp_path}", "prior=room_prior", "mesh.voxel_m=0.04"])
    scene, lines = read_scene(config.scene), []
    write_trust(tmp_path / "trust.npz", scene.train, {frame.name: maps_of(frame) for frame in scene.train}, {})
    make_mesh(scene, surfels_of_wall(wall), config, RunFolder(tmp_path, lines.append))
    edges = read_boundary(tmp_path / "boundary.ply", len(NAMES), scene.origin_m)
    length = np.linalg.norm(edges.ends[:, 1] - edges.ends[:, 0], axis=1)
    metres = read_metrics(tmp_path)["boundary_m"]
    assert metres == pytest.approx(
        {name: length[edges.kind == kind].sum() for kind, name in enumerate(NAMES)}, rel=1e-4
    )
    middle = np.abs(edges.ends[..., 0].mean(axis=1)) < 0.15
    assert (edges.kind[middle] == NOT_TRUSTED).mean() > 0.5
    assert any(line.startswith("mesh: its boundary: ") for line in lines)
    (tmp_path / "trust.npz").unlink()
    make_mesh(scene, surfels_of_wall(wall), config, RunFolder(tmp_path, lines.append))
    assert not (tmp_path / "boundary.ply").exists() and read_metrics(tmp_path)["boundary_m"] is None


@pytest.mark.parametrize("known", [0, 1])
def test_views_that_say_nothing_are_meshed_whole_and_counted(wall, tmp_path, known):
    more = ["mesh.max_error_m=null", "mesh.voxel_m=0.04", "mesh.min_triangles=1", "mesh.fill=none"]
    config = load_config([f"scene.path={wall}", f"out={tmp_path}", "prior=room_prior", *more])
    scene, lines = read_scene(config.scene), []
    frames = scene.train[:known]
    write_trust(tmp_path / "trust.npz", frames, {frame.name: maps_of(frame) for frame in frames}, {})
    make_mesh(scene, surfels_of_wall(wall), config, RunFolder(tmp_path, lines.append))
    assert f"trust.npz says of {known} of {len(scene.train)} views" in "\n".join(lines)
    mesh = trimesh.load(tmp_path / "mesh.ply", process=False)
    assert mesh.area_faces[mesh.triangles_center[:, 0] < -0.1].sum() > 0.3
