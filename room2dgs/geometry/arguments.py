"""Numbers and tensors that public functions are given: what cannot be meant is refused with a sentence.

Types and shapes alone are looked at, which costs microseconds; values of large tensors are not.
"""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:  # torch takes seconds to import, and meshes do without
    from torch import Tensor


def number(name: str, value: Any, above: float | None = None, least: float | None = None, finite: bool = True) -> float:
    """A number, finite if nothing else is said; never NaN.

    Raises:
        TypeError: it is no number.
        ValueError: it is not finite, or too small.
    """
    if isinstance(value, bool | str | bytes) or not hasattr(value, "__float__"):
        raise TypeError(f"{name} is {value!r}, not a number")
    try:
        plain = float(value)
    except (TypeError, ValueError, RuntimeError) as error:  # an array of several
        raise TypeError(f"{name} is no single number") from error
    if math.isnan(plain) or (finite and math.isinf(plain)):
        raise ValueError(f"{name} is {plain}; it is to be finite")
    if above is not None and not plain > above:
        raise ValueError(f"{name} is {plain}; it is to be above {above:g}")
    if least is not None and not plain >= least:
        raise ValueError(f"{name} is {plain}; it is to be {least:g} or more")
    return plain


def whole_number(name: str, value: Any, least: int = 0) -> int:
    """A whole number, not a float.

    Raises:
        TypeError: it is none.
        ValueError: it is too small.
    """
    try:
        plain = operator.index(value)
    except TypeError as error:
        raise TypeError(f"{name} is {value!r}, not a whole number") from error
    if isinstance(value, bool) or plain < least:
        raise ValueError(f"{name} is {value}; it is to be a whole number, {least} or more")
    return plain


def check_tensor(name: str, value: Any, shape: tuple[int | None, ...], kind: str = "floating point") -> None:
    """A tensor with values.

    Args:
        shape: None: any size of 1 or more.
        kind: "floating point" or "bool".

    Raises:
        TypeError: it is no tensor, or one of another type.
        ValueError: it has another shape, or no values: it is empty or on the device `meta`.
    """
    import torch

    if not isinstance(value, torch.Tensor):
        raise TypeError(f"{name} is of the type {type(value).__name__}, not a torch.Tensor")
    dtype = value.dtype
    fits = dtype.is_floating_point if kind == "floating point" else dtype == torch.bool
    if not fits:
        raise TypeError(f"{name} is of {dtype}, not {kind}")
    if value.ndim != len(shape) or any(
        size < 1 if wanted is None else size != wanted for size, wanted in zip(value.shape, shape, strict=True)
    ):
        wanted = ", ".join("any" if side is None else str(side) for side in shape)
        raise ValueError(f"{name} has shape {tuple(value.shape)}, not ({wanted})")
    check_has_values(name, value)


def check_has_values(name: str, tensor: Tensor) -> None:
    """A tensor on a device that kernels are there for: torch's device `meta` keeps shapes alone.

    Raises:
        ValueError: it has no values.
    """
    from room2dgs.kernels.builds import BLOCK_BUILDS

    if tensor.device.type == "meta" and "meta" not in BLOCK_BUILDS:
        raise ValueError(f"{name} is on the device meta, where tensors have no values")


def check_same_device(**tensors: Tensor | None) -> None:
    """Of tensors that are used together.

    Raises:
        ValueError: they are on several.
    """
    places = {name: tensor.device for name, tensor in tensors.items() if tensor is not None}
    if len(set(places.values())) > 1:
        raise ValueError("tensors are on several devices: " + ", ".join(f"{n} on {d}" for n, d in places.items()))


def check_points(name: str, points: Any) -> np.ndarray:
    """(N, 3) of numbers, as they are.

    Raises:
        TypeError: they are no numbers.
        ValueError: another shape.
    """
    found = np.asarray(points)
    if found.dtype.kind not in "iuf":
        raise TypeError(f"{name} are of {found.dtype}, not numbers")
    if found.ndim != 2 or found.shape[1] != 3:
        raise ValueError(f"{name} have shape {found.shape}, not (N, 3)")
    return found
