"""What the formats' descriptions are not sure of, and numbers that are in no file."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene


def test_metashape_s_p1_and_p2_are_opencv_s_the_other_way_round(written, settings, made):
    """By the formula of Agisoft's manual, "Camera models", frame cameras."""
    path = written("metashape") / "cameras.xml"
    k1, p1, p2 = -0.05, 0.004, -0.009
    path.write_text(
        path.read_text().replace("</calibration>", f"<k1>{k1}</k1><p1>{p1}</p1><p2>{p2}</p2></calibration>")
    )
    lens = read_scene(settings(path.parent)).frames[0].lens
    rays = np.random.default_rng(0).uniform(-0.4, 0.4, (50, 3)) + np.array([0, 0, 1])
    x, y = (rays[:, :2] / rays[:, 2:]).T
    r2 = x * x + y * y
    dx = x * (1 + k1 * r2) + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
    dy = y * (1 + k1 * r2) + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    expected = np.stack([dx, dy], axis=1) * [made.K[0, 0], made.K[1, 1]] + made.K[:2, 2]
    np.testing.assert_allclose(lens.project(rays), expected, atol=1e-6)


def test_neural_rgbd_s_focal_length_middle_and_lost_poses(written, settings, made):
    """554.26 px at 640 pixels of width, cx = W/2; a pose of "nan" was lost, as the data's own loader has it."""
    root = written("neuralrgbd")
    lines = (root / "poses.txt").read_text().splitlines()
    lines[8:12] = ["nan nan nan nan"] * 4
    (root / "poses.txt").write_text("\n".join(lines))
    scene = read_scene(settings(root))
    assert [dropped.name for dropped in scene.dropped] == ["img10"]
    f = 554.2562584220408 * 96 / 640
    np.testing.assert_allclose(scene.frames[0].camera.K, [[f, 0, 48], [0, f, 36], [0, 0, 1]])
    (root / "focal.txt").write_text("100.0\n")
    assert read_scene(settings(root)).frames[0].camera.K[0, 0] == 100.0


def test_stray_scanner_s_lines_may_have_their_own_intrinsics(written, settings, made):
    path = written("stray") / "odometry.csv"
    head, *lines = path.read_text().splitlines()
    own = [f"{line}, {80 + i}, {83 + i}, 47, 36" for i, line in enumerate(lines)]
    path.write_text("\n".join([f"{head}, fx, fy, cx, cy", *own]))
    for i, frame in enumerate(read_scene(settings(path.parent)).frames):
        np.testing.assert_array_equal(frame.camera.K, [[80 + i, 0, 47], [0, 83 + i, 36], [0, 0, 1]])


@pytest.mark.parametrize(("name", "fx", "bent"), [("freiburg1_desk", 517.3, True), ("freiburg3_office", 535.4, False)])
def test_tum_s_intrinsics_by_the_folder_s_name(written, settings, made, tmp_path, name, fx, bent):
    photos = np.stack([cv2.resize(photo, (640, 480)) for photo in made.photos])
    depths = np.stack([cv2.resize(depth, (640, 480), interpolation=cv2.INTER_NEAREST) for depth in made.depths])
    written("tum", made=replace(made, photos=photos, depths=depths))
    (tmp_path / "tum").rename(tmp_path / f"rgbd_dataset_{name}")
    frame = read_scene(settings(tmp_path / f"rgbd_dataset_{name}")).frames[0]
    if bent:  # cx, cy count integers
        assert frame.lens.params[:9] == (517.3, 516.5, 319.1, 255.8, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633)
    else:
        assert frame.lens is None
        np.testing.assert_allclose(frame.camera.K[:2], [[fx, 0, 320.6], [0, 539.2, 248.1]])


def test_seven_scenes_depth_of_65535_is_none(written, settings, made):
    root = written("sevenscenes")
    depth = np.full((480, 640), 1500, np.uint16)
    depth[:, :320] = 65535
    for path in sorted(root.glob("seq-*/*.color.png")):
        cv2.imwrite(str(path).replace("color", "depth"), depth)
    seen = read_scene(settings(root)).frames[0].depth()
    known = seen > 0
    assert 0.2 < known.mean() < 0.6 and np.abs(seen[known] - 1.5).max() < 1e-6
