"""Intrinsics in a transforms.json: a frame's own where it has them, those at the top of its file elsewhere.

nerfstudio lets the top win, instant-ngp the frame. Converters leave stale numbers at the top, so the frame wins here
and where the two differ both are named.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from room2dgs.captures.lens import Lens
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.text_files import number, numbers
from room2dgs.errors import InputError
from room2dgs.texts import shown

PERSPECTIVE = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV", "PERSPECTIVE")
FISHEYE = ("OPENCV_FISHEYE",)
# A frame that has one of these has its own focal length, whatever the form of the one at the top.
FOCAL = ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y", "x_fov", "y_fov")
COEFFICIENTS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
MODEL = ("camera_model", "is_fisheye")
SINGLE = ("cx", "cy", "w", "h")
LENS_KEYS = (*FOCAL, *COEFFICIENTS, "distortion_params", *MODEL, *SINGLE)
# what instant-ngp's other cameras are told by
OTHER_CAMERAS = ("latlong", "equirectangular", "ftheta_p0")
SAME = 1e-6  # relative
LARGEST = 1e15  # of what is compared; nothing of a camera is larger


def lens_of(
    meta: Mapping[str, Any], frame: Mapping[str, Any], path: Path, photo: Path, known: dict[str, Lens | None]
) -> Lens | None:
    """The lens of a frame's photo; None where no focal length is given.

    Args:
        meta: the file of the frame.
        photo: opened where neither says its size.
        known: lenses made before, which this adds to.

    Raises:
        InputError: numbers that are no camera, or a camera that is not read.
    """
    values = own_values(meta, frame)
    short = repr(sorted(values.items(), key=lambda item: item[0]))
    if short not in known or not {"w", "h"} <= values.keys():
        known[short] = _new_lens(values, path, photo)
    return known[short]


def own_values(meta: Mapping[str, Any], frame: Mapping[str, Any]) -> dict[str, Any]:
    """What holds for a frame, of `LENS_KEYS`; null is nothing."""
    top = {key: meta[key] for key in LENS_KEYS if meta.get(key) is not None}
    own = {key: frame[key] for key in LENS_KEYS if frame.get(key) is not None}
    if any(key in own for key in FOCAL):
        top = {key: value for key, value in top.items() if key not in FOCAL}
    if "distortion_params" in own:
        top = {key: value for key, value in top.items() if key not in COEFFICIENTS}
    elif any(key in own for key in COEFFICIENTS):
        top.pop("distortion_params", None)
    if any(key in own for key in MODEL):
        top = {key: value for key, value in top.items() if key not in MODEL}
    return {**top, **own}


def contradictions(meta: Mapping[str, Any], frames: Sequence[Mapping[str, Any]], path: Path) -> list[str]:
    """A sentence that names both numbers where frames have others than the top of their file."""
    differing: dict[str, Any] = {}
    count = 0
    for frame in frames:
        other = [key for key in (*FOCAL, *COEFFICIENTS, *SINGLE) if key in meta and _differ(meta[key], frame.get(key))]
        count += bool(other)
        for key in other:
            differing.setdefault(key, frame[key])
    if not differing:
        return []
    top = ", ".join(f"{key}={meta[key]:.6g}" for key in differing)
    own = ", ".join(f"{key}={value:.6g}" for key, value in differing.items())
    return [
        f"{path} gives {top} at its top and {own} in a frame; {count} of {len(frames)} frames have numbers of their "
        "own, which are taken; delete those that are wrong"
    ]


def _differ(top: Any, own: Any) -> bool:
    if not all(type(value) in (int, float) and abs(value) < LARGEST for value in (top, own)):
        return False
    return abs(top - own) > SAME * max(abs(top), abs(own))


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
    fx, fy = fx or fy or 0.0, fy or fx or 0.0
    cx, cy = number(values, "cx", path, size[0] / 2), number(values, "cy", path, size[1] / 2)
    model = str(values.get("camera_model", "OPENCV")).upper()
    if values.get("is_fisheye") is True:
        model = "OPENCV_FISHEYE"
    k, p = _distortion(values, path)
    middle = (fx, fy, cx, cy)
    # the photo's own size does not say which size these numbers are for
    meant = size if "w" in values and "h" in values else None
    if model in FISHEYE:
        if any(k[4:]):
            raise InputError(f"{path} has a fisheye camera with k5 or k6, which is not read; undistort the photos")
        lens = Lens("OPENCV_FISHEYE", (*middle, *k[:4]), meant, str(path))
    elif model not in PERSPECTIVE:
        raise InputError(
            f"{path} has camera_model {shown(model, 40)!r}, which is not read; undistort the photos to PINHOLE"
        )
    elif k[3] and not (model == "FULL_OPENCV" or "k5" in values or "k6" in values):
        raise InputError(
            f"{path} has a perspective camera with k4 alone, which is not read: nerfstudio means a term of r^8 by it "
            "and OpenCV a divisor; undistort the photos, or write camera_model=FULL_OPENCV if it is OpenCV's"
        )
    elif any(k[2:]):
        # OpenCV's order: k1 k2 p1 p2 k3, and the divisor's k4 k5 k6
        lens = Lens("FULL_OPENCV", (*middle, k[0], k[1], *p, *k[2:]), meant, str(path))
    elif any(k) or any(p):
        lens = Lens("OPENCV", (*middle, k[0], k[1], *p), meant, str(path))
    else:
        lens = Lens("PINHOLE", middle, meant, str(path))
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
    """(k1 k2 k3 k4 k5 k6), (p1 p2)."""
    if "distortion_params" in values:
        found = numbers(values, "distortion_params", 6, path)  # nerfstudio's order
        return [*found[:4], 0.0, 0.0], list(found[4:])
    known = {key: number(values, key, path, 0.0) for key in COEFFICIENTS}
    return [known[f"k{i}"] for i in range(1, 7)], [known["p1"], known["p2"]]
