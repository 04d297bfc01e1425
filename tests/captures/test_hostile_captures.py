"""Files that are cut, changed or lie: a scene or one sentence, and neither a traceback nor memory beyond the file."""

from __future__ import annotations

import shutil
import struct
import zipfile
from pathlib import Path

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
    told = {"intrinsics": INTRINSICS, "pixel_centres": "integer"} if name in NO_INTRINSICS else {}
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
