"""Poses in ROS bags: the tree of /tf and /tf_static, and topics with the pose of one frame."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from room2dgs.captures.capture import Lost
from room2dgs.captures.readers.ros_bag import ODOMETRY, POSE, POSE_COVARIANCE, TF, TRANSFORM, Message
from room2dgs.captures.text_files import quaternion_pose
from room2dgs.captures.trajectories import pose_at_time
from room2dgs.errors import InputError

POSES = (ODOMETRY, POSE, POSE_COVARIANCE, TRANSFORM)
STILL = 1e-9  # metres and parts of a rotation: a transform that is sent again and again, not one that moves
STATIC_TF = "tf_static"


class Track(NamedTuple):
    """Poses of a frame in another one: (N,) seconds in order, (N, 4, 4)."""

    parent: str
    stamps: np.ndarray
    poses: np.ndarray

    @property
    def moves(self) -> bool:
        return bool((np.abs(self.poses - self.poses[0]) > STILL).any())

    def at(self, stamp: float) -> np.ndarray:
        """(4, 4) parent_from_child.

        Raises:
            Lost: nothing is known near that time.
        """
        if not self.moves:
            return self.poses[0]
        pose = pose_at_time(stamp, self.stamps, self.poses)
        return pose() if callable(pose) else pose


class Tree(NamedTuple):
    """How frames hang on each other: child -> its track."""

    tracks: dict[str, Track]
    label: str

    def way(self, frame: str, to: str | None = None) -> list[str]:
        """Frames from one up to another (None: to the root), the last left out.

        Raises:
            InputError: they hang in a circle.
        """
        found: list[str] = []
        while frame != to and frame in self.tracks:
            if frame in found:
                raise InputError(f"{self.label} has transforms in a circle ({' -> '.join(found)}); record it again")
            found.append(frame)
            frame = self.tracks[frame].parent
        return found

    def root(self, frame: str) -> str:
        way = self.way(frame)
        return self.tracks[way[-1]].parent if way else frame

    def pose(self, way: list[str], stamp: float) -> np.ndarray:
        """(4, 4) top_from_frame along a way.

        Raises:
            Lost: a transform is not known near that time.
        """
        pose = np.eye(4)
        for frame in way:
            pose = self.tracks[frame].at(stamp) @ pose
        return pose


class Collector:
    """Takes messages with poses, one by one. Those without a rotation are how odometry says that it is lost.

    Attributes:
        lost: topic -> how many poses were none.
    """

    def __init__(self, label: str, start: int) -> None:
        """Args:
        start: nanoseconds that count as second 0.
        """
        self.label = label
        self.start = start
        self.lost: Counter[str] = Counter()
        self._edges: dict[tuple[str, str], list[tuple[float, np.ndarray]]] = defaultdict(list)
        self._topics: dict[str, dict[tuple[str, str], list[tuple[float, np.ndarray]]]] = defaultdict(
            lambda: defaultdict(list)
        )

    def add(self, message: Message, kind: str) -> None:
        """Keep what a message tells."""
        content, label = message.content, f"{self.label} ({message.topic})"
        if kind in TF:
            for each in content.transforms:
                pose = _pose(each.transform.translation, each.transform.rotation, label)
                self._add(self._edges, each, each.child_frame_id, pose, message, message.topic.endswith(STATIC_TF))
            return
        into = self._topics[message.topic]
        if kind == TRANSFORM:
            pose = _pose(content.transform.translation, content.transform.rotation, label)
            self._add(into, content, content.child_frame_id, pose, message)
        else:
            inner = content.pose.pose if kind in (ODOMETRY, POSE_COVARIANCE) else content.pose
            child = content.child_frame_id if kind == ODOMETRY else ""
            self._add(into, content, child, _pose(inner.position, inner.orientation, label), message)

    def _add(self, into: Any, content: Any, child: str, pose: np.ndarray, message: Message, static: bool = False):
        if not np.isfinite(pose).all():
            self.lost[message.topic] += 1
        else:
            key = clean(content.header.frame_id), clean(child)
            seconds = (stamp_of(content.header, message.place.time) - self.start) * 1e-9
            known = into[key]
            if static:
                known.clear()  # the last one counts
            known.append((seconds, pose))

    def tree(self) -> Tree:
        """What /tf and /tf_static say.

        Raises:
            InputError: a frame hangs on two others.
        """
        tracks: dict[str, Track] = {}
        for (parent, child), known in self._edges.items():
            if child in tracks:
                raise InputError(
                    f"{self.label} hangs the frame {child} on {tracks[child].parent} and on {parent} in its "
                    "transforms; record it with one of them"
                )
            tracks[child] = _track(parent, known)
        return Tree(tracks, f"{self.label} (/tf)")

    def track(self, topic: str) -> tuple[str, Track]:
        """The frame that a topic tells the pose of ("": it does not say), and its track.

        Raises:
            InputError: there are none, or of several frames.
        """
        found = self._topics.get(topic, {})
        if len(found) != 1:
            named = ", ".join(sorted(child for _, child in found)) or "no frame"
            raise InputError(
                f"{self.label} has poses of {named} in {topic}; give scene.topics=[...] with another topic"
            )
        ((parent, child), known), *_ = found.items()
        return child, _track(parent, known)


def _track(parent: str, known: list[tuple[float, np.ndarray]]) -> Track:
    stamps = np.array([stamp for stamp, _ in known])
    order = np.argsort(stamps, kind="stable")
    return Track(parent, stamps[order], np.stack([pose for _, pose in known])[order])


def _pose(t: Any, q: Any, label: str) -> np.ndarray:
    """(4, 4); NaN: it is none."""
    try:
        return quaternion_pose(q.x, q.y, q.z, q.w, [t.x, t.y, t.z], label)
    except InputError:
        return np.full((4, 4), np.nan)


def clean(frame: str) -> str:
    """A frame's name as ROS 2 has it: ROS 1 allowed a slash before it."""
    return frame.strip().lstrip("/")


def stamp_of(header: Any, recorded: int) -> int:
    """Nanoseconds; those of the recording where a driver left the header's empty."""
    stamp = header.stamp.sec * 10**9 + header.stamp.nanosec
    return stamp or recorded


def posed(world_from_frame: Callable[[float], np.ndarray], stamp: float) -> np.ndarray | Callable[[], np.ndarray]:
    """What a shot takes as its pose."""
    try:
        return world_from_frame(stamp)
    except Lost as reason:
        text = str(reason)

        def lost() -> np.ndarray:
            raise Lost(text)

        return lost
