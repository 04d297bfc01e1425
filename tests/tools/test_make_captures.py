"""Filmed random rooms: the same bytes again, files that agree with one another, walks as a hand makes them."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import cv2
import numpy as np
import open3d as o3d
import pytest
import trimesh

from room2dgs.demo_room.geometry import FACET, Patch, parallelogram, triangulated
from room2dgs.demo_room.light import cast
from room2dgs.demo_room.mesh import MAX_EDGE
from room2dgs.demo_room.render import ray_scene
from room2dgs.tools.make_captures import CaptureOptions, evenly_cut, found_room, made, main, make_capture
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.blank import with_blank_walls
from room2dgs.tools.random_rooms.cameras import picture_rays
from room2dgs.tools.random_rooms.walk import Walk
from room2dgs.tools.shake_poses import shaken
from tests.oracles.made_captures import read_capture

OPTIONS = CaptureOptions(seed=77, photos=6, width=80, height=60)
FLAGS = ("--rooms", "1", "--seed", "77", "--photos", "6", "--width", "80", "--height", "60")


def files(path) -> dict[str, bytes]:
    """All files below a folder."""
    return {str(p.relative_to(path)): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


def angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Degrees between orientations (N, 3, 3)."""
    cosine = (np.einsum("nij,nij->n", first, second) - 1) / 2
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def test_the_same_options_give_the_same_bytes_and_another_room_others(films, tmp_path):
    again = make_capture(tmp_path / "again", 1, OPTIONS)
    assert files(again) == files(films[1].path)
    assert files(films[0].path)["gt_mesh.ply"] != files(films[1].path)["gt_mesh.ply"]


def test_what_is_there_is_kept_and_what_is_something_else_refused(films, tmp_path, capsys):
    out = films[0].path.parent
    before = (out / "room_00/room.json").stat().st_mtime_ns
    assert main([str(out), *FLAGS]) == 0
    assert (out / "room_00/room.json").stat().st_mtime_ns == before
    assert main([str(out), *FLAGS, "--blank", "0.2"]) == 2
    assert "made with these options" in capsys.readouterr().err
    (tmp_path / "room_00").mkdir()
    (tmp_path / "room_00/thesis.txt").write_text("mine")
    assert main([str(tmp_path), *FLAGS]) == 2
    assert (tmp_path / "room_00/thesis.txt").read_text() == "mine"


def test_the_options_are_kept_as_given_beside_what_came_of_them(films):
    said = made(CaptureOptions(), 3, 2, Walk(61.0, np.tile(np.eye(4), (70, 1, 1))))
    assert said == {**asdict(CaptureOptions()), "room": 3, "draw": 2, "filmed": 70, "fov": 61.0}
    assert said["photos"] == 0  # the room's size said how many
    assert json.loads((films[1].path / "room.json").read_text())["filmed"] == 6


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--seed", "0"], "seed is 0"),
        (["--pose-noise", "1"], "DEG,CM"),
        (["--pose-noise", "1,two"], "DEG,CM"),
        (["--pose-noise=-1,2"], "pose_noise_deg"),
        (["--blank", "1.5"], "blank"),
        (["--rooms", "0"], "--rooms"),
    ],
)
def test_bad_options_are_told_before_anything_is_made(flags, said, tmp_path, capsys):
    assert main([str(tmp_path / "out"), *flags]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_depth_is_where_the_mesh_is(films):
    for film in films:
        mesh = trimesh.load(film.path / "gt_mesh.ply", process=False)
        scene = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(
            o3d.core.Tensor(np.asarray(mesh.vertices, np.float32)), o3d.core.Tensor(np.asarray(mesh.faces, np.uint32))
        )
        assert mesh.edges_unique_length.max() <= 2 * MAX_EDGE  # the diagonal of a slanted cell
        for pose, depth in zip(film.poses, film.depths, strict=True):
            directions = film.rays() @ pose[:3, :3].T
            rays = np.concatenate([np.broadcast_to(pose[:3, 3], directions.shape), directions], -1)
            hit = scene.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))["t_hit"].numpy()
            solid = depth > 0
            # triangles that are mostly hidden are not in the mesh, so some pixels at silhouettes pass through
            assert np.mean(np.abs(hit[solid] - depth[solid]) < 6e-4) > 0.95
            assert np.mean(hit[solid] < depth[solid] - 6e-4) < 1e-3


