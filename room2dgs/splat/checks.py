"""What a renderer is given must be drawable as it stands: anything else is refused with a sentence.

Shapes, types and devices can be checked while `torch.compile` traces; values only when the numbers are there. Hence
two functions.
"""

from __future__ import annotations

import math
from typing import Any

from torch import Tensor

from room2dgs.geometry.arguments import check_has_values, number
from room2dgs.splat.constants import OPACITY_FLOOR, SH_DEGREE_OF
from room2dgs.splat.types import Gaussians, Surfels

MAX_SIDE_PX = 16384
SCALES_OF = {Surfels: 2, Gaussians: 3}
FILTER_PX2 = (0.01, 1.0)
SKEW_MAX_PX = 1e-6  # rounding of a product of matrices, not a skew
RIGID_TOLERANCE = 1e-3  # of R R^T - I


def check_shapes(
    surfels: Surfels | Gaussians,
    K: Tensor,
    cam_from_world: Tensor,
    width: int,
    height: int,
    background: Tensor | None,
    center_px: Tensor | None,
) -> None:
    """Shapes, types and devices.

    Raises:
        TypeError: something is no tensor, or no number of pixels.
        ValueError: one of them does not fit.
    """
    kind = type(surfels).__name__.lower()
    tensors = {**surfels._asdict(), "K": K, "cam_from_world": cam_from_world}
    optional = {"background": background, "center_px": center_px}
    check_tensors(**tensors, **{name: tensor for name, tensor in optional.items() if tensor is not None})
    if not surfels.centers.ndim:
        raise ValueError(f"{kind}.centers has no rows")
    count = surfels.centers.shape[0]
    shapes = {
        "centers": (count, 3),
        "rotations": (count, 4),
        "scales": (count, SCALES_OF[type(surfels)]),
        "opacities": (count,),
    }
    for name, shape in shapes.items():
        _check_shape(f"{kind}.{name}", getattr(surfels, name), shape)
    sh = surfels.sh
    if sh.ndim != 3 or sh.shape[0] != count or sh.shape[1] not in SH_DEGREE_OF or sh.shape[2] != 3:
        raise ValueError(f"{kind}.sh has shape {tuple(sh.shape)}, not ({count}, 1 | 4 | 9 | 16, 3)")
    dtype, device = surfels.centers.dtype, surfels.centers.device
    for name, tensor in zip(surfels._fields, surfels, strict=True):
        if not tensor.dtype.is_floating_point or tensor.dtype != dtype or tensor.device != device:
            raise ValueError(
                f"{kind}.{name} is {tensor.dtype} on {tensor.device}, but {kind}.centers {dtype} on {device}"
            )
    others = {
        "K": (K, (3, 3)), "cam_from_world": (cam_from_world, (4, 4)), "background": (background, (3,)),
        "center_px": (center_px, (count, 2)),
    }  # fmt: skip
    for name, (given, shape) in others.items():
        if given is not None:
            _check_shape(name, given, shape)
            if not given.dtype.is_floating_point or given.device != device:
                raise ValueError(f"{name} is {given.dtype} on {given.device}, not floating point on {device}")
    check_side("width", width)
    check_side("height", height)
    if not (1 <= width <= MAX_SIDE_PX and 1 <= height <= MAX_SIDE_PX):
        raise ValueError(f"image size {width} x {height} is not in 1..{MAX_SIDE_PX}")


def check_tensors(**tensors: Any) -> None:
    """What is to be tensors, not lists or arrays.

    Raises:
        TypeError: it is not.
    """
    for name, tensor in tensors.items():
        if not isinstance(tensor, Tensor):
            raise TypeError(f"{name} is of the type {type(tensor).__name__}, not a torch.Tensor")


def check_floating(**tensors: Any) -> None:
    """The same, of one floating type, on one device that holds values.

    Raises:
        TypeError: something is no tensor.
        ValueError: another type or device than the first one's.
    """
    check_tensors(**tensors)
    (first, like), *_ = tensors.items()
    for name, tensor in tensors.items():
        if not tensor.dtype.is_floating_point or tensor.dtype != like.dtype or tensor.device != like.device:
            raise ValueError(
                f"{name} is {tensor.dtype} on {tensor.device}, but {first} {like.dtype} on {like.device}; all are to "
                "be of one floating type on one device"
            )
    check_has_values(first, like)


def check_side(name: str, side: Any) -> None:
    """A number of pixels; how many is looked at elsewhere.

    Raises:
        TypeError: it is no number.
        ValueError: it is no whole number.
    """
    if isinstance(side, bool | float):
        raise ValueError(f"{name} is {side}, not a whole number of pixels")
    if not hasattr(side, "__index__") or isinstance(side, Tensor):
        raise TypeError(f"{name} is {side!r}, not a whole number of pixels")


