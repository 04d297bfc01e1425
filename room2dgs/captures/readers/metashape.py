"""Metashape's exported cameras (.xml): camera-to-world with OpenCV axes, in the chunk's units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from room2dgs.captures.capture import Capture, Lost, Shot
from room2dgs.captures.left_out import left_out, some
from room2dgs.captures.lens import Lens
from room2dgs.captures.listing import Listing, gt_mesh_in, inside, natural
from room2dgs.captures.matrix_files import rigid
from room2dgs.captures.reader import Reader
from room2dgs.captures.readers.metashape_lens import sensor_lens, xml_number
from room2dgs.captures.readers.metashape_photos import LabelledPhotos
from room2dgs.captures.text_files import floats
from room2dgs.captures.xml_files import read_xml
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError
from room2dgs.regular_files import open_regular
from room2dgs.texts import shown_name

LAYOUT = "images/ and cameras.xml (Metashape)"
NO = ("false", "0", "no")


def is_metashape(files: Listing) -> bool:
    return any(_looks_like_it(_path(files, name)) for name in files.matching("*.xml"))


def _path(files: Listing, name: str) -> Path:
    return files.root if files.root.is_file() else files.root / name


def _looks_like_it(path: Path) -> bool:
    try:
        with open_regular(path) as file:
            head = file.read(4096)
    except (OSError, InputError):
        return False
    return b"<document" in head and b"<chunk" in head


class _Camera(NamedTuple):
    """An element of a camera.

    Attributes:
        label: as written; name: its photo's, or what that would be called.
        why: why it is not clear which photo it is; None: it is.
        transform: 16 numbers as text; None: it is not aligned.
    """

    label: str
    name: str
    why: str | None
    transform: str | None
    sensor: str | None
    component: str | None


def read_metashape(root: Path, config: SceneConfig) -> Capture:
    """Read an exported .xml and the photos beside it.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    files = Listing(root)
    found = [_path(files, name) for name in files.matching("*.xml") if _looks_like_it(_path(files, name))]
    if len(found) != 1:
        raise InputError(f"{root} has {len(found)} files of cameras (.xml); give scene.path=FILE of one")
    path = found[0]
    notes: list[str] = []
    warnings: list[str] = []
    chunk = _chunk(path, notes)
    photos = LabelledPhotos(path.parent)
    cameras = _one_for_each_photo(_cameras(chunk, photos, notes), path, warnings)
    sensors = {sensor.get("id"): sensor for sensor in chunk.iterfind("sensors/sensor")}

    @cache
    def lens(sensor: str | None) -> Lens | None:
        return sensor_lens(sensors[sensor], path, warnings.append) if sensor in sensors else None

    placed = _placed(chunk, cameras, path, warnings)
    shots = {}
    for camera in cameras:
        pose = None if camera.transform is None else partial(placed, camera)
        calibration = None if pose is None else lens(camera.sensor)
        if pose is not None and calibration is None:
            message = f"{path} has no calibration for camera {camera.label}; export the cameras again"
            pose = partial(_refused, message)
        shots[camera.name] = Shot(camera.name, inside(photos.folder, camera.name, path), pose, calibration)
    return Capture(
        root,
        "metashape",
        [shots[name] for name in natural(shots)],
        metric=False,
        why="a chunk's units are metres only if it was referenced",
        gt_mesh=gt_mesh_in(path.parent),
        notes=notes,
        warnings=warnings,
    )


def _refused(message: str) -> np.ndarray:
    raise InputError(message)


def _cameras(chunk: ElementTree.Element, photos: LabelledPhotos, notes: list[str]) -> list[_Camera]:
    """The cameras that are enabled and say which photo they are of."""
    cameras = chunk.find("cameras")
    elements = list((chunk if cameras is None else cameras).iter("camera"))
    paths = {
        frame.get("camera_id"): photo.get("path")
        for frame in chunk.iterfind("frames/frame/cameras/camera")
        if (photo := frame.find("photo")) is not None
    }
    found, unnamed, disabled = [], 0, 0
    for element in elements:
        photo = element.find("photo")
        photo_path = paths.get(element.get("id")) if photo is None else photo.get("path")
        label = element.get("label") or Path((photo_path or "").replace("\\", "/")).name
        if not label:
            unnamed += 1
            continue
        if (element.get("enabled") or "true").lower() in NO:
            disabled += 1
            continue
        names = photos.of(label, photo_path)
        transform = (element.findtext("transform") or "").strip() or None
        if not names and transform is None:
            continue  # neither aligned nor there
        why = (
            None if len(names) <= 1 else f"camera {label!r} may be of {some(names)}; give the photos names of their own"
        )
        name = names[0] if names else photos.called(label)
        found.append(_Camera(label, name, why, transform, element.get("sensor_id"), element.get("component_id")))
    if unnamed:
        notes.append(f"passed over: {unnamed} cameras without a label or a photo")
    if disabled:
        notes.append(f"left out: {disabled} cameras that are disabled in Metashape")
    return found


