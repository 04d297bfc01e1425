"""nerfstudio's and instant-ngp's transforms.json: camera-to-world with OpenGL axes, pixel centres at +0.5.

The world is the capture's own: what was applied to it when it was saved (`applied_transform`, `applied_scale`) is
undone, and it is neither re-oriented nor centred nor scaled, as nerfstudio does on loading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from room2dgs.captures.capture import C2W_OPENGL, Capture, RawPoints, Shot
from room2dgs.captures.depth_maps import DepthMap, depth_file
from room2dgs.captures.hidden_where import HiddenWhere
from room2dgs.captures.left_out import absence, left_out, some
from room2dgs.captures.listing import Listing, gt_mesh_in, inside, listed, natural
from room2dgs.captures.named_maps import without_missing_maps
from room2dgs.captures.photo_names import check_count
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.point_files import read_ply
from room2dgs.captures.reader import Reader
from room2dgs.captures.readers.transforms_keys import key_notes
from room2dgs.captures.readers.transforms_lens import contradictions, lens_of
from room2dgs.captures.text_files import number, numbers, positive, read_json_object
from room2dgs.captures.unmatched import DEPTH, FOLDERS, MASK
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "transforms.json (nerfstudio, instant-ngp)"
NAMES = ("transforms.json", "transforms_train.json")
HELD_OUT = ("transforms_test.json", "transforms_val.json")  # the first that is there; the other is named
SPLITS = ("test_filenames", "val_filenames")
ENDINGS = (".png", ".jpg", ".jpeg", ".JPG", ".PNG", ".JPEG", ".webp", ".tif", ".tiff", ".bmp")
METRES_BELOW = 100.0  # fractions that are all smaller are metres: a room in millimetres has larger ones
FRACTIONS = (".npy", ".exr", ".tif", ".tiff")  # files of depth that may hold them
SAMPLED = 5  # depth maps that are looked at for their unit


@dataclass
class Messages:
    """What a person should know of some frames, gathered while they are read.

    Attributes:
        notes, warnings: as `Capture` has them.
    """

    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def is_nerfstudio(files: Listing) -> bool:
    """transforms.json or another transforms*.json; or a .json itself."""
    return files.root.suffix == ".json" if files.root.is_file() else bool(files.matching("transforms*.json"))


def read_nerfstudio(root: Path, config: SceneConfig) -> Capture:
    """Read a transforms.json.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    messages = Messages()
    path, held_out = _files(root, messages)
    meta = read_json_object(path)
    shots = _shots(meta, path, config, messages)
    test = _split(meta)
    for other in held_out:  # Blender's form: a file for each part, with intrinsics of its own
        more = read_json_object(other)
        _check_same_world(meta, path, more, other)
        extra = _shots(more, other, config, messages)
        twice = {shot.name for shot in shots} & {shot.name for shot in extra}
        if twice:
            raise InputError(f"{path} and {other.name} both have the photo {min(twice)}; delete one of the frames")
        test = (test or frozenset()) | {shot.name for shot in extra}
        shots = shots + extra
    messages.warnings += _unnamed(path.parent, shots)
    named = {shot.name: shot for shot in shots}
    return Capture(
        root,
        "nerfstudio",
        [named[name] for name in natural(named)],
        C2W_OPENGL,
        metric=False,
        why="transforms.json does not tell",
        world_from_disk=capture_world(meta, path),
        test=test,
        points=_points(meta, path, messages),
        gt_mesh=gt_mesh_in(path.parent),
        notes=messages.notes,
        warnings=messages.warnings,
    )


def _shots(meta: dict[str, Any], path: Path, config: SceneConfig, messages: Messages) -> list[Shot]:
    """The frames of one file, with depth and masks that are files of their own."""
    frames = _frames(meta, path)
    notes, warnings = key_notes(meta, frames, path)
    messages.notes += notes
    messages.warnings += [*warnings, *contradictions(meta, frames, path)]
    depth = _depth_of(meta, frames, path, config.given_unit, messages)
    shots = shots_of(meta, frames, path, partial(photo_at, path.parent, path=path), depth=depth, messages=messages)
    messages.warnings += _of_several(shots)
    shots, gone = without_missing_maps(shots, path)
    messages.warnings += gone
    return _with_masks_of_ngp(shots, messages)


