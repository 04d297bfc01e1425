"""A capture far from its world's origin is read as the same capture beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from room2dgs.captures.point_files import read_ply
from room2dgs.captures.read import placed
from room2dgs.config import PointsConfig, load_config
from room2dgs.errors import InputError
from room2dgs.sfm.sparse import sparse_points
from room2dgs.tools.capture_layouts.registry import LAYOUTS

UTM = np.array([500000.13, 5400000.37, 300.21])
ECEF = np.array([4075539.8, -931735.3, 4801629.6])


def elsewhere(made, offset):
    poses = made.poses.copy()
    poses[:, :3, 3] += offset
    return replace(made, poses=poses, xyz=made.xyz + offset)


@pytest.mark.parametrize("offset", [UTM, ECEF], ids=["UTM", "ECEF"])
@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_every_camera_and_point_is_where_it_was(written, settings_of, made, layout, offset):
    if layout == "sens":  # its format has float32
        far = placed(settings_of(written(layout, made=elsewhere(made, offset)), layout))
        assert any("float32" in warning and "steps of 50 cm" in warning for warning in far.warnings)
        return
    near = placed(settings_of(written(layout), layout))
    (root := near.path).rename(root.with_name("near"))
    far = placed(settings_of(written(layout, made=elsewhere(made, offset)), layout))
    assert near.origin_m == (0.0, 0.0, 0.0)
    assert np.abs(np.array(far.origin_m) - offset).max() < 52 and not np.any(np.mod(far.origin_m, 100))
    for before, after in zip(near.frames, far.frames, strict=True):
        centre = after.camera.centre + far.origin_m - offset
        assert np.abs(centre - before.camera.centre).max() < 1e-5  # what the text of some layouts keeps
        assert np.abs(after.camera.cam_from_world[:3, :3] - before.camera.cam_from_world[:3, :3]).max() < 1e-9
    assert any(note.startswith("coordinates: ") for note in far.notes)
    assert not any(note.startswith("coordinates: ") for note in near.notes)
    assert not any("float32" in warning for warning in (*near.warnings, *far.warnings))


def test_points_of_the_capture_come_along(written, settings_of, made):
    scene = placed(settings_of(written("colmap", made=elsewhere(made, UTM)), "colmap"))
    found = scene.given_points().xyz + scene.origin_m
    assert len(found) > 500 and KDTree(made.xyz + UTM).query(found)[0].max() < 1e-5


def test_points_of_a_file_are_of_the_captures_world(written, settings_of, made, tmp_path):
    scene = placed(settings_of(written("scannet", made=elsewhere(made, UTM)), "scannet"))
    head = ["ply", "format ascii 1.0", f"element vertex {len(made.xyz)}"]
    head += [*(f"property double {axis}" for axis in "xyz"), "end_header"]
    rows = [" ".join(map(repr, map(float, row))) for row in made.xyz + UTM]
    (tmp_path / "points.ply").write_text("\n".join([*head, *rows, ""]))
    assert np.abs(read_ply(tmp_path / "points.ply").xyz - made.xyz - UTM).max() < 1e-8
    config = replace(load_config(["scene.path=x", "out=y"]).points, source="file", file=str(tmp_path / "points.ply"))
    assert isinstance(config, PointsConfig)
    points = sparse_points(scene, config, tmp_path)
    assert np.abs(points.xyz + scene.origin_m - made.xyz - UTM).max() < 1e-8


def test_other_frames_have_the_same_origin(written, settings, made):
    root = written("scannet", made=elsewhere(made, UTM))
    origins = {placed(settings(root, **changes)).origin_m for changes in ({}, {"frames": 4}, {"stride": 2})}
    assert origins == {(500000.0, 5400000.0, 300.0)}


def test_units_come_first(written, settings, made):
    """Poses in millimetres: the offset is one of metres."""
    poses = made.poses.copy()
    poses[:, :3, 3] = (poses[:, :3, 3] + UTM) * 1000
    scene = placed(settings(written("scannet", made=replace(made, poses=poses)), unit=0.001))
    assert scene.origin_m == (500000.0, 5400000.0, 300.0)
    assert np.abs(scene.frames[0].camera.centre + scene.origin_m - made.poses[0, :3, 3] - UTM).max() < 1e-6


def test_a_lone_pose_of_zeros_costs_itself(written, settings, made):
    root = written("scannet", made=elsewhere(made, UTM))
    poses = sorted((root / "pose").iterdir())
    np.savetxt(poses[0], np.eye(4))
    scene = placed(settings(root))
    assert len(scene.frames) == made.count - 1 and scene.origin_m == (500000.0, 5400000.0, 300.0)
    (dropped,) = scene.dropped
    assert int(dropped.name) == int(poses[0].stem) and "from the others" in dropped.reason
    assert any("poses far from all others (1 of 6)" in warning for warning in scene.warnings)
    for path in poses[1:2]:
        np.savetxt(path, np.eye(4))
    with pytest.raises(InputError, match=r"first of 2 poses far from all others, of 6"):
        placed(settings(root))


def test_poses_that_mean_the_inverse_are_named_before_units(written, settings, made):
    """Far from the origin the wrong reading throws cameras about by thousands of kilometres, as no unit does."""
    root = written("scannet", made=elsewhere(made, UTM))
    for path in (root / "pose").iterdir():
        np.savetxt(path, np.linalg.inv(np.loadtxt(path)))
    with pytest.raises(InputError, match=r"give scene\.poses=world_to_camera_opencv"):
        placed(settings(root))
    scene = placed(settings(root, poses="world_to_camera_opencv"))
    assert np.abs(scene.frames[0].camera.centre + scene.origin_m - made.poses[0, :3, 3] - UTM).max() < 1e-6


@pytest.mark.parametrize(("factor", "unit"), [(1000, "0.001"), (3e4, "0.001")])
def test_millimetres_are_still_named(written, settings, made, factor, unit):
    poses = made.poses.copy()
    poses[:, :3, 3] *= factor
    with pytest.raises(InputError, match=rf"give scene\.unit={unit}"):
        placed(settings(written("scannet", made=replace(made, poses=poses))))
