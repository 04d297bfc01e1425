"""ROS bags by the library `rosbags` (the extra `ros`): their topics, and messages one at a time.

ROS 1 has one file .bag. ROS 2 has a folder with .db3 or .mcap files, or one of these; what its metadata.yaml repeats
is not needed. Definitions of messages that lie in a bag are not read either, since the library makes code of them: the
few types that are used are the same in every release of ROS.
"""

from __future__ import annotations

import bz2
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from threading import RLock
from typing import Any, NamedTuple

from room2dgs.captures.listing import Listing
from room2dgs.errors import InputError
from room2dgs.regular_files import check_regular

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
ODOMETRY = "nav_msgs/msg/Odometry"
POSE, POSE_COVARIANCE = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORM = "geometry_msgs/msg/TransformStamped"
KNOWN = (IMAGE, COMPRESSED, CAMERA_INFO, *TF, ODOMETRY, POSE, POSE_COVARIANCE, TRANSFORM)
SUFFIXES = (".bag", ".mcap", ".db3")
MOST_UNPACKED = 256 << 20  # bytes of a chunk or a message, whatever it is packed from
ZSTD = b"\x28\xb5\x2f\xfd"


class Place(NamedTuple):
    """Where a message lies: file, connection, nanoseconds of its recording, and which of several of that moment."""

    part: int
    connection: int
    time: int
    nth: int


class Message(NamedTuple):
    topic: str
    place: Place
    content: Any


def bag_files(root: Path) -> list[Path]:
    """The files of one recording.

    Raises:
        InputError: there are none, several, or they are packed as a whole.
    """
    if root.is_file():
        return [root]
    files = Listing(root)
    ros1, ros2 = files.with_suffix((".bag",)), files.with_suffix((".mcap", ".db3"))
    packed = [name for name in files.with_suffix((".zstd",)) if ".db3." in name or ".mcap." in name]
    if packed and not ros2:
        raise InputError(f"{root / packed[0]} is packed as a whole; unpack it with `zstd -d --rm {packed[0]}`")
    if len(ros1) > 1 or (ros1 and ros2) or len({Path(name).suffix for name in ros2}) > 1:
        raise InputError(f"{root} has {len(ros1) + len(ros2)} bags; give scene.path=FILE of one")
    if not ros1 and not ros2:
        raise InputError(f"{root} has no .bag, .mcap or .db3; give the recording's folder or file")
    return [root / name for name in (*ros1, *ros2)]