def _one_for_each_photo(cameras: list[_Camera], path: Path, warnings: list[str]) -> list[_Camera]:
    """Cameras of which it is clear which photo they are of; of several of one photo the aligned one.

    Raises:
        InputError: there are too many others.
    """
    bad = {camera.label: f"{path}: {camera.why}" for camera in cameras if camera.why and camera.transform}
    known = [camera for camera in cameras if not camera.why]
    aligned = Counter(camera.name for camera in known if camera.transform)
    transforms: dict[str, set[str]] = {}
    for camera in known:
        if camera.transform:
            transforms.setdefault(camera.name, set()).add(f"{camera.transform.split()} {camera.component}")
    result: dict[str, _Camera] = {}
    for camera in known:
        if len(transforms.get(camera.name, ())) > 1:
            bad[camera.name] = (
                f"{path} has {aligned[camera.name]} cameras called {camera.label!r} with different poses, and one "
                "photo of that name; give the photos names of their own and export again"
            )
        elif camera.transform or not aligned[camera.name]:
            result.setdefault(camera.name, camera)
    message = left_out(bad, len(cameras), "cameras whose photo is not clear")
    warnings += [f"{path}: {message}"] if message else []
    return list(result.values())


def _placed(
    chunk: ElementTree.Element, cameras: list[_Camera], path: Path, warnings: list[str]
) -> Callable[[_Camera], np.ndarray]:
    """A function from a camera to its (4, 4) pose in the chunk, in units of the largest component."""
    components = {one.get("id"): one for one in chunk.iterfind("components/component")}
    counts = Counter(camera.component for camera in cameras if camera.transform)
    main = counts.most_common(1)[0][0] if counts else None
    apart: set[str | None] = set()
    if len(counts) > 1 and any(one not in components or components[one].find("transform") is None for one in counts):
        apart = set(counts) - {main}
        lost = sum(counts[one] for one in apart)
        warnings.append(
            f"{path} has {len(counts)} components that are not placed against each other: the largest is read "
            f"({counts[main]} cameras), {lost} cameras of the others are left out; merge the components to use them"
        )
    unit = _scale(components[main], path) if main in components else 1.0

    def pose(camera: _Camera) -> np.ndarray:
        if camera.component in apart:
            raise Lost("it is in another component, which is not placed against the largest")
        own = _numbers(camera.transform or "", f"{path} (camera {camera.label})", 16).reshape(4, 4)
        if camera.component not in components:
            return own
        component = components[camera.component]
        scale = _scale(component, path)
        if scale != unit:
            own[:3, 3] *= scale / unit
        with np.errstate(invalid="ignore"):  # a pose that is not finite is named with its frame
            return _component(component, unit, path) @ own

    return _finite(pose)


def _finite(pose: Callable[[_Camera], np.ndarray]) -> Callable[[_Camera], np.ndarray]:
    def checked(camera: _Camera) -> np.ndarray:
        found = pose(camera)
        if not np.isfinite(found).all():
            raise Lost("its pose holds inf or NaN (tracking lost)")
        return rigid(found, f"the pose of camera {camera.label}")

    return checked


def _chunk(path: Path, notes: list[str]) -> ElementTree.Element:
    root = read_xml(path)
    chunks = root.findall("chunk") or root.findall("chunks/chunk")
    if not chunks:
        raise InputError(f"{path} has no chunk; export the cameras again")
    counts = [sum(camera.find("transform") is not None for camera in chunk.iter("camera")) for chunk in chunks]
    chunk = chunks[counts.index(max(counts))]
    if len(chunks) > 1:
        label = shown_name(chunk.get("label") or chunk.get("id") or counts.index(max(counts)) + 1)
        notes.append(
            f"{path} has {len(chunks)} chunks: {label} is read, which has most aligned cameras "
            f"({', '.join(map(str, counts))}); export the chunks apart to read another"
        )
    return chunk


def _scale(component: ElementTree.Element, path: Path) -> float:
    scale = xml_number(component.findtext("transform/scale", "1"), f"{path} (scale)")
    if scale <= 0:
        raise InputError(f"{path} has a component of scale {scale}; export the cameras again")
    return scale


def _component(component: ElementTree.Element, unit: float, path: Path) -> np.ndarray:
    """(4, 4) from the component to the chunk, in the unit of the poses: they stay unscaled."""
    rotation = component.findtext("transform/rotation")
    translation = component.findtext("transform/translation")
    result = np.eye(4)
    if rotation:
        result[:3, :3] = _numbers(rotation, f"{path} (rotation)", 9).reshape(3, 3)
    if translation:
        result[:3, 3] = _numbers(translation, f"{path} (translation)", 3) / unit
    return result


def _numbers(text: str, label: str, count: int) -> np.ndarray:
    return np.array(floats(text, label, None, count), np.float64)


READER = Reader(is_metashape, read_metashape, LAYOUT)
