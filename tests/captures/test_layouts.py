"""The same made scene in every layout gives the same cameras, photos, depth and points."""

from __future__ import annotations

import time

import numpy as np
import pytest

from room2dgs.captures.listing import Listing
from room2dgs.captures.read import read_scene
from room2dgs.captures.readers.registry import READERS, reader_of

INTEGER = {"intrinsics": [81.0, 84.0, 46.0, 36.75], "pixel_centres": "integer"}
# what layouts without intrinsics, or with those of one camera, have to be told
TOLD = {
    "tum": INTEGER,
    "sevenscenes": INTEGER,
    "neuralrgbd": INTEGER,
    "open3d": INTEGER,
    "ros_mcap": {"pose_frame": "camera"},
}
# name of the fixture -> layout, exactness of the poses, whether it has depth, points with tracks
LAYOUTS = {
    "scannet": ("scannet", 1e-12, True, False),
    "scannet_frames": ("scannet", 1e-12, True, False),
    "scannet_flat": ("scannet", 1e-12, True, False),
    "sens": ("sens", 1e-6, True, False),
    "colmap": ("colmap", 1e-9, False, True),
    "colmap_binary": ("colmap", 1e-9, False, True),
    "nerfstudio": ("nerfstudio", 1e-9, True, False),
    "instant_ngp": ("nerfstudio", 1e-9, False, False),
    "scannetpp_dslr": ("scannetpp", 1e-9, False, True),
    "scannetpp_json": ("scannetpp", 1e-9, False, False),
    "scannetpp_iphone": ("scannetpp", 1e-9, True, True),
    "replica": ("replica", 1e-9, True, False),
    "tum": ("tum", 1e-9, True, False),
    "sevenscenes": ("sevenscenes", 1e-9, False, False),
    "neuralrgbd": ("neuralrgbd", 1e-9, True, False),
    "monosdf": ("monosdf", 1e-9, False, False),
    "sdfstudio": ("sdfstudio", 1e-9, False, False),
    "polycam": ("polycam", 1e-9, True, False),
    "polycam_zip": ("polycam", 1e-9, True, False),
    "record3d": ("record3d", 1e-9, False, False),
    "record3d_archive": ("record3d", 1e-9, True, False),
    "stray": ("stray", 1e-9, True, False),
    "arkitscenes": ("arkitscenes", 1e-9, True, False),
    "open3d": ("open3d", 1e-9, True, False),
    "metashape": ("metashape", 1e-9, False, False),
    "ros1": ("ros", 1e-9, True, False),
    "ros2": ("ros", 1e-9, True, False),
    "ros_mcap": ("ros", 1e-9, True, False),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_same_scene_in_every_layout(written, settings, made, name):
    layout, exact, has_depth, has_points = LAYOUTS[name]
    scene = read_scene(settings(written(name), **TOLD.get(name, {})))
    assert scene.layout == layout
    frames = scene.frames
    assert len(frames) == len(made.poses) and not scene.dropped
    for frame, pose, photo, depth in zip(frames, made.poses, made.photos, made.depths, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=max(exact, 1e-12))
        np.testing.assert_allclose(frame.camera.K, made.K, atol=1e-5 if layout == "sens" else 1e-9)
        assert frame.camera.size == photo.shape[1::-1]
        assert np.abs(frame.color()[..., ::-1].astype(int) - photo).mean() < 12.0  # JPEG, MPEG; others differ by 60
        if has_depth:
            np.testing.assert_allclose(frame.depth(), depth / 1000, atol=1e-6)
        else:
            assert frame.depth() is None
    assert (scene.given_points is not None) == has_points
    if has_points:
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
def test_a_layout_by_its_name_is_the_one_that_is_found(written, settings, name):
    root = written(name)
    config = settings(root)
    assert reader_of(config, Listing(root)).name == LAYOUTS[name][0]
    told = TOLD.get(name, {})
    named = read_scene(settings(root, layout=LAYOUTS[name][0], **told))
    np.testing.assert_array_equal(
        np.stack([frame.camera.cam_from_world for frame in named.frames]),
        np.stack([frame.camera.cam_from_world for frame in read_scene(settings(root, **told)).frames]),
    )


def test_every_reader_has_a_fixture():
    assert {layout for layout, *_ in LAYOUTS.values()} == set(READERS)


def test_a_folder_of_ten_thousand_files_is_known_at_once(written, settings):
    root = written("scannet")
    for i in range(10_000):
        (root / "color" / f"{i + 100}.jpg").touch()
        (root / f"note{i}.txt").touch()
    start = time.process_time()
    assert reader_of(settings(root), Listing(root)).name == "scannet"
    assert time.process_time() - start < 1.0