def test_a_mirror_shows_the_room_and_has_its_glass_in_depth_and_mask(films, tmp_path):
    out = make_capture(tmp_path / "room", 1, replace(OPTIONS, photos=16, mirrors=2))
    assert json.loads((out / "room.json").read_text())["mirrors"] == 2
    masks = [cv2.imread(str(out / f"mirror/{index}.png"), cv2.IMREAD_UNCHANGED) for index in range(16)]
    assert all(set(np.unique(mask)) <= {0, 255} and mask.shape == (60, 80) for mask in masks)
    film = read_capture(out)
    seen = [
        (film.poses[index][:3, :3] @ (film.rays() * depth[..., None])[mask > 0].T).T + film.poses[index][:3, 3]
        for index, (mask, depth) in enumerate(zip(masks, film.depths, strict=True))
    ]
    points = np.concatenate(seen)
    assert len(points) > 100
    outline = np.array(json.loads((out / "plan_true.json").read_text())["rooms"][0]["outline"])
    following = np.roll(outline, -1, axis=0)
    along = (following - outline) / np.linalg.norm(following - outline, axis=1)[:, None]
    across = along[:, ::-1] * [-1, 1]
    away = np.abs(((points[:, None, :2] - outline[None]) * across[None]).sum(axis=2)).min(axis=1)
    assert np.percentile(away, 95) < 0.03  # on the walls
    assert not (films[1].path / "mirror").exists()


def test_captures_of_before_there_were_mirrors_are_kept(tmp_path):
    out = make_capture(tmp_path / "room", 1, OPTIONS)
    said = json.loads((out / "room.json").read_text())
    del said["mirrors"]
    (out / "room.json").write_text(json.dumps(said))
    assert make_capture(out, 1, OPTIONS) == out


def test_photos_are_neither_dark_nor_glaring_and_stick_to_the_surfaces(films):
    for film in films:
        assert 0.3 < np.median(film.colors) / 255 < 0.55
        agree = []
        for index in range(len(film.poses) - 1):
            points = film.points(index)[film.depths[index] > 0]
            in_cam = (points - film.poses[index + 1][:3, 3]) @ film.poses[index + 1][:3, :3]
            x = film.K[0, 0] * in_cam[:, 0] / in_cam[:, 2] + film.K[0, 2]
            y = film.K[1, 1] * in_cam[:, 1] / in_cam[:, 2] + film.K[1, 2]
            inside = (in_cam[:, 2] > 0.1) & (x >= 0) & (x < 80) & (y >= 0) & (y < 60)
            assert inside.mean() > 0.5  # neighbouring photos overlap
            row, column = y[inside].astype(int), x[inside].astype(int)
            seen = np.abs(film.depths[index + 1][row, column] - in_cam[inside, 2]) < 0.02
            here = film.colors[index][film.depths[index] > 0][inside][seen]
            agree.append(np.median(np.abs(here - film.colors[index + 1][row, column][seen])))
        assert np.median(agree) < 8


def test_the_given_field_of_view_is_that_of_the_intrinsics(films):
    for film in films:
        made = json.loads((film.path / "room.json").read_text())
        assert 58 <= made["fov"] <= 75
        assert film.K[0, 0] == pytest.approx(40 / np.tan(np.radians(made["fov"] / 2)), abs=1e-6)
        assert (film.K[0, 2], film.K[1, 2]) == pytest.approx((40.0, 30.0))


@pytest.mark.parametrize("number", [0, 1])
def test_few_photos_are_a_walk_too(number, films):
    _, patches, walk, _ = found_room(number, OPTIONS)
    np.testing.assert_allclose(walk.poses, films[number].poses, atol=1e-8)
    is_a_walk(patches, walk)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(4))
def test_a_walk_keeps_its_clearance_its_pace_and_something_to_see(number):
    _, patches, walk, _ = found_room(number, CaptureOptions(seed=78))
    assert 60 <= len(walk.poses) <= 120
    is_a_walk(patches, walk)
    scene = ray_scene(triangulated(patches))
    rays = np.einsum("fij,rj->fri", walk.poses[:, :3, :3], picture_rays(walk.fov))
    starts = np.broadcast_to(walk.poses[:, None, :3, 3], rays.shape)
    reach = cast(scene, starts.reshape(-1, 3), rays.reshape(-1, 3))["t_hit"].reshape(rays.shape[:2])
    assert np.mean(np.median(reach, axis=1) < 0.6) <= 0.2
    assert np.mean(np.isfinite(reach)) == 1  # the room is closed
    yaw = np.arctan2(walk.poses[:, 1, 2], walk.poses[:, 0, 2])
    assert len(np.unique(np.floor(yaw / np.radians(45)))) >= 6  # it looked around


