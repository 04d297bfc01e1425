"""COLMAP models whose poses were known before have no points; masks may lie beside photos in images/."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.captures.read import read_scene


def told(scene) -> str:
    return " ".join((*scene.notes, *scene.warnings))


@pytest.mark.parametrize("empty", [True, False])
def test_a_model_without_points_is_read_and_told(written, settings, made, empty):
    root = written("colmap")
    path = root / "sparse/0/points3D.txt"
    path.write_text("") if empty else path.unlink()
    scene = read_scene(settings(root))
    assert scene.given_points is None
    assert max(np.abs(f.camera.world_from_cam - p).max() for f, p in zip(scene.frames, made.poses, strict=True)) < 1e-9
    assert "has no points" in told(scene)
    assert "points3D.ply" not in told(scene)


def test_a_ply_in_the_points_place_is_named_with_the_settings_that_read_it(written, settings):
    root = written("colmap")
    (root / "sparse/0/points3D.txt").rename(root / "sparse/0/points3D.ply")
    assert f"points.source=file points.file={root / 'sparse/0/points3D.ply'}" in told(read_scene(settings(root)))


@pytest.mark.parametrize("folder", ["masks", "mask"])
def test_masks_in_a_folder_of_the_photos_folder(written, settings, folder):
    root = written("colmap")
    mask = np.full((72, 96), 255, np.uint8)
    mask[:36] = 0
    for photo in list((root / "images").rglob("*.jpg")):
        path = root / "images" / folder / "walk one" / f"{photo.name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), mask)
    scene = read_scene(settings(root))
    assert [frame.mask().mean() for frame in scene.frames] == [0.5] * 6
    assert "has poses of" not in told(scene)  # masks are no photos without a pose


def test_maps_beside_photos_are_no_photos_without_a_pose(written, settings):
    root = written("colmap")
    for photo in list((root / "images").rglob("*.jpg")):
        for end in ("_mask.png", "_depth.png"):
            cv2.imwrite(str(photo.with_name(photo.stem + end)), np.zeros((72, 96), np.uint8))
    assert "has poses of" not in told(read_scene(settings(root)))


def test_smaller_copies_of_the_photos_stand_in_for_them(written, settings, made):
    root = written("colmap")
    (root / "images").rename(root / "images_2")
    for photo in (root / "images_2").rglob("*.jpg"):
        cv2.imwrite(str(photo), cv2.resize(cv2.imread(str(photo)), (48, 36), interpolation=cv2.INTER_AREA))
    camera = read_scene(settings(root)).frames[0].camera
    assert camera.size == (48, 36)
    np.testing.assert_allclose(camera.K[:2], made.K[:2] / 2)


def test_a_link_that_leads_back_makes_no_photos(written, settings):
    root = written("colmap")
    (root / "images/loop").symlink_to(root / "images")
    assert "has poses of" not in told(read_scene(settings(root)))
