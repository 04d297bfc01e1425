"""ROS messages and bags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation


def ros_header(store, frame: str, nanoseconds: int):
    stamp = store.types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    counted = {"seq": 0} if "seq" in store.types["std_msgs/msg/Header"].__dataclass_fields__ else {}
    return store.types["std_msgs/msg/Header"](**counted, stamp=stamp, frame_id=frame)


class RosMessages:
    """Messages of ROS 1 or 2 with the fields that their definitions name."""

    def __init__(self, ros1: bool) -> None:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.ros1 = ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.tf = "tf2_msgs/msg/TFMessage"
        if self.tf not in self.store.types:
            self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", self.tf))

    def make(self, kind: str, **fields):
        return self.store.types[kind](**fields)

    def header(self, frame: str, stamp: int):
        return ros_header(self.store, frame, stamp)

    def image(self, frame: str, stamp: int, pixels: np.ndarray, encoding: str, pad: int = 0):
        """Rows are `pad` bytes longer than their pixels."""
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
        data = np.pad(rows, ((0, 0), (0, pad)), constant_values=77)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(frame, stamp),
            height=len(pixels),
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=data.shape[1],
            data=data.ravel(),
        )

    def packed(self, frame: str, stamp: int, data: bytes, form: str):
        header = self.header(frame, stamp)
        array = np.frombuffer(data, np.uint8)
        return self.make("sensor_msgs/msg/CompressedImage", header=header, format=form, data=array)

    def info(self, frame: str, stamp: int, K: np.ndarray, D=(), model="plumb_bob", size=(96, 72)):
        """`size` is (width, height)."""
        roi = self.make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        names = "DKRP" if self.ros1 else "dkrp"
        P = np.c_[K, np.zeros(3)]
        values = np.array(D, np.float64), K.ravel(), np.eye(3).ravel(), P.ravel()
        matrices = dict(zip(names, values, strict=True))
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(frame, stamp),
            height=size[1],
            width=size[0],
            distortion_model=model,
            binning_x=0,
            binning_y=0,
            roi=roi,
            **matrices,
        )

    def placed(self, pose: np.ndarray, where: str, how: str, point: str, of: str):
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        at = self.make(f"geometry_msgs/msg/{point}", **dict(zip("xyz", pose[:3, 3], strict=True)))
        turned = self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
        return self.make(f"geometry_msgs/msg/{of}", **{where: at, how: turned})

    def transform(self, parent: str, child: str, stamp: int, pose: np.ndarray):
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(parent, stamp),
            child_frame_id=child,
            transform=self.placed(pose, "translation", "rotation", "Vector3", "Transform"),
        )

    def transforms(self, *each):
        return self.make(self.tf, transforms=list(each))

    def pose(self, parent: str, stamp: int, pose: np.ndarray):
        inner = self.placed(pose, "position", "orientation", "Point", "Pose")
        return self.make("geometry_msgs/msg/PoseStamped", header=self.header(parent, stamp), pose=inner)

    def odometry(self, parent: str, child: str, stamp: int, pose: np.ndarray):
        inner = self.placed(pose, "position", "orientation", "Point", "Pose")
        nothing = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        still = self.make("geometry_msgs/msg/Twist", linear=nothing, angular=nothing)
        unsure = np.zeros(36)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(parent, stamp),
            child_frame_id=child,
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=inner, covariance=unsure),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=still, covariance=unsure),
        )

    def write(self, path: Path, messages, storage: str = "SQLITE3", packing: str = "") -> None:
        """(topic, nanoseconds of the recording, message) in a .bag or a folder."""
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2

        path.parent.mkdir(parents=True, exist_ok=True)
        writer: Writer1 | Writer2
        if self.ros1:
            writer = first = Writer1(path)
            if packing:
                first.set_compression(Writer1.CompressionFormat[packing])
        else:
            writer = second = Writer2(path, version=9, storage_plugin=StoragePlugin[storage])
            if packing:
                second.set_compression(CompressionMode[packing], CompressionFormat.ZSTD)
        with writer:
            topics = {}
            for topic, time, message in messages:
                kind = message.__msgtype__
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, kind, typestore=self.store)
                pack = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
                writer.write(topics[topic], time, pack(message, kind))
