"""Files that are cut, changed or lie: a scene or one sentence, and neither a traceback nor memory beyond the file."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs.captures.archives import Archive
from room2dgs.captures.colmap_model import read_model
from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError

INTRINSICS = [81.0, 84.0, 46.0, 36.75]
NO_INTRINSICS = ("tum", "sevenscenes", "neuralrgbd", "open3d")
# a file of each layout that its reader parses
PARSED = {
    "scannet": "pose/4.txt",
    "scannet_flat": "_info.txt",
    "sens": "scene0000_00.sens",
    "colmap": "sparse/0/images.txt",
    "colmap_binary": "sparse/images.bin",
    "nerfstudio": "transforms.json",
    "scannetpp_dslr": "dslr/train_test_lists.json",
    "replica": "traj.txt",
    "tum": "groundtruth.txt",
    "sevenscenes": "seq-01/frame-000001.pose.txt",
    "neuralrgbd": "poses.txt",
    "monosdf": "cameras.npz",
    "sdfstudio": "meta_data.json",
    "polycam": "keyframes/corrected_cameras/40221379.json",
    "polycam_zip": "capture.zip",
    "record3d": "metadata.json",
    "record3d_archive": "room.r3d",
    "stray": "odometry.csv",
    "arkitscenes": "41069021_frames/lowres_wide.traj",
    "open3d": "scene/trajectory.log",
    "metashape": "cameras.xml",
    "ros1": "walk.bag",
    "ros2": "walk.db3",
    "ros_mcap": "ros_mcap.mcap",
}
WORDS = st.sampled_from(
    [b"nan", b"-inf", b"1e999", b"-1", b"null", b"[]", b"{}", b"\x00", b"\xff\xfe", b"", b"9" * 400]
)


def damaged(data: bytes, where: float, kind: str, word: bytes) -> bytes:
    place = int(where * len(data))
    if kind == "cut":
        return data[:place]
    if kind == "overwritten":
        return data[:place] + word + data[place + len(word) :]
    if kind == "zeroed":
        return data[:place] + bytes(min(64, len(data) - place)) + data[place + 64 :]
    return data[:place] + word + data[place:]


@pytest.mark.parametrize("name", PARSED)
def test_damage_gives_a_scene_or_a_sentence(written, default_config, name):
    from dataclasses import replace

    root = written(name)
    path = root / PARSED[name]
    whole = path.read_bytes()
    told = (
        {"intrinsics": INTRINSICS, "pixel_centres": "integer"} if name in NO_INTRINSICS else {"pose_frame": "optical"}
    )
    config = replace(default_config.scene, path=str(root), test_every=0, **told)

    @settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(st.floats(0, 1), st.sampled_from(["cut", "overwritten", "zeroed", "put in"]), WORDS)
    def read(where: float, kind: str, word: bytes) -> None:
        path.write_bytes(damaged(whole, where, kind, word))
        try:
            scene = read_scene(config)
            if scene.given_points is not None:
                scene.given_points()
            for frame in scene.frames:
                assert np.isfinite(frame.camera.cam_from_world).all() and np.isfinite(frame.camera.K).all()
        except InputError as error:
            assert "\n" not in str(error)

    read()


def test_counts_that_lie_ask_for_no_memory(tmp_path):
    (tmp_path / "cameras.bin").write_bytes(struct.pack("<QIiQQ4d", 1, 3, 1, 96, 72, 81, 84, 46, 37))
    (tmp_path / "images.bin").write_bytes(struct.pack("<Q", 2**60))
    with pytest.raises(InputError, match="no room"):
        read_model(tmp_path)
    image = struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 0, 3) + b"a.jpg\0" + struct.pack("<Q", 2**59)
    (tmp_path / "images.bin").write_bytes(image)
    with pytest.raises(InputError, match="no room"):
        read_model(tmp_path)


def test_paths_do_not_lead_out_of_the_capture(written, default_config):
    from dataclasses import replace

    root = written("nerfstudio")
    text = (root / "transforms.json").read_text()
    (root / "transforms.json").write_text(text.replace("images/frame_00009.png", "../../../etc/passwd"))
    with pytest.raises(InputError, match="outside"):
        read_scene(replace(default_config.scene, path=str(root)))


def test_an_entry_that_is_larger_than_it_may_be_is_not_unpacked(tmp_path: Path):
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("keyframes/x", "w") as file:
        for _ in range(300):
            file.write(bytes(1 << 20))
    assert path.stat().st_size < 1 << 20
    with pytest.raises(InputError, match="300 MiB"):
        Archive(path, "keyframes/").read("keyframes/x")
    shutil.rmtree(tmp_path)


SENS_GB, SENS_PART = 5, 4 << 20  # of the whole file, and of what follows a photo in each frame


@pytest.mark.slow
def test_a_sens_of_5_gb_is_read_frame_by_frame(written, tmp_path):
    """Sparse on the disk: behind each photo lie 4 MB of zeros, which decoders leave alone."""
    small = (written("sens") / "scene0000_00.sens").read_bytes()
    header, pose = bytearray(small[: 12 + 15 + 4 * 64 + 36]), small[12 + 15 + 4 * 64 + 36 :][:64]
    width, height = 640, 480
    header[-28:-12] = struct.pack("<4I", width, height, 16, 12)
    header[12 + 15 : 12 + 15 + 64] = np.array(
        [[600.0, 0, 319.5, 0], [0, 600, 239.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "<f4"
    ).tobytes()
    header[12 + 15 + 128 : 12 + 15 + 192] = np.array(
        [[15.0, 0, 7.5, 0], [0, 15, 5.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "<f4"
    ).tobytes()
    frames = (SENS_GB << 30) // SENS_PART
    header[-8:] = struct.pack("<Q", frames)
    photo = cv2.imencode(".jpg", np.full((height, width, 3), 99, np.uint8))[1].tobytes()
    depth = zlib.compress(np.full((12, 16), 1500, "<u2").tobytes())
    path = tmp_path / "large.sens"
    with path.open("wb") as file:
        file.write(header)
        for index in range(frames):
            file.write(pose + struct.pack("<4Q", index, index, len(photo) + SENS_PART, len(depth)) + photo)
            file.seek(SENS_PART, os.SEEK_CUR)
            file.write(depth)
    assert path.stat().st_size > SENS_GB << 30
    # not ru_maxrss, which a child inherits from whoever started it
    code = f"""