def is_a_walk(patches, walk) -> None:
    scene = ray_scene(triangulated(patches))
    centres = walk.poses[:, :3, 3]
    clearance = scene.compute_distance(o3d.core.Tensor(centres.astype(np.float32))).numpy()
    assert clearance.min() >= 0.3 - 1e-5
    assert centres[:, 2].min() >= 1.3 and centres[:, 2].max() <= 1.6
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    assert steps.min() >= 0.08 and steps.max() <= 0.2
    assert angles(walk.poses[1:, :3, :3], walk.poses[:-1, :3, :3]).max() < 18
    assert walk.poses[:, 2, 1].max() < -0.7  # upright


def test_pose_noise_has_the_given_size_in_turn_and_shift():
    poses = np.tile(np.eye(4), (4000, 1, 1))
    random = np.random.default_rng(0)
    wrong = np.stack([shaken(pose, 1.0, 2.0, random) for pose in poses])
    turned = angles(wrong[:, :3, :3], poses[:, :3, :3])
    assert np.sqrt(np.mean(turned**2)) == pytest.approx(1.0, rel=0.03)
    shifts = wrong[:, :3, 3]
    assert np.sqrt(np.mean((shifts**2).sum(1))) == pytest.approx(0.02, rel=0.03)
    assert np.abs(shifts.mean(axis=0)).max() < 1e-3


def test_pose_noise_leaves_all_but_the_poses_alone(films, tmp_path):
    assert main([str(tmp_path), *FLAGS, "--pose-noise", "1,2"]) == 0
    plain, noisy = files(films[0].path), files(tmp_path / "room_00")
    for name in plain:
        if name.startswith("pose/"):
            assert noisy[name.replace("pose/", "pose_true/")] == plain[name]
            wrong, right = (np.loadtxt(tmp_path / "room_00" / folder / name[5:]) for folder in ("pose", "pose_true"))
            assert 0.02 < angles(wrong[None, :3, :3], right[None, :3, :3])[0] < 4
            assert 1e-4 < np.linalg.norm(wrong[:3, 3] - right[:3, 3]) < 0.08
            np.testing.assert_allclose(wrong[:3, :3] @ wrong[:3, :3].T, np.eye(3), atol=1e-8)
        elif name != "room.json":
            assert noisy[name] == plain[name], name


def test_blank_walls_are_of_one_colour_and_nothing_else_changes():
    rng = np.random.default_rng(3)
    paper, stone = materials.tile(rng), materials.stone(rng)
    sheet = parallelogram((0, 0, 0), (2, 0, 0), (0, 0, 2), paper)
    tags = ["wall0", "wall0", "wall1", "wall board", "ceiling", "floor"]
    patches = [Patch(sheet.grid, sheet.size, stone if tag == "floor" else paper, tag) for tag in tags]
    painted = with_blank_walls(patches, 1.0, rng)
    assert [patch.material.contrast == 0 for patch in painted] == [True, True, True, False, True, False]
    assert painted[0].material is painted[1].material  # beside an opening the same paint
    assert painted[5] is patches[5]
    assert all(one is other for one, other in zip(with_blank_walls(patches, 0.0, rng), patches, strict=True))


def test_only_bent_patches_are_cut():
    material = materials.tile(np.random.default_rng(0))
    flat = parallelogram((0, 0, 0), (2, 0, 0), (0, 0.5, 2), material)
    assert evenly_cut(flat) is flat
    bent = Patch(flat.grid + np.array([[[0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.05, 0]]]), flat.size, material)
    cut = evenly_cut(bent)
    edges = [np.linalg.norm(np.diff(cut.grid, axis=axis), axis=-1).max() for axis in (0, 1)]
    assert max(edges) <= FACET + 1e-9
    np.testing.assert_allclose(cut.grid[0, 0], bent.grid[0, 0])
