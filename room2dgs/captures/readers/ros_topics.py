"""Chooses the topics of a ROS bag: pictures, depth and their CameraInfo; the user decides where several fit."""

from __future__ import annotations

from typing import NamedTuple

from room2dgs.captures.readers.ros_bag import CAMERA_INFO, COMPRESSED, IMAGE, Bag
from room2dgs.captures.readers.ros_images import depth_encoding
from room2dgs.captures.readers.ros_poses import clean
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError


class Sensor(NamedTuple):
    """A topic with pictures, or with depth in an encoding."""

    topic: str
    frame: str
    encoding: str | None


def check_topics(bag: Bag, config: SceneConfig) -> None:
    for topic in config.topics or ():
        if topic not in bag.topics:
            raise InputError(f"{bag.path} has no topic {topic} that is read; it has {', '.join(sorted(bag.topics))}")


def named(config: SceneConfig, topics: list[str]) -> list[str]:
    """Those of the topics that the settings name; all if they name none of them."""
    chosen = [topic for topic in topics if topic in (config.topics or ())]
    return chosen or topics


def sensors_of(bag: Bag, config: SceneConfig) -> tuple[Sensor, Sensor | None]:
    """The topic of the pictures, and that of depth."""
    found: dict[str | None, list[Sensor]] = {}
    for topic in bag.of_type(IMAGE, COMPRESSED):
        message = bag.first(topic)
        encoding = depth_encoding(topic, message)
        kind = "depth" if encoding else "colour"
        found.setdefault(kind, []).append(Sensor(topic, clean(message.header.frame_id), encoding))
    colours = _chosen(config, found.get("colour", []))
    if not colours:
        raise InputError(f"{bag.path} has depth and no pictures; record the colour camera too")
    if len(colours) > 1:
        raise InputError(which(bag, "pictures", [sensor.topic for sensor in colours]))
    colour = colours[0]
    depths = _chosen(config, found.get("depth", []))
    if len(depths) > 1:
        depths = [sensor for sensor in depths if sensor.frame == colour.frame] or depths
    if len(depths) > 1:
        raise InputError(which(bag, "depth", [sensor.topic for sensor in depths]))
    return colour, depths[0] if depths else None


def _chosen(config: SceneConfig, sensors: list[Sensor]) -> list[Sensor]:
    """Those that the settings name; of the same pictures raw and packed, the raw ones."""
    names = named(config, [sensor.topic for sensor in sensors])
    sensors = [sensor for sensor in sensors if sensor.topic in names]
    plain = {sensor.topic for sensor in sensors}
    return [sensor for sensor in sensors if sensor.topic == _base(sensor.topic) or _base(sensor.topic) not in plain]


def _base(topic: str) -> str:
    """The topic without what image_transport adds."""
    head, _, tail = topic.rpartition("/")
    return head if tail in ("compressed", "compressedDepth") else topic


def which(bag: Bag, what: str, topics: list[str]) -> str:
    return (
        f"{bag.path} has {what} in {' and '.join(topics)}; say which with scene.topics=[{topics[0]}] (other topics may "
        "be named beside it)"
    )


def rectified(topic: str) -> bool:
    return "rect" in _base(topic).rpartition("/")[2]


def info_frames(bag: Bag, config: SceneConfig) -> dict[str, str]:
    """Frame of each topic with CameraInfo."""
    return {topic: clean(bag.first(topic).header.frame_id) for topic in named(config, bag.of_type(CAMERA_INFO))}


def info_of(bag: Bag, infos: dict[str, str], sensor: Sensor) -> str | None:
    """The topic with a sensor's CameraInfo: beside its pictures, else the only one of its frame."""
    base = _base(sensor.topic)
    for name in (f"{base.rpartition('/')[0]}/camera_info", f"{base}/camera_info"):
        if name in infos:
            return name
    same = [topic for topic, frame in infos.items() if frame == sensor.frame]
    if len(same) > 1:
        raise InputError(which(bag, f"intrinsics of {sensor.frame}", same))
    return same[0] if same else None
