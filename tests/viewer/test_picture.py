"""What a viewer draws and finds, and how it keeps its pace; no server, no browser."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from room2dgs.errors import InputError
from room2dgs.runs.page.mesh_views import DrawnMesh
from room2dgs.viewer.pace import LEAST, Pace
from room2dgs.viewer.picture import KINDS, camera_at, cropped, hit, picture
from room2dgs.viewer.server import found_viser

UPRIGHT = np.array([1.0, 0, 0, 0])
FOV = np.radians(60)


def test_without_viser_a_sentence_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(InputError, match=r"pip install 'room2dgs\[view\]'"):
        found_viser()


def test_each_kind_shows_the_wall(wall_surfels):
    camera = camera_at(UPRIGHT, np.zeros(3), FOV, (96, 64))
    seen = {kind: picture(wall_surfels, camera, kind) for kind in KINDS}
    for one in seen.values():
        assert one.pixels.shape == (64, 96, 3) and one.pixels.dtype == np.uint8
        assert np.abs(one.depth[32, 20:70] - 2.0).max() < 1e-3
    color = seen["colour"].pixels
    assert color[32, 30].argmax() == 0 and color[32, 66].argmax() == 2
    assert np.abs(seen["normals"].pixels[32, 30].astype(int) - (128, 128, 255)).max() <= 2  # towards the camera
    with pytest.raises(ValueError, match="error"):
        picture(wall_surfels, camera, "error")


def test_a_camera_is_as_viser_means_it():
    wxyz = np.roll(Rotation.from_euler("y", 90, degrees=True).as_quat(), 1)  # looks along +x of the world
    camera = camera_at(wxyz, np.array([1.0, 2, 3]), FOV, (200, 100))
    assert np.allclose(camera.forward, [1, 0, 0]) and np.allclose(camera.centre, [1, 2, 3])
    top, _ = camera.project(np.array([2.0, 2 - np.tan(FOV / 2), 3]))  # at half the opening above the axis
    assert np.allclose(top, [100, 0])


def test_a_click_finds_the_surface_along_any_ray(wall_surfels):
    origin = np.array([0.3, -0.2, 0.1])
    for target in ([-1.0, 0.4, 2.0], [0.7, -0.6, 2.0], [0.3, -0.2, 2.0]):
        found = hit(wall_surfels, origin, 7.0 * (np.array(target) - origin))
        assert np.linalg.norm(found - target) < 2e-3
    assert hit(wall_surfels, origin, np.array([0, 0, -1.0])) is None


def test_pictures_become_as_large_as_the_rate_allows():
    pace = Pace(10.0)
    for _ in range(60):
        size = pace.size(4 / 3, 4000)
        pace.took(size, size[0] * size[1] * 1e-6)  # a microsecond a pixel: 100,000 pixels in a tenth of a second
    assert 0.9e5 < size[0] * size[1] < 1.1e5
    assert abs(size[0] / size[1] - 4 / 3) < 0.02
    before = size[0]
    pace.fps = 20.0
    assert before / 1.3 < pace.size(4 / 3, 4000)[0] < before  # step by step
    for _ in range(60):
        size = pace.size(4 / 3, 4000)
        pace.took(size, 1.0)  # however slow it gets
    assert size[0] == LEAST
    assert pace.size(4 / 3, 50)[0] <= LEAST


def test_a_mesh_is_shown_and_clicked_as_surfels_are():
    """A run that trained nothing: a wall at z = 2 m whose colour runs from red to blue."""
    corners = np.array([[-2, -2, 2], [2, -2, 2], [2, 2, 2], [-2, 2, 2]], float)
    colors = np.array([[255, 0, 0], [0, 0, 255], [0, 0, 255], [255, 0, 0]], np.uint8)
    wall = DrawnMesh(trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], vertex_colors=colors, process=False))
    seen = {kind: picture(wall, camera_at(UPRIGHT, np.zeros(3), FOV, (96, 64)), kind) for kind in KINDS}
    assert all(np.abs(one.depth - 2.0).max() < 1e-5 for one in seen.values())
    color = seen["colour"].pixels
    assert color[32, 10].argmax() == 0 and color[32, 85].argmax() == 2
    assert np.abs(seen["normals"].pixels[32, 30].astype(int) - (128, 128, 255)).max() <= 2
    assert np.linalg.norm(hit(wall, np.array([0.3, 0, 0]), np.array([0.1, 0, 1.0])) - [0.5, 0, 2]) < 1e-4
    assert hit(wall, np.zeros(3), np.array([0, 0, -1.0])) is None


def test_a_crop_box_leaves_the_splats_inside(wall_surfels):
    low, high = np.array([-1.0, -5, -5]), np.array([0.5, 0.0, 5])
    left = cropped(wall_surfels, low, high)
    centers = left.centers.numpy()
    assert 0 < len(centers) < len(wall_surfels.centers)
    assert (centers >= low - 1e-6).all() and (centers <= high + 1e-6).all()
    inside = ((wall_surfels.centers.numpy() >= low) & (wall_surfels.centers.numpy() <= high)).all(axis=1)
    assert len(centers) == inside.sum() and all(len(part) == len(centers) for part in left)
