"""One bad item of many is left out by name and counted; many stop the reading. Odd text is read."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from tests.captures.known_scene import photo_of


@pytest.fixture
def left(settings_of, made):
    """`left(root, name)` reads a capture, whose every frame must be right, and gives the photos that are left and
    all that is told."""

    def read(root, name):
        scene = read_scene(settings_of(root, name))
        found = []
        for frame in scene.frames:
            index = photo_of(frame, made)
            np.testing.assert_allclose(frame.camera.world_from_cam, made.poses[index], atol=1e-6)
            found.append(index)
        return sorted(found), " | ".join((*(one.reason for one in scene.dropped), *scene.notes, *scene.warnings))

    return read


def edited(path, change) -> None:
    path.write_text(change(path.read_text()))


def line_of(number: int, text: str):
    """Replaces a line, counted from 0."""

    def change(whole: str) -> str:
        lines = whole.splitlines()
        lines[number] = text
        return "\n".join(lines) + "\n"

    return change


FRAME = 12 + 15 + 4 * 64 + 36  # where the first frame of the made .sens begins


def sens_frames(data: bytes) -> list[bytes]:
    place, frames = FRAME, []
    while len(frames) < 6:
        color, depth = struct.unpack("<2Q", data[place + 80 : place + 96])
        frames.append(data[place : place + 96 + color + depth])
        place += len(frames[-1])
    return frames


def test_a_sens_frame_without_a_photo(written, left):
    path = written("sens") / "scene0000_00.sens"
    data = path.read_bytes()
    frames = sens_frames(data)
    color, depth = struct.unpack("<2Q", frames[2][80:96])
    frames[2] = frames[2][:80] + struct.pack("<2Q", 0, depth) + frames[2][96 + color :]
    path.write_bytes(data[:FRAME] + b"".join(frames) + bytes(8))
    found, told = left(path.parent, "sens")
    assert found == [0, 1, 3, 4, 5] and "frame 2 has no photo" in told


BAD_LINES = [
    ("tum", "groundtruth.txt", 3, "1305031103.2 1 2 three 0 0 0 1", "line 4"),
    ("tum", "rgb.txt", 3, "1305031103.175304", "line 4"),
    ("stray", "odometry.csv", 3, "0.2, 2, 1, 2", "line 4"),
    ("arkitscenes", "41069021_frames/lowres_wide.traj", 2, "6790.325 1 2 x", "line 3"),
    ("open3d", "scene/trajectory.log", 11, "1 2 3 4 5", "line 11"),
    ("polycam", "keyframes/corrected_cameras/40221379.json", 0, '{"fx": ', "40221379.json"),
    ("arkitscenes", "41069021_frames/lowres_wide_intrinsics/41069021_6790.324.pincam", 0, "96 72", "6790.324.pincam"),
    ("scannet", "pose/4.txt", 0, "1 0 0", "pose/4.txt"),
    ("scannet_flat", "frame-000002.pose.txt", 0, "1 0 0", "frame-000002.pose.txt"),
    ("sevenscenes", "seq-01/frame-000002.pose.txt", 0, "1 0 0", "frame-000002.pose.txt"),
]


@pytest.mark.parametrize(("name", "file", "number", "text", "told"), BAD_LINES)
def test_one_damaged_line_or_file_costs_its_photo(written, left, name, file, number, text, told):
    root = written(name)
    edited(root / file, line_of(number, text))
    found, said = left(root, name)
    assert found == [0, 1, 3, 4, 5] and told in said


@pytest.mark.parametrize(("name", "file"), [("replica", "traj.txt"), ("neuralrgbd", "poses.txt")])
def test_one_damaged_line_of_a_list_without_numbers_costs_its_photo(written, left, name, file):
    root = written(name)
    lines = (root / file).read_text().splitlines()
    at = 2 if name == "replica" else 9
    lines[at] = lines[at].replace("0", "x", 1)
    (root / file).write_text("\n".join(lines))
    found, said = left(root, name)
    assert found == [0, 1, 3, 4, 5] and f"{file} line {at + 1}" in said


def test_a_line_too_many_that_is_damaged_is_not_taken_for_a_pose(written, settings_of):
    """It would move all poses behind it by one."""
    root = written("replica")
    edited(root / "traj.txt", lambda text: "qx qy qz\n" + text)
    with pytest.raises(InputError, match=r"traj\.txt line 1"):
        read_scene(settings_of(root, "replica"))


def change_record3d(meta):
    meta["poses"][2] = [1, 2, 3]


def change_sdfstudio(meta):
    del meta["frames"][2]["camtoworld"]


def no_name(meta):
    del meta["frames"][2]["rgb_path"]


def more_frames(meta):
    meta["frames"].append("nothing")


@pytest.mark.parametrize(
    ("name", "file", "change", "lost"),
    [
        ("record3d", "metadata.json", change_record3d, 2),
        ("sdfstudio", "meta_data.json", change_sdfstudio, 2),
        ("sdfstudio", "meta_data.json", no_name, 2),
        ("sdfstudio", "meta_data.json", more_frames, None),
    ],
)
def test_one_damaged_entry_of_a_json_costs_its_photo(written, left, name, file, change, lost):
    path = written(name) / file
    meta = json.loads(path.read_text())
    change(meta)
    path.write_text(json.dumps(meta))
    found, said = left(path.parent, name)
    assert found == [i for i in range(6) if i != lost]
    assert file in said


@pytest.mark.parametrize("name", ["replica", "scannet", "monosdf", "record3d", "open3d", "stray", "sdfstudio"])
def test_poses_that_are_all_scaled_are_refused(written, settings_of, name):
    """Damage of all is no damage of one."""
    root = written(name)
    if name == "scannet":
        for path in (root / "pose").iterdir():
            np.savetxt(path, np.loadtxt(path) @ np.diag([2.0, 2, 2, 1]))
    elif name == "replica":
        rows = np.loadtxt(root / "traj.txt").reshape(-1, 4, 4) @ np.diag([2.0, 2, 2, 1])
        np.savetxt(root / "traj.txt", rows.reshape(-1, 16), "%.17g")
    elif name == "open3d":
        edited(root / "scene/trajectory.log", lambda text: text.replace("0 0 0 1\n", "0 0 1 1\n"))
    elif name == "monosdf":
        with np.load(root / "cameras.npz") as arrays:
            flat = {key: arrays[key] * [[1], [1], [0], [1]] for key in arrays.files}
        np.savez(root / "cameras.npz", **flat)
    elif name == "stray":
        edited(root / "odometry.csv", lambda text: text.replace("0.", "70."))
    elif name == "record3d":
        meta = json.loads((root / "metadata.json").read_text())
        meta["poses"] = [[9 * value for value in pose] for pose in meta["poses"]]
        (root / "metadata.json").write_text(json.dumps(meta))
    else:
        meta = json.loads((root / "meta_data.json").read_text())
        for frame in meta["frames"]:
            frame["camtoworld"][0][0] = 3.0
        (root / "meta_data.json").write_text(json.dumps(meta))
    with pytest.raises(InputError, match="of 6"):
        read_scene(settings_of(root, name))


ODD_TEXT = {
    "windows": lambda text: text.replace("\n", "\r\n"),
    "mark": lambda text: "\ufeff" + text,
    "blank": lambda text: text.replace("\n", "\n\n") + "\n\n",
    "spaces": lambda text: text.replace(" ", "  ").replace("\n", " \n"),
    "tabs": lambda text: text.replace(", ", ",").replace(" ", "\t"),
    "comments": lambda text: text + "\n# the end\n",
}
TEXTS = {
    "scannet": ("pose/4.txt", "intrinsic/intrinsic_color.txt"),
    "scannet_flat": ("_info.txt", "frame-000001.pose.txt"),
    "replica": ("traj.txt",),
    "tum": ("rgb.txt", "depth.txt", "groundtruth.txt"),
    "neuralrgbd": ("poses.txt",),
    "open3d": ("scene/trajectory.log",),
    "stray": ("odometry.csv", "camera_matrix.csv"),
    "arkitscenes": ("41069021_frames/lowres_wide.traj",),
    "sevenscenes": ("seq-01/frame-000001.pose.txt",),
}


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("odd", ODD_TEXT)
def test_text_as_other_programs_write_it(written, left, name, odd):
    root = written(name)
    for file in TEXTS[name]:
        text = ODD_TEXT[odd]((root / file).read_text())
        if (odd == "comments" and file in ("odometry.csv", "_info.txt")) or (odd, name) == ("comments", "sevenscenes"):
            continue
        (root / file).write_bytes(text.encode())
    assert left(root, name)[0] == list(range(6))


@pytest.mark.parametrize("name", ["replica", "tum", "neuralrgbd", "open3d", "scannet", "arkitscenes"])
def test_commas_between_numbers(written, left, name):
    root = written(name)
    for file in TEXTS[name]:
        edited(root / file, lambda text: "\n".join(_commas(line) for line in text.splitlines()))
    assert left(root, name)[0] == list(range(6))


def _commas(line: str) -> str:
    return line if line.startswith("#") else ", ".join(line.split())
