"""Maps that the user already has: finding a frame's file, decoding it, resizing it to the camera."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.opened_images import MOST_DEPTH_PIXELS, opened_image
from room2dgs.captures.scene import Frame
from room2dgs.config import DepthPriorConfig, NormalPriorConfig
from room2dgs.depth.network.map_cache import SUFFIX, read_array
from room2dgs.errors import InputError
from room2dgs.files import NUMPY_DAMAGE
from room2dgs.geometry.camera import Camera
from room2dgs.regular_files import check_regular

SUFFIXES = (".png", ".npy")
# relative difference of the aspect ratios of a map and its photo
MAX_ASPECT_MISMATCH = 0.05
# of a map's pixels
MAX_NOT_FINITE = 0.5
# of a normal's length; 8 bits a channel are good to 0.01
MAX_LENGTH_ERROR = 0.2
# Interpolated depths further from the nearest sample lie between two surfaces, on neither.
MAX_BLEND = 0.05


def find_map(folder: Path, frame: Frame) -> Path | None:
    """The frame's map: <name>.png or .npy, the name being the frame's or its photo's ("000012" or "12").

    Raises:
        InputError: there are two, or the only one is called as photos in several folders are.
    """
    own, by_photo = _called(folder, frame.name), _called(folder, frame.color_path.stem)
    if frame.shares_stem and frame.name != frame.color_path.stem:
        if by_photo and not own:
            raise InputError(
                f"{by_photo[0]} could be of {frame.color_path} or of another photo of that name; call the maps by the "
                f"views' names ({frame.name}{by_photo[0].suffix})"
            )
        by_photo = []
    found = list(dict.fromkeys([*own, *by_photo]))
    if len(found) > 1:
        raise InputError(f"{found[0]} and {found[1].name} are maps of the same frame; delete one of them")
    return found[0] if found else None


def _called(folder: Path, name: str) -> list[Path]:
    return [path for suffix in SUFFIXES if (path := folder / f"{name}{suffix}").is_file()]


def read_depth(path: Path, settings: DepthPriorConfig, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """A depth map at the camera's size; otherwise as `decoded_depth`."""
    return resize_depth(*decoded_depth(path, settings, camera), camera)


