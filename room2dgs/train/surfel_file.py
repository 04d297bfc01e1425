"""The result of training as a file: activated primitives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from room2dgs.errors import InputError
from room2dgs.primitives.primitive import BASES, Primitive, Splats
from room2dgs.primitives.registry import primitive_of, primitives_by_file
from room2dgs.train.tensor_file import read_tensors, write_tensors

SH_BASES = (1, 4, 9, 16)
FARTHEST_M = 1e9
SHORTEST = 1e-9  # of a quaternion: its square still has digits in float32


def save_surfels(path: Path, surfels: Splats, meta: dict[str, Any]) -> None:
    """Write primitives of any kind (metres and probabilities) and what made them.

    Raises:
        InputError: the file cannot be written.
    """
    write_tensors(path, primitive_of(surfels).file_kind, surfels._asdict(), meta)


def scaled_surfel_file(path: Path, to: Path, factor: float) -> None:
    """The same primitives in a world that is so many times as large, with the same metadata.

    Raises:
        InputError: as `load_surfels`, or `to` cannot be written.
    """
    surfels = load_surfels(path)
    meta = read_tensors(Path(path), *primitives_by_file())[1]
    own = {key: value for key, value in meta.items() if key not in ("format", "kind", "crc32")}
    save_surfels(to, surfels._replace(centers=surfels.centers * factor, scales=surfels.scales * factor), own)


def load_surfels(path: Path) -> Splats:
    """Read what `save_surfels` wrote.

    Raises:
        InputError: missing, damaged, or not a file of surfels: other tensors, shapes, numbers or none at all.
    """
    kinds = primitives_by_file()
    tensors, meta = read_tensors(Path(path), *kinds)
    primitive = kinds[meta["kind"]]
    wrong = _wrong(tensors, primitive)
    if wrong:
        raise InputError(f"{path} {wrong}; train again")
    return primitive.splats(**{**tensors, "rotations": _sized(tensors["rotations"])})


def _sized(rotations: Tensor) -> Tensor:
    """The same rotations, those of a length whose square float32 cannot tell made unit ones: 0 is no rotation
    (`rotation_matrices`), and other programs divide by the length."""
    length = torch.linalg.vector_norm(rotations.double(), dim=1, keepdim=True)
    odd = (length < SHORTEST) | (length > 1 / SHORTEST)
    if not bool(odd.any()):
        return rotations
    none = torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    unit = torch.where(length > 0, rotations.double() / length.clamp_min(1e-300), none)
    return torch.where(odd, unit.float(), rotations)


def surfels_meta(path: Path) -> dict[str, Any]:
    """Arguments of `save_surfels`: iteration, sh_degree, background, near_m, seeds, settings.

    Raises:
        InputError: missing, damaged, or not a file of surfels.
    """
    return read_tensors(Path(path), *primitives_by_file())[1]


def _wrong(tensors: dict[str, Tensor], primitive: Primitive) -> str:
    """What is not as `save_surfels` writes it, or an empty string."""
    differ = set(tensors) ^ set(primitive.shapes)
    if differ:
        return f"{'lacks' if min(differ) in primitive.shapes else 'has'} {min(differ)}"
    return _wrong_shape(tensors, primitive) or _wrong_number(tensors)


def _wrong_shape(tensors: dict[str, Tensor], primitive: Primitive) -> str:
    count = len(tensors["opacities"]) if tensors["opacities"].dim() else 0
    bases = tensors["sh"].shape[1] if tensors["sh"].dim() == 3 else SH_BASES[0]
    for name, inner in primitive.shapes.items():
        value, shape = tensors[name], (count, *(bases if side == BASES else side for side in inner))
        if value.dtype != torch.float32:
            return f"has {name} as {str(value.dtype).removeprefix('torch.')}, not float32"
        if tuple(value.shape) != shape:
            return f"has {name} of shape {tuple(value.shape)}, not {shape}"
    if bases not in SH_BASES:
        return f"has {bases} spherical harmonics, not {', '.join(map(str, SH_BASES))}"
    return "" if count else "holds no surfels"


def _wrong_number(tensors: dict[str, Tensor]) -> str:
    for name, value in tensors.items():
        if not bool(torch.isfinite(value).all()):
            return f"has {name} that are not finite"
    scales, opacities = tensors["scales"], tensors["opacities"]
    within = {
        "centers that are no metres": tensors["centers"].abs() <= FARTHEST_M,
        "scales that are not above 0": (scales > 0) & (scales <= FARTHEST_M),
        "opacities that are not from 0 to 1": (opacities >= 0) & (opacities <= 1),
    }
    return next((f"has {problem}" for problem, fits in within.items() if not bool(fits.all())), "")
