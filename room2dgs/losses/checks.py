"""What losses are given: images, points and cameras as tensors of one device, in floating point, with values.

Types and shapes are checked, which takes a microsecond a tensor. Values are checked only where a kernel would read
outside of its arrays or divide by a focal length of 0, and only on the CPU: on a GPU reading a value is a wait.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from room2dgs.geometry.arguments import check_same_device, check_tensor, number, whole_number

MOST_SAMPLES = 255  # of a patch's side
SHORTEST_PX = 1e-3  # of a focal length
BRIGHTEST = 1e6  # of a grey level: squares of squares are to fit into float32


def check_images(channels: int | None = None, /, **images: Any) -> None:
    """Images (H, W) or (H, W, channels), not empty.

    Raises:
        TypeError, ValueError: see `check_tensor`; they are on several devices.
    """
    for name, image in images.items():
        check_tensor(name, image, (None, None) if channels is None else (None, None, channels))
    check_same_device(**images)


def check_rows(width: int | None = None, **rows: Any) -> None:
    """(M,), or (M, width), floating point; M may be 0. One M for all.

    Raises:
        TypeError, ValueError: as `check_images`; their numbers differ.
    """
    count = None
    for name, values in rows.items():
        count = len(values) if count is None and isinstance(values, Tensor) and values.ndim else count or 0
        check_tensor(name, values, (count,) if width is None else (count, width))
    check_same_device(**rows)


def check_mask(name: str, mask: Any) -> None:
    """(H, W) bool.

    Raises:
        TypeError, ValueError: see `check_tensor`.
    """
    check_tensor(name, mask, (None, None), "bool")


def check_intrinsics(**matrices: Any) -> None:
    """(3, 3) with focal lengths above 0.

    Raises:
        TypeError, ValueError: see `check_tensor`; a focal length that cannot be.
    """
    for name, K in matrices.items():
        check_tensor(name, K, (3, 3))
        if K.device.type == "cpu":
            for focal in (K[0, 0].item(), K[1, 1].item()):
                number(f"{name}'s focal length", focal, above=SHORTEST_PX)


def check_pose(name: str, pose: Any) -> None:
    """(4, 4).

    Raises:
        TypeError, ValueError: see `check_tensor`.
    """
    check_tensor(name, pose, (4, 4))


def inverse(name: str, matrix: Tensor) -> Tensor:
    """Of a matrix.

    Raises:
        ValueError: it has none.
    """
    try:
        return torch.linalg.inv(matrix)
    except RuntimeError as error:  # a singular one, or of a type that torch does not invert
        raise ValueError(f"{name} has no inverse") from error


def check_one_type(**tensors: Tensor) -> None:
    """All of one floating type and on one device, as products of matrices want it.

    Raises:
        TypeError: of several types.
        ValueError: on several devices.
    """
    kinds = {name: tensor.dtype for name, tensor in tensors.items()}
    if len(set(kinds.values())) > 1:
        raise TypeError("tensors are of several types: " + ", ".join(f"{name} {kind}" for name, kind in kinds.items()))
    check_same_device(**tensors)


def check_patch(size: Any) -> int:
    """A patch's side, pixels.

    Raises:
        TypeError, ValueError: it is no whole number from 1 to 255.
    """
    size = whole_number("patch", size, 1)
    if size > MOST_SAMPLES:
        raise ValueError(f"patch is {size}; it is to be {MOST_SAMPLES} at most")
    return size


def check_sizes(rendered: dict[str, Tensor], of_prior: dict[str, Tensor | None], step: int) -> None:
    """Maps (H, W) or (H, W, C) of one size, and others that have every `step`-th of their rows and columns.

    Args:
        rendered: the first ones by name; at least one.
        of_prior: the others, without those that are None.

    Raises:
        ValueError: names all of them.
    """
    others = {name: values for name, values in of_prior.items() if values is not None}
    size = next(iter(rendered.values())).shape[:2]
    compared = tuple(-(-pixels // step) for pixels in size)
    same = all(x.shape[:2] == size for x in rendered.values()) and all(x.shape[:2] == compared for x in others.values())
    if not same:
        *names, last = (*rendered, *of_prior)
        raise ValueError(f"{', '.join(names)} and {last} differ in size")


def check_step(step: Any) -> int:
    """Rows and columns from one that is compared to the next.

    Raises:
        TypeError, ValueError: it is no whole number of 1 or more.
    """
    return whole_number("step", step, 1)


def check_grey(**images: Tensor) -> None:
    """Levels of about 0..1; of another kind of image the squares of their squares have no room.

    Raises:
        ValueError: their mean square is none of such levels; on the CPU alone.
    """
    for name, image in images.items():
        if image.device.type == "cpu":
            values = image.detach().reshape(-1)
            power = torch.dot(values, values).item()  # the quickest check of all of them
            # a NaN fails the comparison
            if not power < BRIGHTEST**2 * image.numel():
                raise ValueError(f"{name} has levels that are not finite, or far from 0..1")
