"""Primitives by name, by what they are rendered as, and by the files that hold them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from torch import Tensor

from room2dgs.config import Config
from room2dgs.primitives.activations import scale_activation
from room2dgs.primitives.primitive import Primitive, Splats
from room2dgs.registries.primitives import PRIMITIVES
from room2dgs.splat.types import Rendering


def new_primitive(config: Config) -> Primitive:
    """The primitive that the settings name, with their activation of scales."""
    kind: type[Primitive] = PRIMITIVES.load(config.primitive)
    return kind(scale_activation(config.seeds))


def primitive_of(splats: Splats) -> Primitive:
    """The kind that activated primitives are of.

    Raises:
        TypeError: of none.
    """
    for kind in _kinds():
        if kind.splats is type(splats):
            return kind()
    raise TypeError(f"{type(splats).__name__} is no kind of primitive")


def primitives_by_file() -> dict[str, Primitive]:
    """Kind of file -> the primitive that it holds."""
    return {kind.file_kind: kind() for kind in _kinds()}


def render(splats: Splats, K: Tensor, cam_from_world: Tensor, width: int, height: int, **options: Any) -> Rendering:
    """One view of primitives of any kind; arguments and options are those of `splat.render`."""
    return primitive_of(splats).render(splats, K, cam_from_world, width, height, **options)


def _kinds() -> Iterator[type[Primitive]]:
    return (PRIMITIVES.load(name) for name in PRIMITIVES)
