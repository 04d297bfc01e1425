"""nerfstudio's and instant-ngp's transforms.json: camera-to-world with OpenGL axes, pixel centres at +0.5.

The world is the capture's own: what was applied to it when it was saved (`applied_transform`, `applied_scale`) is
undone, and it is neither re-oriented nor centred nor scaled, as nerfstudio does on loading.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.capture import C2W_OPENGL, Capture, RawPoints, Shot
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.lens import Lens
from room2dgs.captures.listing import Listing, gt_mesh_in, inside, natural
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.point_files import read_ply
from room2dgs.captures.text_files import number, numbers, positive, read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "transforms.json (nerfstudio, instant-ngp)"
NAMES = ("transforms.json", "transforms_train.json")
PERSPECTIVE = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "PERSPECTIVE")
FISHEYE = ("OPENCV_FISHEYE",)
SPLITS = ("train_filenames", "val_filenames", "test_filenames")


def is_nerfstudio(files: Listing) -> bool:
    """transforms.json or another transforms*.json; or a .json itself."""
    return files.root.suffix == ".json" if files.root.is_file() else bool(files.matching("transforms*.json"))


def read_nerfstudio(root: Path, config: SceneConfig) -> Capture:
    """Read a transforms.json.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    path, held_out = _files(root)
    meta = read_json_object(path)
    frames = _frames(meta, path)
    test = _split(meta, frames, path)
    for other in held_out:  # Blender's form: a file for each part
        more = read_json_object(other)
        extra = _frames(more, other)
        intrinsics = {key: value for key, value in more.items() if key not in ("frames",)}
        extra = [{**intrinsics, **frame} for frame in extra]
        test = (test or frozenset()) | {_name(frame, other) for frame in extra}
        frames = frames + extra
    shots = shots_of(meta, frames, path, lambda name: photo_at(path.parent, name, path))
    points = _points(meta, path)
    return Capture(
        root,
        "nerfstudio",
        shots,
        C2W_OPENGL,
        metric=False,
        why="transforms.json does not tell",
        world_from_disk=capture_world(meta, path),
        test=test,
        points=points,
        gt_mesh=gt_mesh_in(path.parent),
        notes=[],
    )


def shots_of(
    meta: Mapping[str, Any],
    frames: list[dict[str, Any]],
    path: Path,
    photo: Callable[[str], Path],
    mask: Callable[[str], Path] | None = None,
) -> list[Shot]:
    """The frames of a transforms.json, in natural order of their names.

    Args:
        photo, mask: where a file is that a frame names.
    """
    lenses: dict[str, Lens] = {}
    shots = {}
    for frame in frames:
        name = _name(frame, path)
        if name in shots:
            raise InputError(f"{path} has the photo {name} twice; delete one of the two frames")
        file = photo(name)
        lens = _lens(meta, frame, path, file, lenses)
        depth = frame.get("depth_file_path")
        hidden = frame.get("mask_path")
        shots[name] = Shot(
            name,
            file,
            _pose(frame, path, name),
            lens,
            depth=_depth(meta, path, depth) if isinstance(depth, str) and depth else None,
            mask=PhotoFile((mask or partial(inside, path.parent, source=path))(hidden))
            if isinstance(hidden, str) and hidden
            else None,
        )
    return [shots[name] for name in natural(shots)]


def photo_at(folder: Path, name: str, path: Path) -> Path:
    """A photo by its name, which instant-ngp and Blender write without its suffix."""
    file = inside(folder, name, path)
    if file.suffix and (file.is_file() or file.suffix.lower() in (".jpg", ".jpeg", ".png")):
        return file
    return next((found for end in (".png", ".jpg", ".jpeg", ".JPG") if (found := Path(f"{file}{end}")).is_file()), file)


def capture_world(meta: Mapping[str, Any], path: Path) -> np.ndarray | None:
    """(4, 4) back from the saved world to the capture's: the inverse of applied_scale * applied_transform."""
    applied = np.eye(4)
    if "applied_transform" in meta:
        rows = numbers(meta, "applied_transform", _count(meta["applied_transform"]), path).reshape(-1, 4)
        applied[:3] = rows[:3]
    scale = number(meta, "applied_scale", path, 1.0)
    linear = applied[:3, :3]
    if not np.isfinite(applied).all() or np.abs(linear.T @ linear - np.eye(3)).max() > 1e-3 or scale <= 0:
        raise InputError(f"{path} has an applied_transform that is no rotation; remove it and applied_scale")
    if np.linalg.det(linear) < 0:
        raise InputError(f"{path} has an applied_transform that mirrors; remove it and mirror the poses back")
    if "applied_transform" not in meta and "applied_scale" not in meta:
        return None
    applied[:3] *= scale
    return np.linalg.inv(applied)


def _files(root: Path) -> tuple[Path, list[Path]]:
    """The file to read, and those of held-out photos beside it."""
    if root.is_file():
        return root, []
    for name in NAMES:
        if (root / name).is_file():
            others = [root / "transforms_test.json"] if name == NAMES[1] else []
            return root / name, [other for other in others if other.is_file()]
    found = Listing(root).matching("transforms*.json")
    if len(found) != 1:
        named = f" ({', '.join(found)})" if found else ""
        raise InputError(f"{root} has {len(found)} files transforms*.json{named}; give scene.path=FILE of one")
    return root / found[0], []


def _frames(meta: Mapping[str, Any], path: Path) -> list[dict[str, Any]]:
    frames = meta.get("frames")
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise InputError(f"{path} has no list of frames; write the file again")
    return frames