def shots_of(
    meta: Mapping[str, Any],
    frames: list[dict[str, Any]],
    path: Path,
    photo: Callable[[str], Path],
    mask: Callable[[str], Path] | None = None,
    depth: Callable[[Mapping[str, Any]], DepthMap | None] | None = None,
    messages: Messages | None = None,
) -> list[Shot]:
    """The frames of a transforms.json, in natural order of their names.

    One whose pose cannot be used has a function for it that says so; one without a name is left out.

    Args:
        photo, mask: where a file is that a frame names.
        depth: of a frame; None: what nerfstudio names.
        messages: takes what a person should know.

    Raises:
        InputError: intrinsics that are no camera, a path out of the capture, a photo twice, or too many bad frames.
    """
    messages = messages or Messages()
    lenses: dict[str, Any] = {}
    shots: dict[str, Shot] = {}
    bad: dict[str, str] = {}
    seen: dict[str, dict[str, Any]] = {}
    again = 0
    for index, frame in enumerate(frames):
        try:
            name = _name(frame, path)
        except InputError as error:
            bad[f"frame {index}"] = str(error)
            continue
        if name in shots:
            if frame != seen[name]:
                raise InputError(f"{path} has the photo {name} twice; delete one of the two frames")
            again += 1
            continue
        seen[name] = frame
        file = photo(name)
        try:
            pose: Any = _pose(frame, path, name)
        except InputError as error:
            pose = partial(_refused, str(error))
        gone = absence(file) is not None
        lens = None if gone and not _says_size(meta, frame) else lens_of(meta, frame, path, file, lenses)
        hidden = frame.get("mask_path")
        shots[name] = Shot(
            name,
            file,
            pose,
            lens,
            depth=depth(frame) if depth else _depth(meta, path, frame.get("depth_file_path")),
            mask=PhotoFile((mask or partial(inside, path.parent, source=path))(hidden))
            if isinstance(hidden, str) and hidden
            else None,
        )
    message = left_out(bad, len(frames), "frames without a usable name")
    messages.warnings += [f"{path}: {message}"] if message else []
    messages.notes += [f"{path}: {again} frames are there twice, and one of each is taken"] if again else []
    return [shots[name] for name in natural(shots)]


def _refused(reason: str) -> np.ndarray:
    """A pose that cannot be used, which costs its frame alone if there are few of them."""
    raise InputError(reason)


def photo_at(folder: Path, name: str, path: Path) -> Path:
    """A photo by its name, which instant-ngp and Blender write without its suffix."""
    file = inside(folder, name, path)
    if file.suffix and (file.is_file() or file.suffix.lower() in ENDINGS):
        return file
    return next((found for end in ENDINGS if (found := Path(f"{file}{end}")).is_file()), file)


def _of_several(shots: list[Shot]) -> list[str]:
    """A warning where names without a suffix fit several files."""
    several = [
        f"{shot.path.name} of {', '.join(fits)}"
        for shot in shots
        if Path(shot.name).suffix.lower() not in ENDINGS and len(fits := _fitting(shot)) > 1
    ]
    if not several:
        return []
    return [f"{len(several)} photos are named without their suffix and there are several of each: {some(several)}"]


def _fitting(shot: Shot) -> list[str]:
    """Names of the files that a name without its suffix may mean."""
    names, start = listed(shot.path.parent), PurePosixPath(shot.name.replace("\\", "/")).name
    return [f"{start}{end}" for end in ENDINGS if f"{start}{end}" in names]


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


def _check_same_world(meta: Mapping[str, Any], path: Path, more: Mapping[str, Any], other: Path) -> None:
    """A part that says nothing is in the world of the first."""
    worlds = [capture_world(meta, path), capture_world(more, other)]
    first, second = (np.eye(4) if world is None else world for world in worlds)
    if worlds[1] is not None and not np.allclose(first, second, rtol=1e-6, atol=1e-9):
        raise InputError(
            f"{path} and {other.name} have different applied_transform or applied_scale; save both in one world"
        )


def _files(root: Path, messages: Messages) -> tuple[Path, list[Path]]:
    """The file to read, and the one of held-out photos beside it."""
    if root.is_file():
        return root, []
    found = Listing(root).matching("transforms*.json")
    name = next((name for name in NAMES if name in found), None)
    if name is None:
        if len(found) != 1:
            named = f" ({', '.join(found)})" if found else ""
            raise InputError(f"{root} has {len(found)} files transforms*.json{named}; give scene.path=FILE of one")
        return root / found[0], []
    others = [other for other in HELD_OUT if other in found][:1] if name == NAMES[1] else []
    unread = [other for other in found if other not in (name, *others)]
    if unread:
        messages.notes.append(
            f"{root / name} is read, {', '.join(unread)} beside it not; give scene.path=FILE to read that"
        )
    return root / name, [root / other for other in others]


def _frames(meta: Mapping[str, Any], path: Path) -> list[dict[str, Any]]:
    """What is no object becomes an empty one, so that it is counted as a frame without a name."""
    frames = meta.get("frames")
    if not isinstance(frames, list) or not any(isinstance(frame, dict) for frame in frames):
        raise InputError(f"{path} has no list of frames; write the file again")
    check_count(len(frames), path)
    return [frame if isinstance(frame, dict) else {} for frame in frames]


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


def _says_size(meta: Mapping[str, Any], frame: Mapping[str, Any]) -> bool:
    return all(meta.get(key) is not None or frame.get(key) is not None for key in ("w", "h"))


def _depth(meta: Mapping[str, Any], path: Path, name: object, default: float = 0.001) -> DepthMap | None:
    """nerfstudio's depth: millimetres, if nothing else is said."""
    if not isinstance(name, str) or not name:
        return None
    return depth_file(inside(path.parent, name, path), positive(meta, "depth_unit_scale_factor", path, default))