from room2dgs.config import load_config
from room2dgs.captures.read import read_scene
scene = read_scene(load_config(["scene.path={path}", "out=unused", "scene.frames=12", "scene.test_every=0"]).scene)
assert len(scene.frames) == 12 and scene.frames[-1].index > 1200
assert abs(scene.frames[-1].depth().max() - 1.5) < 1e-6 and scene.frames[5].color()[0, 0, 0] == 99
status = open("/proc/self/status").read()
print(int(status.partition("VmHWM:")[2].split()[0]) // 1024)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    path.unlink()
    assert done.returncode == 0, done.stderr
    peak = int(done.stdout.split()[-1])
    assert peak < 700, peak  # MB


def test_a_frame_that_claims_gigabytes_is_refused_before_it_is_read(written, default_config):
    from dataclasses import replace

    path = written("sens") / "scene0000_00.sens"
    data = bytearray(path.read_bytes())
    place = 12 + 15 + 4 * 64 + 36 + 64 + 16
    data[place : place + 8] = struct.pack("<Q", 3 << 30)
    with path.open("wb") as file:
        file.write(data)
        file.truncate(4 << 30)
    with pytest.raises(InputError, match="3221225472 bytes for 96x72 pixels"):
        read_scene(replace(default_config.scene, path=str(path)))
