"""The small maps that a run keeps say which depth lies on the room's planes."""

from __future__ import annotations

import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.depth.completion.planes import Plane
from room2dgs.geometry.camera import Camera
from room2dgs.runs.trust import Trust, read_trust, write_trust

WALL = Plane(np.array([0.0, 0.0, -1.0]), -2.0, 1.0)  # z = 2, towards the camera


def kept(tmp_path, planes, turned=False) -> Trust:
    """Of one view: the left half of the photo shows the wall, the right half something 0.3 m before it."""
    camera = Camera(np.array([[160.0, 0, 80], [0, 160, 60], [0, 0, 1]]), 160, 120, np.eye(4))
    depth = np.full((120, 160), 2.0, np.float32)
    depth[:, 80:] = 1.7
    normal = np.zeros((120, 160, 3), np.float32)
    normal[..., 1 if turned else 2] = -1
    frame = Frame("a", camera, None)
    write_trust(tmp_path / "trust.npz", [frame], {"a": ViewMaps(depth=depth, normal=normal)}, {}, planes)
    return read_trust(tmp_path / "trust.npz")["a"]


def test_what_lies_on_a_plane_is_told(tmp_path):
    on_plane = kept(tmp_path, [WALL]).on_plane
    assert on_plane[:, :79].all() and not on_plane[:, 81:].any()
    assert not kept(tmp_path, []).on_plane.any()
    assert not kept(tmp_path, [WALL], turned=True).on_plane.any()


def test_a_map_of_another_size_is_a_damaged_file(tmp_path):
    kept(tmp_path, [WALL])
    with np.load(tmp_path / "trust.npz") as file:
        arrays = dict(file)
    arrays["0/on_plane"] = arrays["0/on_plane"][:-1]
    np.savez_compressed(tmp_path / "trust.npz", **arrays)
    assert read_trust(tmp_path / "trust.npz") == {}