def decoded_depth(path: Path, settings: DepthPriorConfig, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """A depth map at its own size.

    Args:
        path: 16-bit one-channel PNG or .npy of (H, W), also with one axis of length 1, or what `write_map` writes.
        settings: `unit_m` is multiplied in; null means 0.001 for PNG and 1 for .npy.
        camera: of the photo, whose shape the map must have.

    Returns:
        (H, W) float32 values, in metres if `meaning` is metric_depth, and (H, W) bool where they are valid.
        0 is invalid, in a metric map anything negative too; invalid values are 0.

    Raises:
        InputError: undecodable, another shape than the photo, mostly not finite, or nothing valid.
    """
    if path.suffix == ".png":
        values, unit = _read_png(path, "I;16", "a 16-bit one-channel PNG").astype(np.float32), 0.001
    else:
        values, unit = _read_npy(path), 1.0
    values = np.squeeze(values)
    if values.ndim != 2:
        raise InputError(f"{path} has shape {values.shape}; a depth map is (height, width)")
    _check_aspect(path, values.shape[1], values.shape[0], camera)
    finite = _check_finite(path, np.isfinite(values))
    unit = unit if settings.unit_m is None else settings.unit_m
    values = np.where(finite, values, 0.0) * np.float32(unit)
    valid = values > 0 if settings.meaning in ("metric_depth", "scaled_depth") else values != 0
    if not valid.any():
        raise InputError(f"{path} has no valid depth (0 = invalid); replace it or delete it")
    return np.where(valid, values, 0.0).astype(np.float32), valid


def read_normal(path: Path, settings: NormalPriorConfig, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """A normal map at the camera's size, in the axes that the file has.

    Args:
        path: 8-bit RGB PNG (n = rgb / 127.5 - 1) or .npy of (H, W, 3) or (3, H, W), as `encoding` says, or what
            `write_map` writes.

    Returns:
        (H, W, 3) float32 unit vectors and (H, W) bool where they are valid; invalid ones are 0.

    Raises:
        InputError: undecodable, another shape than the photo, mostly not finite, or mostly not of unit length.
    """
    wanted = {"png8": (".png",), "npy": (".npy", SUFFIX)}[settings.encoding]
    if path.suffix not in wanted:
        raise InputError(f"{path} does not fit prior.normal.encoding={settings.encoding}; give the other encoding")
    if path.suffix == ".png":
        rgb = _read_png(path, "RGB", "an 8-bit RGB PNG")
        # Black is what tools leave where they know nothing.
        normal = np.where(rgb.any(axis=-1, keepdims=True), rgb.astype(np.float32) / 127.5 - 1.0, 0.0)
    else:
        normal = np.squeeze(_read_npy(path))
        if normal.ndim == 3 and normal.shape[0] == 3 and normal.shape[2] != 3:
            normal = np.moveaxis(normal, 0, -1)
    if normal.ndim != 3 or normal.shape[2] != 3:
        raise InputError(f"{path} has shape {normal.shape}; a normal map is (height, width, 3)")
    _check_aspect(path, normal.shape[1], normal.shape[0], camera)
    finite = _check_finite(path, np.asarray(np.isfinite(normal).all(axis=-1)))
    normal = np.where(finite[..., None], normal, 0.0).astype(np.float32)
    length = np.linalg.norm(normal, axis=-1)
    unit, given = np.abs(length - 1.0) <= MAX_LENGTH_ERROR, length > MAX_LENGTH_ERROR
    if unit.sum() <= 0.5 * given.sum():
        median = float(np.median(length[given])) if given.any() else 0.0
        raise InputError(
            f"{path} holds no unit normals (median length {median:.2f}); give prior.normal.encoding what the file "
            "has, or write n = rgb / 127.5 - 1"
        )
    return resize_normal(normal, unit, camera)


def _read_png(path: Path, mode: str, kind: str) -> np.ndarray:
    """Pillow, because OpenCV fills what is missing from a truncated file and says nothing."""
    with opened_image(path, most=MOST_DEPTH_PIXELS) as image:
        if not (image.mode.startswith("I") if mode == "I;16" else image.mode in ("RGB", "RGBA")):
            raise InputError(f"{path} is not {kind}; write it so, or as .npy")
        return np.asarray(image if mode == "I;16" else image.convert(mode))


def _read_npy(path: Path) -> np.ndarray:
    if path.suffix == SUFFIX and (kept := read_array(path, "map")) is not None:
        return kept
    check_regular(path, "make the map again")
    try:
        values = np.load(path, allow_pickle=False, mmap_mode="r")
    except NUMPY_DAMAGE as error:
        raise InputError(f"{path} cannot be read as .npy; replace it or delete it") from error
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        raise InputError(f"{path} does not hold one array of numbers; write it with numpy.save")
    if values.size > 3 * MOST_DEPTH_PIXELS:
        raise InputError(f"{path} holds {values.size:,} numbers, too many for a map of a photo; make it smaller")
    return values.astype(np.float32)


def _check_aspect(path: Path, width: int, height: int, camera: Camera) -> None:
    if not width or not height or abs(width * camera.height / (height * camera.width) - 1.0) > MAX_ASPECT_MISMATCH:
        raise InputError(
            f"{path} has {width}x{height} pixels, another shape than the photos at {camera.width}x{camera.height}; "
            "make the maps from the whole photos"
        )


def _check_finite(path: Path, finite: np.ndarray) -> np.ndarray:
    if not finite.mean() >= 1.0 - MAX_NOT_FINITE:
        raise InputError(
            f"{path} has {1.0 - finite.mean():.0%} NaN or infinite pixels; make the map again or delete it"
        )
    return finite


def resize_depth(values: np.ndarray, valid: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Linear inside a surface, nearest at its edges and at holes."""
    size = (camera.width, camera.height)
    if (values.shape[1], values.shape[0]) == size:
        return values, valid
    nearest = cv2.resize(values, size, interpolation=cv2.INTER_NEAREST_EXACT)
    nearest_valid = cv2.resize(valid.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT) > 0
    linear = cv2.resize(values, size, interpolation=cv2.INTER_LINEAR)
    whole = cv2.resize(valid.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) > 1.0 - 1e-4
    smooth = whole & (np.abs(linear - nearest) <= MAX_BLEND * np.abs(nearest))
    return np.where(smooth, linear, nearest), nearest_valid


def resize_normal(normal: np.ndarray, valid: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Averaged and brought back to unit length."""
    size = (camera.width, camera.height)
    normal = np.where(valid[..., None], normal, 0.0)
    if (normal.shape[1], normal.shape[0]) != size:
        shrinks = normal.shape[1] > size[0]
        normal = cv2.resize(normal, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    length = np.linalg.norm(normal, axis=-1)
    valid = length > 0.5
    unit = normal / np.where(valid, length, 1.0)[..., None]
    return np.where(valid[..., None], unit, 0.0).astype(np.float32), valid
