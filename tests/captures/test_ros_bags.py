"""ROS bags: what is ambiguous is asked, poses lead from the camera to the root, pixels become RGB and metres."""

from __future__ import annotations

import bz2
import struct
import tracemalloc
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from room2dgs.captures.read import placed, read_scene
from room2dgs.captures.readers.ros_bag import Bag
from room2dgs.captures.readers.ros_images import COLOURS, RawPhoto, depth_numbers, lens_of, registered
from room2dgs.errors import InputError

START = 1_700_000_000_000_000_000
TENTH = 100_000_000
K = np.array([[81.0, 0, 46.0], [0, 84.0, 36.75], [0, 0, 1]])
PHOTO = np.full((72, 96, 3), 128, np.uint8)


def turned(angle: float, *t: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_rotvec([0, 0, angle]).as_matrix(), t
    return pose


def walk(ros, count: int = 8, photo: bool = True):
    """Pictures of `optical` every 0.1 s."""
    for i in range(count):
        stamp = START + i * TENTH
        if photo:
            yield "/cam/image", stamp, ros.image("optical", stamp, PHOTO, "rgb8")
        yield "/cam/camera_info", stamp, ros.info("optical", stamp, K)


def moving(ros, count: int = 8, parent: str = "odom", child: str = "base", early: int = 0):
    """x = seconds since the start, and the same in radians about z."""
    for i in range(-1, count + 1):
        stamp = START + i * TENTH - early
        seconds = (stamp - START) * 1e-9
        yield "/tf", stamp, ros.transforms(ros.transform(parent, child, stamp, turned(seconds, seconds, 0, 0)))


def poses(ros, topic: str = "/pose", count: int = 8):
    for i in range(count):
        yield topic, START + i * TENTH, ros.pose("map", START + i * TENTH, turned(0.0, 0.1 * i, 0, 0))


@pytest.fixture
def bag(ros_messages, tmp_path, settings):
    """`bag(lambda ros: messages, **changes)` reads the scene of a bag with them."""

    def read(make, reader=placed, **changes):
        path = tmp_path / "walk.bag"
        path.unlink(missing_ok=True)
        ros = ros_messages(True)
        ros.write(path, sorted(make(ros), key=lambda entry: entry[1]))
        return reader(settings(path, **changes))

    return read


def test_poses_are_blended_at_the_pictures_stamps_along_the_tree(bag):
    """/tf comes between the pictures; the root is two transforms above the robot, the camera one below it."""
    optical, map_from_odom = turned(0.3, 0.1, 0.2, 0.3), turned(-0.5, 5, 6, 7)

    def messages(ros):
        yield from walk(ros)
        yield from moving(ros, early=40_000_000)
        fixed = ros.transform("base", "optical", START, optical), ros.transform("map", "odom", START, map_from_odom)
        # as ROS 1's static_transform_publisher sends them
        for i in range(3):
            yield "/tf", START + i, ros.transforms(*fixed)

    frames = bag(messages).frames
    assert len(frames) == 8
    for i, frame in enumerate(frames):
        expected = map_from_odom @ turned(0.1 * i, 0.1 * i, 0, 0) @ optical
        np.testing.assert_allclose(frame.camera.world_from_cam, expected, atol=1e-7)


def test_pictures_without_a_pose_in_time_are_left_out_by_name(bag):
    def messages(ros):
        yield from walk(ros)
        for topic, stamp, message in poses(ros):
            if stamp >= START + 4 * TENTH:  # tracking began late
                yield topic, stamp, message

    scene = bag(messages, pose_frame="optical")
    assert [frame.name for frame in scene.frames] == [f"{i:06d}" for i in range(4, 8)]
    assert [lost.name for lost in scene.dropped] == [f"{i:06d}" for i in range(4)]
    assert "no pose near" in scene.dropped[0].reason


def second_camera(ros):
    for topic, stamp, message in walk(ros):
        yield topic.replace("cam", "other"), stamp, message


def odometry(ros, child: str):
    return [("/odom", START + i * TENTH, ros.odometry("odom", child, START + i * TENTH, np.eye(4))) for i in range(8)]


@pytest.mark.parametrize(
    ("make", "said", "mends"),
    [
        (
            lambda ros: [*walk(ros), *second_camera(ros), *poses(ros)],
            r"pictures in /cam/image and /other/image; say which with scene\.topics=\[/cam/image\]",
            {"topics": ["/cam/image", "/cam/camera_info"], "pose_frame": "optical"},
        ),
        (
            lambda ros: [*walk(ros), *moving(ros, child="optical"), *poses(ros)],
            r"poses in /tf and /pose; say which with scene\.topics=\[/tf\]",
            {"topics": ["/tf"]},
        ),
        (
            lambda ros: [*walk(ros), *poses(ros)],
            r"does not say in /pose whose poses they are; give scene\.pose_frame=optical",
            {"pose_frame": "optical"},
        ),
        (
            lambda ros: [*walk(ros), *odometry(ros, "base")],
            r"poses of base in /odom and no transform from there to the pictures' optical; record /tf_static",
            {"pose_frame": "optical"},
        ),
        (walk, "has no poses; record /tf", None),
        (lambda ros: [*walk(ros), *moving(ros)], r"none of the pictures' frame optical; record /tf_static", None),
        (
            lambda ros: [*walk(ros), ("/tf", START, ros.transforms(ros.transform("map", "optical", START, np.eye(4))))],
            "/tf holds optical still in map",
            None,
        ),
        (
            lambda ros: [*walk(ros), *moving(ros, child="optical"), *moving(ros, child="optical", parent="map")],
            "hangs the frame optical on odom and on map",
            None,
        ),
        (
            lambda ros: [*walk(ros), *moving(ros, child="optical"), *moving(ros, parent="optical", child="odom")],
            "transforms in a circle",
            None,
        ),
        (poses, r"holds no images .* are geometry_msgs/msg/PoseStamped", None),
        (
            lambda ros: [entry for entry in [*walk(ros), *poses(ros)] if "info" not in entry[0]],
            r"brings no intrinsics; give scene\.intrinsics=\[fx,fy,cx,cy\]",
            {"intrinsics": [81, 84, 46, 37]},
        ),
    ],
)
def test_what_is_not_clear_is_asked_with_the_setting_that_answers(bag, make, said, mends):
    told = {"pose_frame": "optical"} if "intrinsics" in said else {}
    with pytest.raises(InputError, match=said) as error:
        bag(make, **told)
    assert "\n" not in str(error.value)
    if mends is not None:
        assert len(bag(make, **told, **mends).frames) == 8


def test_a_topic_that_is_not_there_is_named(bag):
    with pytest.raises(InputError, match=r"no topic /camera that is read; it has /cam/camera_info, /cam/image"):
        bag(lambda ros: [*walk(ros), *poses(ros)], topics=["/camera"])


def test_depth_of_another_place_is_registered_to_the_pictures(bag):
    """A plane 2 m before the depth camera, which sits 0.1 m behind the colour camera: 1.9 m from there."""
    behind = turned(0.0, 0, 0, -0.1)

    def messages(ros):
        yield from walk(ros)
        yield from moving(ros, child="optical")
        yield "/tf_static", START, ros.transforms(ros.transform("optical", "depth", START, behind))
        for i in range(8):
            stamp = START + i * TENTH + 15_000_000
            yield "/depth/image", stamp, ros.image("depth", stamp, np.full((36, 48), 2000, np.uint16), "16UC1")
            yield "/depth/camera_info", stamp, ros.info("depth", stamp, K * [[0.5], [0.5], [1]])

    scene = bag(messages)
    assert any("registered to the pictures by /tf (100 mm apart)" in note for note in scene.notes)
    depth = scene.frames[3].depth()
    assert (depth > 0).mean() > 0.8
    np.testing.assert_allclose(depth[depth > 0], 1.9, atol=1e-5)


def test_the_nearer_of_two_surfaces_is_what_the_photo_sees():
    depth = np.full((40, 60), 3.0)
    depth[:, 30:] = 1.0
    K = np.array([[50.0, 0, 30], [0, 50, 20], [0, 0, 1]])
    left = np.eye(4)
    left[0, 3] = -0.2  # the colour camera is 0.2 m to the right: near things move 10 pixels to its left, far ones 3.3
    seen = registered(depth, K, left)
    assert (seen[:, 20:50] == 1.0).all() and (seen[:, 50:] == 0).all()
    assert (seen[:, 5:19] == 3.0).all()


@pytest.mark.parametrize("encoding", COLOURS)
def test_every_encoding_gives_its_colour(encoding, ros_messages):
    """One colour all over; brightness alone where there is no more, and within what YUV and Bayer keep."""
    red, green, blue = 200, 120, 40
    y = int(cv2.cvtColor(np.array([[[red, green, blue]]], np.uint8), cv2.COLOR_RGB2GRAY)[0, 0])
    pixels = np.zeros((24, 32, COLOURS[encoding][0]), np.uint8 if COLOURS[encoding][1] == 1 else np.uint16)
    expected = [red, green, blue]
    if encoding.startswith("bayer"):
        for place, letter in enumerate(encoding[6:10]):
            pixels[place // 2 :: 2, place % 2 :: 2, 0] = {"r": red, "g": green, "b": blue}[letter]
    elif encoding.startswith(("yu", "uyvy")):
        first = encoding in ("yuv422_yuy2", "yuyv")
        luma = 16 + (66 * red + 129 * green + 25 * blue) / 256  # BT.601, as video has it
        pixels[..., 0 if first else 1] = round(luma)
        chroma = 1 if first else 0
        pixels[:, 0::2, chroma] = round(128 + (-38 * red - 74 * green + 112 * blue) / 256)
        pixels[:, 1::2, chroma] = round(128 + (112 * red - 94 * green - 18 * blue) / 256)
    elif pixels.shape[2] == 1:
        pixels[:] = y << 8 if pixels.dtype == np.uint16 else y
        expected = [y, y, y]
    else:
        order = [blue, green, red] if encoding.startswith("b") or encoding.startswith("8U") else [red, green, blue]
        pixels[..., :3] = np.array(order) << (8 if pixels.dtype == np.uint16 else 0)
    message = ros_messages(False).image("optical", START, pixels, encoding, pad=3)
    shown = RawPhoto("here", (32, 24), lambda: message).pixels()
    assert shown.shape == (24, 32, 3) and shown.dtype == np.uint8
    assert np.abs(shown[4:-4, 4:-4].astype(int) - expected).max() <= 3


def test_depth_of_compresseddepth_in_metres_is_led_back_by_its_two_numbers(ros_messages):
    metres = np.array([[0.5, 1.0, 2.0, 4.0]], np.float32)
    a, b = 1000.0, 3.0
    data = struct.pack("<i2f", 0, a, b) + cv2.imencode(".png", np.round(a / metres + b).astype(np.uint16))[1].tobytes()
    message = ros_messages(False).packed("optical", START, data, "32FC1; compressedDepth png")
    np.testing.assert_allclose(depth_numbers(message, "32FC1", "here"), metres, rtol=1e-3)
    with pytest.raises(InputError, match="RVL"):
        depth_numbers(SimpleNamespace(format="16UC1; compressedDepth rvl", data=message.data), "16UC1", "here")


def test_camera_info_of_a_part_and_of_binned_pixels(ros_messages):
    """A point keeps its ray: cut 10 pixels off the left and join two by two."""
    info = ros_messages(False).info("optical", START, K, [0.1, -0.02, 0.001, 0.002, 0.3])
    whole = lens_of(info, False, False, "here")
    assert whole.model == "FULL_OPENCV" and whole.params[4:9] == (0.1, -0.02, 0.001, 0.002, 0.3)
    info.roi.x_offset, info.roi.width, info.roi.height = 10, 80, 72
    info.binning_x = info.binning_y = 2
    part = lens_of(info, False, False, "here")
    assert part.size == (40, 36)
    rays = np.array([[0.1, -0.2, 1.0], [-0.3, 0.1, 1.0]])
    np.testing.assert_allclose(part.project(rays), (whole.project(rays) - [10, 0]) / 2, atol=1e-9)
    assert lens_of(info, True, False, "here").model == "PINHOLE"
    info.distortion_model, info.d = "equidistant", np.array([0.1, 0.02, 0.003, 0.0])
    assert lens_of(info, False, False, "here").model == "OPENCV_FISHEYE"
    info.k = np.zeros(9)
    assert lens_of(info, False, False, "here") is None  # as ROS has it: not calibrated


def test_memory_is_that_of_a_few_pictures(ros_messages, tmp_path, settings):
    ros, count = ros_messages(False), 160
    photo = np.zeros((480, 640), np.uint8)

    def messages():
        for i in range(count):
            stamp = START + i * TENTH
            yield "/cam/image", stamp, ros.image("optical", stamp, photo, "mono8")
            yield "/pose", stamp, ros.pose("map", stamp, turned(0.0, 0.1 * i, 0, 0))

    ros.write(tmp_path / "long", messages())
    size = sum(path.stat().st_size for path in (tmp_path / "long").iterdir())
    told = {"intrinsics": [600, 600, 320, 240], "pose_frame": "optical"}
    tracemalloc.start()
    scene = read_scene(settings(tmp_path / "long", **told))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(scene.frames) == count and size > 48e6
    assert peak < size / 4, (peak, size)


def test_packed_data_that_swells_beyond_all_bounds_is_refused(ros_messages, tmp_path, settings, monkeypatch):
    from room2dgs.captures.readers import ros_bag

    monkeypatch.setattr(ros_bag, "MOST_UNPACKED", 1 << 20)
    for name, ros1, storage, packing in (
        ("lz4.bag", True, "", "LZ4"),
        ("bz2.bag", True, "", "BZ2"),
        ("mcap", False, "MCAP", "STORAGE"),
        ("sqlite", False, "SQLITE3", "MESSAGE"),
    ):
        ros = ros_messages(ros1)
        large = np.zeros((1500, 1500), np.uint8)
        entries = [("/cam/image", START + i, ros.image("optical", START + i, large, "mono8")) for i in range(2)]
        ros.write(tmp_path / name, entries, storage, packing)
        with pytest.raises(InputError, match="over 1 MiB"):
            Bag(tmp_path / name).first("/cam/image")


def test_a_bag_without_an_index_and_one_packed_as_a_whole_are_told_how_to_mend(ros_messages, tmp_path, settings):
    ros = ros_messages(True)
    ros.write(tmp_path / "cut.bag", [*walk(ros), *poses(ros)])
    data = bytearray((tmp_path / "cut.bag").read_bytes())
    place = data.index(b"index_pos=") + len(b"index_pos=")
    data[place : place + 8] = bytes(8)  # as a recorder leaves it that was killed
    (tmp_path / "cut.bag").write_bytes(data)
    with pytest.raises(InputError, match=r"not indexed.*rosbag reindex"):
        placed(settings(tmp_path / "cut.bag"))
    (tmp_path / "whole").mkdir()
    (tmp_path / "whole/metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    (tmp_path / "whole/walk_0.db3.zstd").write_bytes(bz2.compress(b""))
    with pytest.raises(InputError, match="packed as a whole; unpack it with `zstd -d"):
        placed(settings(tmp_path / "whole"))


def test_odometry_that_is_lost_costs_its_pictures(bag):
    """RTAB-Map sends zeros, others NaN."""

    def messages(ros):
        yield from walk(ros)
        for i in range(8):
            stamp = START + i * TENTH
            message = ros.odometry("odom", "optical", stamp, turned(0.0, 0.1 * i, 0, 0))
            turn = message.pose.pose.orientation
            if i in (3, 4, 5):
                turn.x = turn.y = turn.z = turn.w = 0.0 if i < 5 else float("nan")
            yield "/odom", stamp, message

    scene = bag(messages)
    assert [one.name for one in scene.dropped] == ["000003", "000004", "000005"]
    assert [round(float(frame.camera.centre[0]), 6) for frame in scene.frames] == [0.0, 0.1, 0.2, 0.6, 0.7]
    assert any("3 in /odom are none" in note for note in scene.notes)
