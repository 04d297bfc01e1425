"""The same made scene in every layout gives the same cameras, photos, depth and points."""

from __future__ import annotations

import hashlib
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from room2dgs import cli
from room2dgs.captures.listing import Listing
from room2dgs.captures.read import read_scene
from room2dgs.captures.readers.choice import reader_of
from room2dgs.config import load_config
from room2dgs.eval import evaluate
from room2dgs.registries.readers import READERS
from room2dgs.tools.capture_layouts.registry import LAYOUTS


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_same_scene_in_every_layout(written, settings, made, name):
    layout = LAYOUTS[name]
    scene = read_scene(settings(written(name), **layout.settings(made)))
    assert scene.layout == layout.name
    frames = scene.frames
    assert len(frames) == len(made.poses) and not scene.dropped
    exact, exact_px = (1e-6, 1e-5) if layout.name == "sens" else (1e-9, 1e-9)  # which has float32
    for frame, pose, photo, depth in zip(frames, made.poses, made.photos, made.depths, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=exact)
        np.testing.assert_allclose(frame.camera.K, made.K, atol=exact_px)
        assert frame.camera.size == photo.shape[1::-1]
        assert np.abs(frame.color()[..., ::-1].astype(int) - photo).mean() < 12.0  # JPEG, MPEG; others differ by 60
        if layout.depth:
            np.testing.assert_allclose(frame.depth(), depth / 1000, atol=1e-6)
        else:
            assert frame.depth() is None
    assert (scene.given_points is not None) == layout.points
    if layout.points:
        _check_points(scene, made, masked="dslr" in name)


def _check_points(scene, made, masked: bool) -> None:
    points = scene.given_points()
    seen = np.unique(np.concatenate([index for index, _ in made.seen]))
    np.testing.assert_allclose(points.xyz, made.xyz[seen], atol=1e-12)
    np.testing.assert_array_equal(points.rgb, made.rgb[seen])
    for frame, (index, pixel) in zip(scene.train, made.seen[len(scene.test) :], strict=True):
        point, where = points.tracks.of_frame(frame.name)
        shown = (pixel >= (10 if masked else 0)).any(axis=1)  # the mask hides a corner
        np.testing.assert_array_equal(seen[point], index[shown])
        np.testing.assert_allclose(where, pixel[shown], atol=1e-4)


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_by_its_name_is_the_one_that_is_found(written, settings, made, name):
    root = written(name)
    config = settings(root)
    assert reader_of(config, Listing(root)).name == LAYOUTS[name].name
    told = LAYOUTS[name].settings(made)
    named = read_scene(settings(root, layout=LAYOUTS[name].name, **told))
    np.testing.assert_array_equal(
        np.stack([frame.camera.cam_from_world for frame in named.frames]),
        np.stack([frame.camera.cam_from_world for frame in read_scene(settings(root, **told)).frames]),
    )


def test_every_reader_has_a_fixture():
    assert {layout.name for layout in LAYOUTS.values()} == set(READERS)


def test_a_folder_of_ten_thousand_files_is_known_at_once(written, settings):
    root = written("scannet")
    for i in range(10_000):
        (root / "color" / f"{i + 100}.jpg").touch()
        (root / f"note{i}.txt").touch()
    start = time.process_time()
    assert reader_of(settings(root), Listing(root)).name == "scannet"
    assert time.process_time() - start < 1.0


WALL_Z = 2.0
QUICK = [
    "points.source=file",
    "prior=none",
    "seeds.voxel_m=0.1",
    "sfm.refine_poses=false",
    "train.iterations=30",
    "train.tensorboard=false",
    "mesh.voxel_m=0.05",
    "mesh.min_triangles=1",
    "report.enabled=false",
    "export.after_run=[]",
    "scene.test_every=0",
    "scene.split=every",
]
# numbers on disk that are turned or scaled ones, or angles, and come back up to float64's rounding
ROUNDED = {"nerfstudio", "instant_ngp", "metashape", "sdfstudio", "ros1", "ros2", "monosdf"}


