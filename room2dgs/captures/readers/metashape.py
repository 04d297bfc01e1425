"""Metashape's exported cameras (.xml): camera-to-world with OpenCV axes, in the chunk's units.

cx, cy on disk count from the middle of the photo. Its p1, p2 are swapped against OpenCV's: Metashape's manual has
x' = x (1 + ...) + p1 (r^2 + 2 x^2) + 2 p2 x y, where OpenCV's p2 has the first.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from room2dgs.captures.capture import Capture, Shot
from room2dgs.captures.lens import Lens
from room2dgs.captures.listing import PHOTO_SUFFIXES, Listing, gt_mesh_in, listed, natural
from room2dgs.captures.text_files import floats, text_of
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "images/ and cameras.xml (Metashape)"
FOLDERS = ("images", "photos", "rgb", ".")
MAX_BYTES = 1 << 28


def is_metashape(files: Listing) -> bool:
    return any(_looks_like_it(_path(files, name)) for name in files.matching("*.xml"))


def _path(files: Listing, name: str) -> Path:
    return files.root if files.root.is_file() else files.root / name


def _looks_like_it(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError:
        return False
    return b"<document" in head and b"<chunk" in head


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
    chunk = _chunk(path)
    lenses = {sensor.get("id"): _lens(sensor, path) for sensor in chunk.iterfind("sensors/sensor")}
    components = {one.get("id"): _component(one, path) for one in chunk.iterfind("components/component")}
    folder = next((path.parent / name for name in FOLDERS if _photo_names(path.parent / name)), path.parent)
    photos = _photo_names(folder)
    shots = {}
    for camera in chunk.iter("camera"):
        label = camera.get("label") or ""
        name = photos.get(label) or photos.get(Path(label).stem) if label else None
        transform = camera.findtext("transform")
        lens = lenses.get(camera.get("sensor_id"))
        pose = None
        if transform is not None:
            pose = np.array(floats(transform, f"{path} (camera {label})", None, 16)).reshape(4, 4)
            with np.errstate(invalid="ignore"):  # a pose that is not finite is named with its frame
                pose = components.get(camera.get("component_id"), np.eye(4)) @ pose
        if name is None:
            raise InputError(f"{path} has a camera {label!r}, of which {folder} has no photo; copy the photos there")
        if pose is not None and lens is None:
            raise InputError(f"{path} has no calibration for camera {label}; export the cameras again")
        shots[name] = Shot(name, folder / name, pose, lens)
    return Capture(
        root,
        "metashape",
        [shots[name] for name in natural(shots)],
        metric=False,
        why="a chunk's units are metres only if it was referenced",
        gt_mesh=gt_mesh_in(path.parent),
    )


def _chunk(path: Path) -> ElementTree.Element:
    text = text_of(path)
    if len(text) > MAX_BYTES or "<!ENTITY" in text or "<!DOCTYPE" in text:
        raise InputError(f"{path} is no export of cameras; export it again")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path} is no whole XML ({error}); export it again") from error
    chunk = root.find("chunk")
    if chunk is None:
        raise InputError(f"{path} has no chunk; export the cameras again")
    return chunk


def _lens(sensor: ElementTree.Element, path: Path) -> Lens | None:
    calibration = sensor.find("calibration")
    resolution = sensor.find("resolution")
    if calibration is None or resolution is None:
        return None
    kind = sensor.get("type") or calibration.get("type") or "frame"
    if kind not in ("frame", "fisheye"):
        raise InputError(f"{path} has a sensor of type {kind[:40]!r}, which is not read; undistort the photos")
    width, height = (_number(resolution.get(key), f"{path} (resolution)") for key in ("width", "height"))
    known = {
        key: _number(calibration.findtext(key, "0"), f"{path} ({key})")
        for key in ("f", "fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "b1", "b2")
    }
    f = known["f"] or known["fy"]
    if abs(known["b2"]) > 1.0:
        raise InputError(f"{path} has skewed pixels (b2={known['b2']}), which is not read; undistort the photos")
    params = (f + known["b1"], f, known["cx"] + width / 2, known["cy"] + height / 2)
    k = [known[f"k{i}"] for i in (1, 2, 3, 4)]
    size = int(width), int(height)
    if kind == "fisheye":
        lens = Lens("OPENCV_FISHEYE", (*params, *k), size, str(path))
    elif k[3]:
        raise InputError(f"{path} has a lens with k4, which is not read; undistort the photos")
    else:
        lens = Lens(
            "FULL_OPENCV", (*params, k[0], k[1], known["p2"], known["p1"], k[2], 0.0, 0.0, 0.0), size, str(path)
        )
    lens.check()
    return lens


def _component(component: ElementTree.Element, path: Path) -> np.ndarray:
    """(4, 4) from the component to the chunk, in the chunk's units: translation over scale, as poses stay unscaled."""
    rotation = component.findtext("transform/rotation")
    translation = component.findtext("transform/translation")
    scale = _number(component.findtext("transform/scale", "1"), f"{path} (scale)")
    result = np.eye(4)
    if rotation:
        result[:3, :3] = np.array(floats(rotation, f"{path} (rotation)", None, 9)).reshape(3, 3)
    if translation:
        if scale <= 0:
            raise InputError(f"{path} has a component of scale {scale}; export the cameras again")
        result[:3, 3] = np.array(floats(translation, f"{path} (translation)", None, 3)) / scale
    return result


def _number(text: str | None, label: str) -> float:
    found = floats(text or "", label, None, 1)[0]
    if not np.isfinite(found):
        raise InputError(f"{label} is not finite; export the cameras again")
    return found


def _photo_names(folder: Path) -> dict[str, str]:
    """Label -> name: with and without the suffix."""
    names = [name for name in listed(folder) if Path(name).suffix.lower() in PHOTO_SUFFIXES]
    return {**{Path(name).stem: name for name in names}, **{name: name for name in names}}