def _check_shape(name: str, tensor: Tensor, shape: tuple[int, ...]) -> None:
    if tuple(tensor.shape) != shape:
        raise ValueError(f"{name} has shape {tuple(tensor.shape)}, not {shape}")


def check_values(K: Tensor, cam_from_world: Tensor, background: Tensor, near_m: float, opacity_floor: float) -> None:
    """Numbers that the maths does not allow for, or that would be ignored.

    Raises:
        ValueError: a focal length that is not positive, a skewed K or one whose last row is not 0 0 1, a pose that is
            not rigid, a near plane that is not in front of the camera, an opacity floor that is no share of 1, anything
            that is not finite.
    """
    check_near(near_m)
    check_floor(opacity_floor)
    _check_intrinsics(K)
    _check_rigid(cam_from_world)
    if not all(map(math.isfinite, background.tolist())):
        raise ValueError("background has an entry that is not finite")


def _check_intrinsics(K: Tensor) -> None:
    (fx, skew, cx), (other_skew, fy, cy), last = K.tolist()
    if not all(map(math.isfinite, (fx, skew, cx, other_skew, fy, cy, *last))):
        raise ValueError("K has an entry that is not finite")
    if not (fx > 0 and fy > 0):
        raise ValueError(f"K has focal lengths {fx} and {fy}; both must be above 0")
    if abs(skew) > SKEW_MAX_PX or abs(other_skew) > SKEW_MAX_PX:
        raise ValueError(f"K is skewed (K[0,1] = {skew}, K[1,0] = {other_skew}); undistort to images without skew")
    if not _is_last_row(last):
        raise ValueError(f"K's last row is {last}, not 0 0 1")


def _check_rigid(cam_from_world: Tensor) -> None:
    *rows, last = cam_from_world.tolist()
    if not all(math.isfinite(x) for row in (*rows, last) for x in row):
        raise ValueError("cam_from_world has an entry that is not finite")
    if not _is_last_row(last):
        raise ValueError(f"cam_from_world's last row is {last}, not 0 0 0 1")
    for i in range(3):
        for j in range(i + 1):
            product = sum(a * b for a, b in zip(rows[i][:3], rows[j][:3], strict=True))
            if abs(product - (i == j)) > RIGID_TOLERANCE:
                raise ValueError("cam_from_world is not rigid: its 3 x 3 block is no rotation")


def check_near(near_m: float) -> None:
    """The near plane's distance.

    Raises:
        ValueError: it is not in front of the camera, or not finite.
    """
    if not 0 < number("near_m", near_m, finite=False) < math.inf:
        raise ValueError(f"near_m is {near_m}; the near plane lies in front of the camera, at a distance above 0")


def check_far(name: str, far_m: float, near_m: float) -> None:
    """Where surfels are no longer drawn; it may be infinite.

    Raises:
        ValueError: it is not beyond the near plane.
    """
    if not number(name, far_m, finite=False) > near_m:
        raise ValueError(f"{name} {far_m} is not beyond the near plane's {near_m}")


def check_floor(opacity_floor: float) -> None:
    """The opacity below which a hit is skipped.

    Raises:
        ValueError: it is not a share of 1, or below 1/255: of what is so faint float32 cannot tell the expected depth's
            gradient.
    """
    if not OPACITY_FLOOR <= number("opacity_floor", opacity_floor) < 1:
        raise ValueError(f"opacity_floor is {opacity_floor}; it is from 1/255 to below 1")


def check_filter(name: str, variance_px2: float) -> None:
    """The variance of the pixel's filter.

    Raises:
        TypeError: it is no number.
        ValueError: it is out of range.
    """
    if not FILTER_PX2[0] <= number(name, variance_px2) <= FILTER_PX2[1]:
        raise ValueError(f"{name} is {variance_px2}; it is from {FILTER_PX2[0]} to {FILTER_PX2[1]:g} px^2")


def switch(name: str, value: Any) -> bool:
    """True or False.

    Raises:
        TypeError: it is neither.
    """
    if not isinstance(value, bool | int):
        raise TypeError(f"{name} is of the type {type(value).__name__}, neither True nor False")
    return bool(value)


def _is_last_row(row: list[float]) -> bool:
    return all(abs(x) <= 1e-6 for x in row[:-1]) and abs(row[-1] - 1) <= 1e-6


def check_center_px(center_px: Tensor | None) -> None:
    """`center_px` exists for its gradient: it cannot move anything.

    Raises:
        ValueError: it is not zero.
    """
    if center_px is not None and center_px.count_nonzero():
        raise ValueError("center_px is not zero; it exists for its gradient and cannot move projected centres")