class Bag:
    """A recording. Messages are read from the disk each time.

    Attributes:
        path: its folder or file.
        topics: type of each topic whose type is known and that has messages.
        other: types of the other topics.

    Raises:
        InputError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = RLock()
        library = _library()
        self._files = bag_files(path)
        self._readers = []
        self.ros1 = self._files[0].suffix == ".bag"
        self.topics: dict[str, str] = {}
        self.other: set[str] = set()
        for file in self._files:
            check_regular(file, "copy the recording again")
            with self._guarded():
                reader = (library.Reader1 if self.ros1 else library.Reader2)(file)
                reader.open()
                self._readers.append(reader)
                if not self.ros1 and hasattr(reader.storage, "chunks") and not reader.storage.chunks:
                    raise InputError(
                        f"{file} has no index of its messages, and finding each would read all of it; write it anew "
                        "with `mcap recover`"
                    )
                for connection in reader.connections:
                    if not connection.msgcount:
                        continue
                    if connection.msgtype in KNOWN:
                        self.topics[connection.topic] = connection.msgtype
                    else:
                        self.other.add(connection.msgtype)
        if not any(kind in (IMAGE, COMPRESSED) for kind in self.topics.values()):
            known = ", ".join(sorted({*self.topics.values(), *self.other})[:8])
            raise InputError(f"{path} holds no images (sensor_msgs/Image); its messages are {known or 'none'}")

    def of_type(self, *kinds: str) -> list[str]:
        """Topics of these types, by name."""
        return sorted(name for name, kind in self.topics.items() if kind in kinds)

    def messages(self, topics: Iterable[str]) -> Iterator[Message]:
        """All messages of some topics, file by file in the order of their recording.

        Raises:
            InputError: the bag is damaged.
        """
        wanted = set(topics)
        for part, reader in enumerate(self._readers):
            found = [one for one in reader.connections if one.topic in wanted and one.msgtype in KNOWN]
            if not found:
                continue
            last: dict[int, tuple[int, int]] = {}
            stream = iter(reader.messages(found))
            while True:
                with self._guarded():
                    entry = next(stream, None)
                    if entry is None:
                        break
                    connection, time, raw = entry
                    before = last.get(connection.id, (time - 1, 0))
                    nth = before[1] + 1 if before[0] == time else 0
                    last[connection.id] = time, nth
                    place = Place(part, connection.id, time, nth)
                    message = Message(connection.topic, place, self._parsed(raw, connection.msgtype))
                yield message

    def first(self, topic: str) -> Any:
        """The first message of a topic.

        Raises:
            InputError: the bag is damaged.
        """
        for message in self.messages([topic]):
            return message.content
        raise InputError(f"{self.path} has no message in {topic} although it says so; record it again")

    def message(self, place: Place) -> Any:
        """The message at a place.

        Raises:
            InputError: the bag is damaged.
        """
        with self._guarded():
            reader = self._readers[place.part]
            found = [one for one in reader.connections if one.id == place.connection]
            stream = reader.messages(found, start=place.time, stop=place.time + 1)
            for nth, (connection, _, raw) in enumerate(stream):
                if nth == place.nth:
                    return self._parsed(raw, connection.msgtype)
        raise InputError(f"{self.path} changed while it was read; start again")

    def _parsed(self, raw: Any, kind: str) -> Any:
        if not isinstance(raw, (bytes, memoryview)):
            raise ValueError("a message is no bytes")
        if bytes(raw[:4]) == ZSTD:
            raw = _library().unpack_zstd(bytes(raw))
        store = _typestore(self.ros1)
        return store.deserialize_ros1(raw, kind) if self.ros1 else store.deserialize_cdr(raw, kind)

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Whatever the library raises over a damaged file becomes a sentence."""
        with self._lock:
            try:
                yield
            except InputError:
                raise
            except (Exception, MemoryError) as error:
                why = " ".join(str(error).split())[:100].strip(".")
                mend = "`rosbag reindex` may mend it" if self.ros1 else "copy it again"
                raise InputError(f"{self.path} cannot be read as a ROS bag ({why or 'damaged'}); {mend}") from error


class _Library(NamedTuple):
    Reader1: Any
    Reader2: Any
    unpack_zstd: Any


@lru_cache(maxsize=1)
def _library() -> _Library:
    """The library, whose unpacking knows no limit until it is given one.

    Raises:
        InputError: it is not installed.
    """
    try:
        from lz4.frame import LZ4FrameDecompressor
        from rosbags import rosbag1, rosbag2
        from rosbags.rosbag1 import reader as ros1
        from rosbags.rosbag2 import storage_mcap as mcap
    except ImportError as error:
        raise InputError("ROS bags are read by rosbags; install it (pip install 'room2dgs[ros]')") from error

    def limited(unpacker):
        def unpack(data: bytes, _size: int = 0) -> bytes:
            one = unpacker()
            result = one.decompress(data, MOST_UNPACKED)
            if not one.eof:
                raise ValueError(f"packed data that ends too early or is over {MOST_UNPACKED >> 20} MiB")
            return result

        return unpack

    unpackers = {
        "bz2": limited(bz2.BZ2Decompressor),
        "lz4": limited(LZ4FrameDecompressor),
        "zstd": limited(mcap.zstd.ZstdDecompressor),
    }
    for table in (ros1.decompressors, mcap.DECOMPRESSORS):
        table.update({name: unpackers[name] for name in table if name in unpackers})
    return _Library(rosbag1.Reader, rosbag2.Reader, unpackers["zstd"])


@lru_cache(maxsize=2)
def _typestore(ros1: bool) -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    for kind in TF:
        if kind not in store.types:
            store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", kind))
    return store
