"""Photos, maps or lines of a layout are gone: what is left keeps its own pose and depth, or a sentence says why not."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from tests.captures.known_scene import known, photo_of, wrong


@pytest.fixture
def checked(settings_of, made):
    """`checked(root, name)` reads a capture, whose every frame must be right, and gives the scene."""

    def check(root, name):
        scene = read_scene(settings_of(root, name))
        for frame in scene.frames:
            index = photo_of(frame, made)
            np.testing.assert_allclose(frame.camera.world_from_cam, made.poses[index], atol=1e-9)
            np.testing.assert_allclose(frame.camera.K, made.K, atol=1e-9)
            depth = frame.depth()
            if depth is not None:
                np.testing.assert_allclose(depth, made.depths[index] / 1000, atol=1e-6)
        return scene

    return check


@pytest.fixture
def refused(settings_of):
    def check(root, name, *words):
        with pytest.raises(InputError) as caught:
            read_scene(settings_of(root, name))
        for word in words:
            assert word in str(caught.value), str(caught.value)

    return check


THINNED = {  # photos, and what makes one of a number
    "replica": "results/frame{:06d}.jpg",
    "monosdf": "{:06d}_rgb.png",
    "record3d": "rgb/{}.jpg",
    "open3d": "color/{:05d}.jpg",
}


@pytest.mark.parametrize("name", THINNED)
@pytest.mark.parametrize("gone", [(1, 3, 5), (0, 1, 2)])
def test_photos_that_are_gone_move_no_poses(written, checked, name, gone):
    root = written(name)
    for i in gone:
        (root / THINNED[name].format(i)).unlink()
    scene = checked(root, name)
    assert len(scene.frames) == 3
    assert any("poses: 3 of the 6" in note for note in scene.notes)


@pytest.mark.parametrize(
    ("name", "photo", "depth"),
    [
        ("replica", "results/frame{:06d}.jpg", "results/depth{:06d}.png"),
        ("open3d", "color/{:05d}.jpg", "depth/{:05d}.png"),
        ("scannet", "color/{}.jpg", "depth/{}.png"),
    ],
)
def test_depth_that_is_gone_moves_no_depth(written, checked, name, photo, depth):
    step = 2 if name == "scannet" else 1
    root = written(name)
    for i in (1, 2):
        (root / depth.format(step * i)).unlink()
    (root / photo.format(step * 3)).unlink()
    scene = checked(root, name)
    assert [frame.depth_path is not None for frame in scene.frames] == [True, False, False, True, True]


def test_neural_rgbd_s_photos_from_8_on_are_known_by_their_depth_maps(written, checked, refused):
    root = written("neuralrgbd")
    for i in (8, 11, 12):
        (root / f"images/img{i}.png").unlink()
    scene = checked(root, "neuralrgbd")
    assert [frame.name for frame in scene.frames] == ["img9", "img10", "img13"]
    for i in (9, 12):
        (root / f"depth/depth{i}.png").unlink()
    refused(root, "neuralrgbd", "poses.txt has 6 poses for 3 photos, numbered 8 to 13")


@pytest.mark.parametrize(
    ("name", "list_", "lines"),
    [("replica", "traj.txt", slice(2, 3)), ("neuralrgbd", "poses.txt", slice(4, 8))],
)
def test_a_pose_that_is_gone_from_a_list_without_numbers_is_refused(written, refused, name, list_, lines):
    path = written(name) / list_
    kept = path.read_text().splitlines()
    del kept[lines]
    path.write_text("\n".join(kept))
    refused(path.parent, name, f"{list_} has 5 poses for 6 photos")


def test_replica_s_depth_maps_tell_that_lines_are_gone_as_well(written, refused):
    root = written("replica")
    for i in (4, 5):
        (root / f"results/frame{i:06d}.jpg").unlink()
    path = root / "traj.txt"
    path.write_text("\n".join(path.read_text().splitlines()[1:]))
    refused(root, "replica", "traj.txt has 5 poses for 4 photos, numbered 0 to 5")


def test_photos_whose_names_have_no_numbers_go_by_place_where_none_is_missing(written, made, checked, refused):
    root = written("monosdf")
    (root / "image").mkdir()
    for i, word in enumerate(("ape", "bee", "cat", "dog", "elk", "fox")):
        (root / f"{i:06d}_rgb.png").rename(root / f"image/{word}.png")
    assert len(checked(root, "monosdf").frames) == 6
    (root / "image/bee.png").unlink()
    refused(root, "monosdf", "cameras.npz has 6 poses for 5 photos")


def test_monosdf_s_matrices_that_are_gone_cost_their_photos(written, checked):
    root = written("monosdf")
    with np.load(root / "cameras.npz") as arrays:
        kept = {name: arrays[name] for name in arrays.files if name not in ("world_mat_2", "world_mat_5")}
    np.savez(root / "cameras.npz", **kept)
    scene = checked(root, "monosdf")
    assert {one.name: one.reason for one in scene.dropped} == {
        "000002": "cameras.npz has no world_mat_2",
        "000005": "cameras.npz has no world_mat_5",
    }


def test_open3d_s_log_may_have_fewer_frames_and_photos_from_1_on_need_all(written, checked, refused):
    root = written("open3d")
    path = root / "scene/trajectory.log"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:10] + lines[15:25]))
    scene = checked(root, "open3d")
    assert [one.name for one in scene.dropped] == ["00002", "00005"]
    path.write_text("\n".join(lines))
    for folder, end in (("color", "jpg"), ("depth", "png")):
        for i in reversed(range(6)):
            (root / f"{folder}/{i:05d}.{end}").rename(root / f"{folder}/{i + 1:05d}.{end}")
    assert len(checked(root, "open3d").frames) == 6
    (root / "color/00006.jpg").unlink()
    assert len(checked(root, "open3d").frames) == 5  # depth tells
    (root / "depth/00006.png").unlink()
    refused(root, "open3d", "trajectory.log has 6 poses for 5 photos, numbered 1 to 5")


def test_stray_s_lines_without_a_frame_s_number_are_as_many_as_the_video_s_frames(written, checked, refused):
    root = written("stray")
    path = root / "odometry.csv"
    numbered = path.read_text().splitlines()
    path.write_text("\n".join(line for i, line in enumerate(numbered) if i not in (2, 4)))
    assert len(checked(root, "stray").frames) == 4
    plain = [", ".join(text for place, text in enumerate(line.split(", ")) if place != 1) for line in numbered]
    path.write_text("\n".join(plain))
    assert len(checked(root, "stray").frames) == 6
    path.write_text("\n".join(plain[:3] + plain[4:]))
    refused(root, "stray", "odometry.csv has 5 poses", "rgb.mp4 has 6 frames")


def test_record3d_s_lists_of_unlike_lengths_are_refused(written, refused, checked):
    root = written("record3d")
    path = root / "metadata.json"
    meta = json.loads(path.read_text())
    meta["frameTimestamps"] = [0.1 * i for i in range(6)]
    path.write_text(json.dumps(meta))
    assert len(checked(root, "record3d").frames) == 6
    path.write_text(json.dumps({**meta, "poses": meta["poses"][:2] + meta["poses"][3:]}))
    (root / "rgb/5.jpg").unlink()
    refused(root, "record3d", "5 poses and 6 frameTimestamps")
    path.write_text(json.dumps({**meta, "perFrameIntrinsicCoeffs": [[81, 84, 46.5, 37.25]] * 5}))
    refused(root, "record3d", "6 poses and 5 perFrameIntrinsicCoeffs")


@pytest.mark.parametrize("what", ["depth/{}.png", "pose/{}.txt"])
def test_scannet_s_zero_padded_files_belong_to_the_same_number(written, checked, what):
    root = written("scannet")
    for i in range(6):
        (root / what.format(2 * i)).rename(root / what.format(f"{2 * i:06d}"))
    scene = checked(root, "scannet")
    assert len(scene.frames) == 6 and all(frame.depth_path is not None for frame in scene.frames)


def test_tum_s_poses_that_are_gone_are_not_blended_of_others(written, settings_of, made, checked):
    """Poses at the photos' own times, ten a second."""
    root = written("tum")
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        lines = []
        for line in (root / name).read_text().splitlines():
            stamp, _, rest = line.partition(" ")
            shift = "" if line.startswith("#") else f"{1000 + (float(stamp) - 1305031102.175304) / 5:.6f}"
            lines.append(f"{shift or stamp} {rest}")
        (root / name).write_text("\n".join(lines))
    assert len(checked(root, "tum").frames) == 6
    lines = (root / "groundtruth.txt").read_text().splitlines()
    (root / "groundtruth.txt").write_text("\n".join(lines[:3] + lines[4:]))
    scene = checked(root, "tum")
    assert len(scene.frames) == 5 and "no pose near its time" in scene.dropped[0].reason
    names = sorted(path.name for path in (root / "depth").iterdir())
    (root / "depth" / names[0]).unlink()
    scene = checked(root, "tum")
    assert sum(frame.depth_path is not None for frame in scene.frames) == 4
    assert any("names 6 depth maps, 1 of them" in note for note in scene.notes)


def test_depth_that_fits_no_photo_is_warned_of_in_every_layout(written, settings_of):
    for name, depth in (("scannet", "depth"), ("open3d", "depth"), ("polycam", "keyframes/depth"), ("stray", "depth")):
        root = written(name)
        for path in list((root / depth).iterdir()):
            path.rename(path.with_name(f"{path.stem}x{path.stem}y.npz"))
        scene = read_scene(settings_of(root, name))
        assert all(frame.depth_path is None for frame in scene.frames)
        assert any(f"{depth} has 6 files, and none is the depth map of a photo" in said for said in scene.warnings), (
            name
        )


def test_masks_that_a_layout_does_not_read_are_warned_of(written, settings_of, made):
    root = written("replica")
    (root / "masks").mkdir()
    for i in range(made.count):
        cv2.imwrite(str(root / f"masks/frame{i:06d}.png"), np.zeros((made.height, made.width), np.uint8))
    assert any("masks has 6 files" in said for said in read_scene(settings_of(root, "replica")).warnings)
    truth = known(read_scene(settings_of(root, "replica")), made)
    assert not wrong(read_scene(settings_of(root, "replica")), made, truth)