@pytest.fixture(scope="module")
def wall_made(made):
    """The same files of another scene: a patterned wall 2 m off. Its poses are exact in every notation."""
    count, height, width = made.depths.shape
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = 0.125 * np.arange(count), 0.0625 * (np.arange(count) % 2)
    x, y = ((np.arange(n) + 0.5 - made.K[i, 2]) / made.K[i, i] * WALL_Z for i, n in enumerate((width, height)))
    photos = []
    for pose in poses:
        light = 127 + 90 * np.sin(7 * (x + pose[0, 3]))[None] * np.cos(6 * (y + pose[1, 3]))[:, None]
        photos.append(np.stack([light, 255 - light, np.full_like(light, 90)], axis=-1).astype(np.uint8))
    depths = np.full_like(made.depths, 1000 * WALL_Z)
    return replace(made, poses=poses, photos=np.stack(photos), depths=depths)


@pytest.fixture(scope="module")
def wall_truth(tmp_path_factory) -> Path:
    """points.ply and gt_mesh.ply of the wall."""
    folder = tmp_path_factory.mktemp("wall")
    x, y = np.meshgrid(np.linspace(-1.2, 1.8, 31), np.linspace(-0.9, 0.9, 19))
    grid = np.stack([x.ravel(), y.ravel(), np.full(x.size, WALL_Z)], axis=1)
    trimesh.PointCloud(grid, colors=np.full((len(grid), 3), 128, np.uint8)).export(folder / "points.ply")
    corners = np.array([[-1.2, -0.9, WALL_Z], [1.8, -0.9, WALL_Z], [1.8, 0.9, WALL_Z], [-1.2, 0.9, WALL_Z]])
    trimesh.Trimesh(corners, [[0, 2, 1], [0, 3, 2]], process=False).export(folder / "gt_mesh.ply")
    return folder


@pytest.mark.slow
def test_the_same_scene_in_every_layout_gives_the_same_mesh_and_score(written, wall_made, wall_truth, tmp_path):
    """A run sees cameras and pictures alone: where these are the same bits, so is the mesh. One run each for PNG, for
    JPEG, and for poses that are rounded."""
    meshes: dict[str, tuple[str, float]] = {}
    scenes = {}
    for name in LAYOUTS:
        given = [f"scene.path={written(name, made=wall_made)}", f"points.file={wall_truth / 'points.ply'}"]
        given += [*QUICK, *_said(LAYOUTS[name].settings(wall_made))]
        scenes[name] = read_scene(load_config([*given, "out=unused"]).scene)
        if name in ("scannet", "tum", "nerfstudio"):
            out = tmp_path / "runs" / name
            assert cli.main(["run", *given, f"out={out}"]) == 0
            found = evaluate(
                out / "mesh.ply",
                wall_truth / "gt_mesh.ply",
                [frame.camera for frame in scenes[name].frames],
                samples=100_000,
            )
            mesh = hashlib.sha256((out / "mesh.ply").read_bytes()).hexdigest()
            meshes[name] = mesh, found.as_dict()["f_score_5cm"]
    pictures = {name: _digest(frame.color() for frame in scene.frames) for name, scene in scenes.items()}
    cameras = {name: _digest(_numbers(scene)) for name, scene in scenes.items()}
    assert set(pictures.values()) == {pictures[name] for name in ("scannet", "tum", "stray")}  # JPEG, PNG, MPEG
    assert {name for name in LAYOUTS if cameras[name] != cameras["scannet"]} <= ROUNDED
    for name in ROUNDED:
        for one, other in zip(_numbers(scenes[name]), _numbers(scenes["scannet"]), strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)
    assert meshes["tum"][1] > 0.8
    # poses that differ by 1e-12 train to other last bits: 0.0011 on one processor
    assert abs(meshes["nerfstudio"][1] - meshes["tum"][1]) < 0.005, meshes
    assert abs(meshes["scannet"][1] - meshes["tum"][1]) < 0.02, meshes


def _said(told: dict) -> list[str]:
    return [f"scene.{key}={str(value).replace(' ', '')}" for key, value in told.items()]


def _numbers(scene):
    for frame in scene.frames:
        yield from (frame.camera.cam_from_world + 0.0, frame.camera.K)  # -0.0 is 0.0


def _digest(arrays) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
