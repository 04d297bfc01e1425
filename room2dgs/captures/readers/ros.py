"""ROS bags: pictures, CameraInfo and depth in sensor_msgs, poses in /tf, nav_msgs/Odometry or stamped poses.

A picture's frame is the optical one (x right, y down, z into it); its pose at its own stamp is blended from those
around it, through all transforms between it and the root. cx, cy count pixel centres at integers. Lengths are metres
(REP 103), depth is millimetres (16UC1) or metres (32FC1, REP 118).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from room2dgs.captures.capture import Capture, Shot
from room2dgs.captures.depth_maps import DepthMap
from room2dgs.captures.lens import Lens
from room2dgs.captures.listing import Listing, gt_mesh_in
from room2dgs.captures.photos import Photo, PhotoBytes
from room2dgs.captures.reader import Reader
from room2dgs.captures.readers.ros_bag import IMAGE, SUFFIXES, TF, Bag, Place
from room2dgs.captures.readers.ros_images import DEPTHS, RawPhoto, depth_numbers, lens_of, photo_size, registered
from room2dgs.captures.readers.ros_poses import POSES, Collector, Track, Tree, posed, stamp_of
from room2dgs.captures.readers.ros_topics import (
    Sensor,
    check_topics,
    info_frames,
    info_of,
    named,
    rectified,
    sensors_of,
    which,
)
from room2dgs.captures.trajectories import MAX_APART_S
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "<name>.bag, or a folder with .db3 or .mcap (ROS)"
TF_NAME = "/tf"
OWN = "camera"  # what scene.pose_frame may call the pictures' own frame
SAME_PLACE_M, SAME_TURN = 1e-3, 1e-3  # frames of depth and colour that need no registration


class _Picture(NamedTuple):
    """A picture or depth: its stamp in nanoseconds, where it lies, and its (width, height) if it is not packed."""

    stamp: int
    place: Place
    size: tuple[int, int] | None


class _Stream(NamedTuple):
    """All of a sensor: its pictures, and its lens at each stamp (none: not calibrated)."""

    sensor: Sensor
    pictures: list[_Picture]
    lenses: list[tuple[int, Lens | None]]

    def lens_at(self, stamp: int) -> Lens | None:
        return min(self.lenses, key=lambda entry: abs(entry[0] - stamp))[1] if self.lenses else None


def is_ros(files: Listing) -> bool:
    """A bag; .db3 in a folder only beside metadata.yaml, since others use that ending too."""
    if files.root.is_file():
        return files.root.suffix.lower() in SUFFIXES
    if files.with_suffix((".bag", ".mcap")):
        return True
    return "metadata.yaml" in files and bool(files.with_suffix((".db3", ".zstd")))


def read_ros(root: Path, config: SceneConfig) -> Capture:
    """Read a bag: poses, stamps and lenses now, pictures and depth when they are asked for.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`; also if there are several topics to choose from.
    """
    bag = Bag(root)
    check_topics(bag, config)
    colour_sensor, depth_sensor = sensors_of(bag, config)
    start = stamp_of(bag.first(colour_sensor.topic).header, 0)
    colour, depth, poses = _read_through(bag, config, colour_sensor, depth_sensor, start)
    tree = poses.tree()
    source, world_from_colour = _poses(bag, config, poses, tree, colour_sensor.frame)
    notes = [f"topics: {colour_sensor.topic}, {source}" + (f", {depth_sensor.topic}" if depth_sensor else "")]
    notes += [f"poses: {count} in {topic} are none (lost) and left out" for topic, count in poses.lost.items()]
    depth_at = None
    if depth is not None:
        depth_at, note = _depth_at(bag, depth, tree, colour_sensor)
        notes += [note] if note else []
    shots = []
    for index, picture in enumerate(sorted(colour.pictures)):
        name = f"{index:06d}"
        shots.append(
            Shot(
                name,
                root / colour_sensor.topic.strip("/") / f"{name}.png",
                posed(world_from_colour, (picture.stamp - start) * 1e-9),
                colour.lens_at(picture.stamp),
                _photo(bag, colour_sensor, picture, name),
                depth_at(picture.stamp) if depth_at else None,
            )
        )
    mesh = gt_mesh_in(root) if root.is_dir() else None
    return Capture(root, "ros", shots, gt_mesh=mesh, why="lengths in ROS are metres", notes=notes)


def _read_through(
    bag: Bag, config: SceneConfig, colour: Sensor, depth: Sensor | None, start: int
) -> tuple[_Stream, _Stream | None, Collector]:
    """One pass over all that is not pixels."""
    frames = info_frames(bag, config)
    streams: dict[str, _Stream] = {}
    by_info: dict[str, list[_Stream]] = {}
    for sensor in (depth, colour):
        if sensor is not None:
            streams[sensor.topic] = _Stream(sensor, [], [])
            info = info_of(bag, frames, sensor)
            if info is not None:
                by_info.setdefault(info, []).append(streams[sensor.topic])
    poses = Collector(str(bag.path), start)
    known: dict[Lens | None, Lens | None] = {}
    for message in bag.messages([*streams, *by_info, *bag.of_type(*TF, *POSES)]):
        topic, kind, content = message.topic, bag.topics[message.topic], message.content
        if topic in streams:
            size = photo_size(content, f"{bag.path} ({topic})") if kind == IMAGE else None
            stamp = stamp_of(content.header, message.place.time)
            streams[topic].pictures.append(_Picture(stamp, message.place, size))
        elif topic in by_info:
            for stream in by_info[topic]:
                half = config.pixel_centres == "half"
                lens = lens_of(content, rectified(stream.sensor.topic), half, f"{bag.path} ({topic})")
                stream.lenses.append((stamp_of(content.header, message.place.time), known.setdefault(lens, lens)))
        else:
            poses.add(message, kind)
    return streams[colour.topic], streams[depth.topic] if depth else None, poses


def _poses(
    bag: Bag, config: SceneConfig, poses: Collector, tree: Tree, frame: str
) -> tuple[str, Callable[[float], np.ndarray]]:
    """What tells the poses, and world_from_colour (4, 4) at seconds."""
    way = tree.way(frame)
    moving = any(tree.tracks[each].moves for each in way)
    sources = named(config, [*([TF_NAME] if moving else []), *bag.of_type(*POSES)])
    if len(sources) > 1:
        raise InputError(which(bag, "poses", sources))
    if not sources:
        raise InputError(_why_none(bag, tree, frame))
    if sources[0] == TF_NAME:
        return f"{TF_NAME} ({frame} in {tree.root(frame)})", partial(tree.pose, way)
    child, track = poses.track(sources[0])
    child = config.pose_frame or child
    if not child:
        raise InputError(
            f"{bag.path} does not say in {sources[0]} whose poses they are; give scene.pose_frame={frame or OWN} if "
            f"they are the camera's own, else another frame{_others(tree)}"
        )
    if child in (frame, OWN):
        return f"{sources[0]} ({frame})", track.at
    up = tree.way(frame, child)
    if not up or tree.tracks[up[-1]].parent != child:
        raise InputError(
            f"{bag.path} has poses of {child} in {sources[0]} and no transform from there to the pictures' "
            f"{frame or 'frame'}; record /tf_static too, or give scene.pose_frame=FRAME whose poses they are"
            f"{_others(tree)}"
        )
    return f"{sources[0]} ({child})", partial(_along, track, tree, up)


def _along(track: Track, tree: Tree, way: list[str], stamp: float) -> np.ndarray:
    return track.at(stamp) @ tree.pose(way, stamp)


def _others(tree: Tree) -> str:
    frames = sorted({*tree.tracks, *(track.parent for track in tree.tracks.values())})
    return f" ({', '.join(frames[:8])})" if frames else ""


def _why_none(bag: Bag, tree: Tree, frame: str) -> str:
    if tree.tracks and frame not in tree.tracks:
        return (
            f"{bag.path} has transforms{_others(tree)}, but none of the pictures' frame {frame or '(they name none)'}; "
            "record /tf_static too"
        )
    still = f": /tf holds {frame} still in {tree.root(frame)}" if tree.tracks else ""
    return (
        f"{bag.path} has no poses{still}; record /tf, odometry or poses of the camera too (or save the pictures, and "
        "`room2dgs prepare images=DIR` finds poses)"
    )


def _depth_at(
    bag: Bag, depth: _Stream, tree: Tree, colour: Sensor
) -> tuple[Callable[[int], DepthMap | None] | None, str | None]:
    """What gives the depth map of a stamp, None where depth cannot be used; what to say about it."""
    sensor = depth.sensor
    fixed, color_from_depth = _fixed(tree, sensor.frame, colour.frame)
    if not fixed:
        return None, (
            f"depth in {sensor.topic} is not used: no fixed transform leads from its frame {sensor.frame} to the "
            f"pictures' {colour.frame}; record aligned depth or /tf_static"
        )
    pictures = sorted(depth.pictures)
    at = partial(_depth_map, bag, depth, pictures, np.array([one.stamp for one in pictures]), color_from_depth)
    if color_from_depth is None:
        return at, None
    apart = 1000 * np.linalg.norm(color_from_depth[:3, 3])
    return at, f"depth in {sensor.topic} is registered to the pictures by /tf ({apart:.0f} mm apart)"


def _fixed(tree: Tree, depth: str, colour: str) -> tuple[bool, np.ndarray | None]:
    """Whether the sensors hang together, and color_from_depth (4, 4) if they lie apart."""
    if depth == colour:
        return True, None
    up = [tree.way(depth), tree.way(colour)]
    common = set(up[0]) & set(up[1])
    up = [[frame for frame in way if frame not in common] for way in up]
    tops = [tree.tracks[way[-1]].parent if way else frame for way, frame in zip(up, (depth, colour), strict=True)]
    if tops[0] != tops[1] or any(tree.tracks[frame].moves for way in up for frame in way):
        return False, None
    matrix = np.linalg.inv(tree.pose(up[1], 0.0)) @ tree.pose(up[0], 0.0)
    near = np.linalg.norm(matrix[:3, 3]) < SAME_PLACE_M and np.abs(matrix[:3, :3] - np.eye(3)).max() < SAME_TURN
    return True, None if near else matrix


def _depth_map(
    bag: Bag,
    depth: _Stream,
    pictures: list[_Picture],
    stamps: np.ndarray,
    color_from_depth: np.ndarray | None,
    stamp: int,
) -> DepthMap | None:
    """The map of nearly the same moment."""
    nearest = int(np.argmin(np.abs(stamps - stamp)))
    if abs(int(stamps[nearest]) - stamp) > MAX_APART_S * 1e9:
        return None
    encoding, label = depth.sensor.encoding, f"{bag.path} ({depth.sensor.topic})"
    assert encoding is not None, f"{label} has no depth"
    unit, lens = DEPTHS[encoding][1], depth.lens_at(stamp)
    read = partial(_numbers, bag, pictures[nearest].place, encoding, label)
    if color_from_depth is None:
        # a distorted one is registered to the photo and has its lens
        K = None if lens is None or lens.distorts else tuple(map(tuple, lens.K))
        return DepthMap(label, read, unit, K)
    if lens is None:
        raise InputError(
            f"{label} has no CameraInfo, which depth from another place than the pictures needs; record it"
        )
    return DepthMap(label, lambda: registered(read() * unit, lens.K, color_from_depth), 1.0, tuple(map(tuple, lens.K)))


def _numbers(bag: Bag, place: Place, encoding: str, label: str) -> np.ndarray:
    return depth_numbers(bag.message(place), encoding, label)


def _photo(bag: Bag, sensor: Sensor, picture: _Picture, name: str) -> Photo:
    label = f"{bag.path} ({sensor.topic} {name})"
    if picture.size is not None:
        return RawPhoto(label, picture.size, partial(bag.message, picture.place))
    return PhotoBytes(label, partial(_packed, bag, picture.place))


def _packed(bag: Bag, place: Place) -> bytes:
    return bytes(bag.message(place).data)


READER = Reader(is_ros, read_ros, LAYOUT)