def _name(frame: Mapping[str, Any], path: Path) -> str:
    name = frame.get("file_path")
    if not isinstance(name, str) or not name or not name.isprintable():
        raise InputError(f"{path} has a frame without a usable file_path; write the file again")
    return name.removeprefix("./")


def _pose(frame: Mapping[str, Any], path: Path, name: str) -> np.ndarray:
    matrix = frame.get("transform_matrix")
    label = f"{path} (frame {name})"
    rows = numbers({"transform_matrix": matrix}, "transform_matrix", _count(matrix), label).reshape(-1, 4)
    return rows if len(rows) == 4 else np.concatenate([rows, [[0.0, 0.0, 0.0, 1.0]]])


def _count(matrix: Any) -> int:
    """12 or 16 numbers: the last row may be left out."""
    return 12 if isinstance(matrix, list) and len(matrix) in (3, 12) else 16


def _lens(
    meta: Mapping[str, Any], frame: Mapping[str, Any], path: Path, photo: Path, known: dict[str, Lens]
) -> Lens | None:
    """A key at the top wins over a frame's."""
    values = {**frame, **{key: value for key, value in meta.items() if key != "frames"}}
    keys = ("fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2", "camera_model", "is_fisheye")
    keys += ("distortion_params", "camera_angle_x", "camera_angle_y", "x_fov", "y_fov")
    short = repr([values.get(key) for key in keys])
    if short not in known or "w" not in values:
        known[short] = _new_lens(values, path, photo)
    return known[short]


def _new_lens(values: Mapping[str, Any], path: Path, photo: Path) -> Lens | None:
    if "w" in values and "h" in values:
        size = int(number(values, "w", path)), int(number(values, "h", path))
    else:
        size = PhotoFile(photo).size()
    if min(size) < 1:
        raise InputError(f"{path} has photos of {size[0]}x{size[1]} pixels; correct w and h")
    fx = _focal(values, "x", size[0], path)
    fy = _focal(values, "y", size[1], path)
    if fx is None and fy is None:
        return None
    fx, fy = fx or fy, fy or fx
    cx, cy = number(values, "cx", path, size[0] / 2), number(values, "cy", path, size[1] / 2)
    model = str(values.get("camera_model", "OPENCV")).upper()
    if values.get("is_fisheye") is True:
        model = "OPENCV_FISHEYE"
    k, p = _distortion(values, path)
    if model in FISHEYE:
        lens = Lens("OPENCV_FISHEYE", (fx, fy, cx, cy, *k), size, str(path))
    elif model not in PERSPECTIVE:
        raise InputError(f"{path} has camera_model {model[:40]!r}, which is not read; undistort the photos to PINHOLE")
    elif k[3]:
        raise InputError(f"{path} has a perspective camera with k4, which is not read; undistort the photos")
    elif k[2]:
        lens = Lens("FULL_OPENCV", (fx, fy, cx, cy, k[0], k[1], *p, k[2], 0.0, 0.0, 0.0), size, str(path))
    elif any(k) or any(p):
        lens = Lens("OPENCV", (fx, fy, cx, cy, k[0], k[1], *p), size, str(path))
    else:
        lens = Lens("PINHOLE", (fx, fy, cx, cy), size, str(path))
    lens.check()
    return lens


def _focal(values: Mapping[str, Any], axis: str, side: int, path: Path) -> float | None:
    if f"fl_{axis}" in values:
        return number(values, f"fl_{axis}", path)
    for key, unit in ((f"camera_angle_{axis}", 1.0), (f"{axis}_fov", math.pi / 180)):
        if key in values:
            half = 0.5 * unit * number(values, key, path)
            if not 0 < half < math.pi / 2:
                raise InputError(f"{path} has {key}={values[key]}, which is no field of view; correct it")
            return side / 2 / math.tan(half)
    return None


def _distortion(values: Mapping[str, Any], path: Path) -> tuple[list[float], list[float]]:
    """(k1 k2 k3 k4), (p1 p2)."""
    if "distortion_params" in values and values["distortion_params"] is not None:
        found = numbers(values, "distortion_params", 6, path)
        return list(found[:4]), list(found[4:])
    found = {key: number(values, key, path, 0.0) for key in ("k1", "k2", "k3", "k4", "p1", "p2")}
    return [found[f"k{i}"] for i in (1, 2, 3, 4)], [found["p1"], found["p2"]]


def _depth(meta: Mapping[str, Any], path: Path, name: str):
    return depth_file(inside(path.parent, name, path), positive(meta, "depth_unit_scale_factor", path, 0.001))


def _split(meta: Mapping[str, Any], frames: list[dict[str, Any]], path: Path) -> frozenset[str] | None:
    """Names of held-out photos: those of test, and where there is none, of val."""
    lists = {key: meta[key] for key in SPLITS if isinstance(meta.get(key), list)}
    for key in ("test_filenames", "val_filenames"):
        if lists.get(key):
            return frozenset(str(name).removeprefix("./") for name in lists[key])
    return None


def _points(meta: Mapping[str, Any], path: Path) -> Callable[[], RawPoints] | None:
    name = meta.get("ply_file_path")
    if not isinstance(name, str) or not name:
        return None
    return partial(ply_points, inside(path.parent, name, path))


def ply_points(path: Path) -> RawPoints:
    """Points without tracks."""
    cloud = read_ply(path)
    return RawPoints(cloud.xyz, cloud.rgb)