def _default_unit(meta: Mapping[str, Any], frames: list[dict[str, Any]], path: Path, messages: Messages) -> float:
    """Metres of one unit of depth where no key tells: of fractions as small as metres are (.npy, .exr, float .tiff)
    it is one, else they are millimetres, as nerfstudio has it.
    """
    found = (frame.get("depth_file_path") for frame in frames)
    names = [name for name in found if isinstance(name, str) and name]
    if "depth_unit_scale_factor" in meta or not names:
        return 0.001
    greatest = []
    for name in names[:: max(1, len(names) // SAMPLED)]:
        with suppress(InputError):
            if Path(name).suffix.lower() not in FRACTIONS:
                return 0.001
            values = depth_file(inside(path.parent, name, path)).read()
            if values.dtype.kind != "f":
                return 0.001
            greatest.append(float(values[np.isfinite(values)].max(initial=0.0)))
    if not greatest or not 0 < max(greatest) < METRES_BELOW:
        return 0.001
    messages.notes.append(
        f"depth: {path} has no depth_unit_scale_factor, and the maps hold fractions of at most {max(greatest):.3g}, "
        "which are read as metres"
    )
    return 1.0


def _depth_of(
    meta: Mapping[str, Any], frames: list[dict[str, Any]], path: Path, unit: float | None, messages: Messages
) -> Callable[[Mapping[str, Any]], DepthMap | None]:
    """nerfstudio's depth_file_path, or instant-ngp's depth_path in units of the poses."""
    default = _default_unit(meta, frames, path, messages)
    ngp = [frame for frame in frames if frame.get("depth_path") and not frame.get("depth_file_path")]
    why = ""
    if meta.get("enable_depth_loading") is False:
        why = "enable_depth_loading is false"
    elif "integer_depth_scale" not in meta and "depth_unit_scale_factor" not in meta:
        why = "it has no integer_depth_scale, which tells its unit"
    if ngp and why:
        messages.warnings.append(f"{path} names depth_path in {len(ngp)} frames, which is not read: {why}")

    def depth(frame: Mapping[str, Any]) -> DepthMap | None:
        if frame.get("depth_file_path"):
            return _depth(meta, path, frame["depth_file_path"], default)
        name = frame.get("depth_path")
        if why or not isinstance(name, str) or not name:
            return None
        if "integer_depth_scale" not in meta:
            return _depth(meta, path, name)
        return depth_file(
            inside(path.parent, name, path),
            positive(meta, "integer_depth_scale", path) * (1.0 if unit is None else unit),
        )

    return depth


def _unnamed(folder: Path, shots: list[Shot]) -> list[str]:
    """Folders of depth maps and masks beside the file, where its frames name none."""
    used = {DEPTH: any(shot.depth is not None for shot in shots), MASK: any(shot.mask is not None for shot in shots)}
    key = {DEPTH: "depth_file_path", MASK: "mask_path"}
    return [
        f"{folder / name} has {len(listed(folder / name))} files, and no frame names a {kind} ({key[kind]}), so "
        "nothing in it is used"
        for kind, pattern in FOLDERS.items()
        for name in natural(listed(folder))
        if not used[kind] and pattern.search(name.lower()) and listed(folder / name)
    ]


def _with_masks_of_ngp(shots: list[Shot], messages: Messages) -> list[Shot]:
    """instant-ngp's masks of what moves, dynamic_mask_<photo>.png beside it, which hide where they are not black."""
    folders = {folder: listed(folder) for folder in {shot.path.parent for shot in shots}}
    rays = [name for names in folders.values() for name in names if name.startswith("rays_") and name.endswith(".dat")]
    if rays:
        messages.warnings.append(f"{some(natural(rays))}: a ray for each pixel, as instant-ngp has them, is not read")
    names = [f"dynamic_mask_{shot.path.stem}.png" for shot in shots]
    return [
        replace(shot, mask=HiddenWhere(shot.path.parent / name))
        if shot.mask is None and name in folders[shot.path.parent]
        else shot
        for shot, name in zip(shots, names, strict=True)
    ]


def _split(meta: Mapping[str, Any]) -> frozenset[str] | None:
    """Names of held-out photos: those of test, and where there is none, of val."""
    for key in SPLITS:
        if isinstance(meta.get(key), list) and meta[key]:
            return frozenset(str(name).removeprefix("./") for name in meta[key])
    return None


def _points(meta: Mapping[str, Any], path: Path, messages: Messages) -> Callable[[], RawPoints] | None:
    name = meta.get("ply_file_path")
    if not isinstance(name, str) or not name:
        return None
    try:
        file = inside(path.parent, name, path)
    except InputError as error:
        messages.notes.append(f"ply_file_path is not read: {error}")
        return None
    if absence(file) is not None:
        messages.notes.append(
            f"{path} names {name} as ply_file_path, which is not there; photos are matched for points"
        )
        return None
    return partial(ply_points, file)


def ply_points(path: Path) -> RawPoints:
    """Points without tracks."""
    cloud = read_ply(path)
    return RawPoints(cloud.xyz, cloud.rgb)


READER = Reader(is_nerfstudio, read_nerfstudio, LAYOUT, ("colmap",))
