"""ROS bags: a robot in /tf, odometry, stamped poses."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np

from room2dgs.tools.capture_layouts.made import Made
from room2dgs.tools.capture_layouts.ros_messages import RosMessages

ROS_START = 1_700_000_000_123_456_789


# the camera on a robot: x of the base is forward, z is up
BASE_FROM_OPTICAL = np.array([[0.0, 0, 1, 0.2], [-1, 0, 0, 0.05], [0, -1, 0, 1.1], [0, 0, 0, 1]])


def ros_stamps(count: int) -> list[int]:
    return [ROS_START + 400_000_000 * i for i in range(count)]


def ros1(root: Path, made: Made) -> None:
    """Raw pictures, depth in millimetres, a robot in /tf with its camera in /tf_static; recorded later than stamped."""
    ros, messages = RosMessages(True), []
    fixed = ros.transform("base_link", "optical", ROS_START, BASE_FROM_OPTICAL)
    messages.append(("/tf_static", ROS_START, ros.transforms(fixed)))
    for i, (pose, stamp) in enumerate(zip(made.poses, ros_stamps(made.count), strict=True)):
        time = stamp + 30_000_000
        base = ros.transform("/odom", "/base_link", stamp, pose @ np.linalg.inv(BASE_FROM_OPTICAL))
        messages.append(("/tf", time, ros.transforms(base)))
        info = ros.info("optical", stamp, made.K_at_integers[:3, :3], size=made.size)
        messages.append(("/camera/color/camera_info", time, info))
        messages.append(("/camera/color/image_raw", time, ros.image("optical", stamp, made.photos[i], "bgr8", pad=5)))
        messages.append(("/camera/aligned_depth/camera_info", time, info))
        messages.append(("/camera/aligned_depth/image_raw", time, ros.image("optical", stamp, made.depths[i], "16UC1")))
    ros.write(root / "walk.bag", messages, packing="LZ4")


def ros2(root: Path, made: Made) -> None:
    """Packed pictures, depth in metres, odometry of the robot; each message packed too."""
    ros, messages = RosMessages(False), []
    fixed = ros.transform("base_link", "optical", ROS_START, BASE_FROM_OPTICAL)
    messages.append(("/tf_static", ROS_START, ros.transforms(fixed)))
    for i, (pose, stamp) in enumerate(zip(made.poses, ros_stamps(made.count), strict=True)):
        base = pose @ np.linalg.inv(BASE_FROM_OPTICAL)
        metres = np.where(made.depths[i] > 0, made.depths[i] / 1000, np.nan).astype(np.float32)
        photo = cv2.imencode(".png", made.photos[i])[1].tobytes()
        info = ros.info("optical", stamp, made.K_at_integers[:3, :3], size=made.size)
        messages += [
            ("/odom", stamp, ros.odometry("odom", "base_link", stamp, base)),
            ("/rgb/image/compressed", stamp, ros.packed("optical", stamp, photo, "bgr8; png compressed bgr8")),
            ("/rgb/camera_info", stamp, info),
            ("/depth/image", stamp + 9_000_000, ros.image("optical", stamp + 9_000_000, metres, "32FC1")),
            ("/depth/camera_info", stamp, info),
        ]
    root.mkdir(parents=True)
    ros.write(root / "walk", messages, packing="MESSAGE")
    for path in (root / "walk").iterdir():
        path.rename(root / path.name)
    (root / "walk").rmdir()


def ros_mcap(root: Path, made: Made) -> None:
    """Poses that do not say whose they are; depth as compressedDepth has it: 12 bytes, then a PNG."""
    ros, messages = RosMessages(False), []
    for i, (pose, stamp) in enumerate(zip(made.poses, ros_stamps(made.count), strict=True)):
        depth = struct.pack("<i2f", 0, 0.0, 0.0) + cv2.imencode(".png", made.depths[i])[1].tobytes()
        messages += [
            ("/vicon/pose", stamp, ros.pose("world", stamp, pose)),
            ("/camera/image_raw", stamp, ros.image("optical", stamp, made.photos[i][..., ::-1], "rgb8")),
            ("/camera/camera_info", stamp, ros.info("optical", stamp, made.K_at_integers[:3, :3], size=made.size)),
            ("/camera/depth/compressedDepth", stamp, ros.packed("optical", stamp, depth, "16UC1; compressedDepth")),
        ]
    ros.write(root, messages, "MCAP", packing="STORAGE")
