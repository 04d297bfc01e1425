"""Keys that a layout does not know are named once; those that would bend the geometry unread are refused."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError

EYE = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
# layout, file, the object in it that holds the camera
CAMERAS = [
    ("replica", "../cam_params.json", lambda meta: meta["camera"]),
    ("record3d", "metadata.json", lambda meta: meta),
    ("sdfstudio", "meta_data.json", lambda meta: meta),
    ("sdfstudio", "meta_data.json", lambda meta: meta["frames"][3]),
    ("polycam", "keyframes/corrected_cameras/40221379.json", lambda meta: meta),
    ("open3d", "intrinsic.json", lambda meta: meta),
]


@pytest.fixture
def with_key(written, made):
    """`with_key(name, file, place, key, value)` gives a capture whose file has a key more."""

    def write(name, file, place, key, value):
        root = written(name)
        path = root / file
        if name == "open3d":
            meta = {"width": made.width, "height": made.height}
            path.write_text(json.dumps({**meta, "intrinsic_matrix": made.K_at_integers[:3, :3].T.ravel().tolist()}))
        meta = json.loads(path.read_text())
        place(meta)[key] = value
        path.write_text(json.dumps(meta))
        return root

    return write


@pytest.mark.parametrize(("name", "file", "place"), CAMERAS)
def test_an_unknown_key_is_named_once(with_key, settings_of, made, name, file, place):
    root = with_key(name, file, place, "sensorTilt", 3)
    notes = read_scene(settings_of(root, name)).notes
    assert sum("sensorTilt" in note for note in notes) == 1


@pytest.mark.parametrize(("name", "file", "place"), CAMERAS)
def test_distortion_of_nothing_is_no_news(with_key, settings_of, name, file, place):
    scene = read_scene(settings_of(with_key(name, file, place, "k1", 0.0), name))
    assert len(scene.frames) == 6 and not any("k1" in note for note in scene.notes)


@pytest.mark.parametrize(("name", "file", "place"), CAMERAS)
def test_distortion_is_not_passed_over(with_key, settings_of, name, file, place):
    root = with_key(name, file, place, "k1", -0.2)
    try:
        scene = read_scene(settings_of(root, name))
    except InputError as error:
        assert "has distortion (k1)" in str(error)
        return
    assert len(scene.frames) == 5 and "has distortion (k1)" in scene.dropped[0].reason


def test_a_column_that_stray_scanner_does_not_write_is_named(written, settings_of):
    path = written("stray") / "odometry.csv"
    head, *lines = path.read_text().splitlines()
    path.write_text("\n".join([f"{head}, rolling_shutter", *(f"{line}, 0.02" for line in lines)]))
    assert any("rolling_shutter" in note for note in read_scene(settings_of(path.parent, "stray")).notes)


def test_open3d_s_depth_scale_is_used(with_key, settings_of, made):
    root = with_key("open3d", "intrinsic.json", lambda meta: meta, "depth_scale", 500.0)
    frame = read_scene(settings_of(root, "open3d")).frames[0]
    np.testing.assert_allclose(frame.depth(), made.depths[0] / 500, atol=1e-5)


@pytest.mark.parametrize("name", ["scannet", "scannet_flat", "sens"])
def test_a_depth_camera_in_another_place_is_told(written, settings_of, name):
    root = written(name)
    apart = np.array(EYE)
    assert not read_scene(settings_of(root, name)).warnings
    apart[0, 3] = 0.025
    if name == "scannet":
        np.savetxt(root / "intrinsic/extrinsic_color.txt", np.eye(4))
        np.savetxt(root / "intrinsic/extrinsic_depth.txt", apart)
    elif name == "scannet_flat":
        with (root / "_info.txt").open("a") as file:
            file.write(f"m_calibrationDepthExtrinsic = {' '.join(map(str, apart.ravel()))}\n")
    else:
        path = root / "scene0000_00.sens"
        data = bytearray(path.read_bytes())
        place = 12 + 15 + 3 * 64
        data[place : place + 64] = struct.pack("<16f", *apart.ravel())
        path.write_bytes(data)
    (said,) = read_scene(settings_of(root, name)).warnings
    assert "25 mm from the photos'" in said
