"""The mirrors of a run's room: mirrors.json, and views without what they show."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.captures.selection import evenly_spaced
from room2dgs.config import Config
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.runs.folder import MIRRORS

if TYPE_CHECKING:
    from torch import Tensor

    from room2dgs.mesh.views import FusedView
    from room2dgs.mirrors.mirror import Mirror
    from room2dgs.mirrors.sights import SmallView
    from room2dgs.runs.trust import Trust

MOST_VIEWS = 64


def without_mirrored(
    views: Iterable[FusedView], scene: Scene, trust: Mapping[str, Trust], config: Config, run: RunFolder
) -> Iterable[FusedView]:
    """The views that a mesh is made of; with mesh.glass=leave_out the glass stands in for what mirrors show.

    mirrors.json says where mirrors are; there is none with mesh.glass=keep.

    Args:
        views: of the scene's frame.
        trust: training view -> its small maps.

    Raises:
        InputError: a photo cannot be decoded.
    """
    from room2dgs.mirrors.find import find_mirrors
    from room2dgs.runs.mirrors import write_mirrors

    (run.path / MIRRORS).unlink(missing_ok=True)  # of the mesh before
    if config.mesh.glass == "keep":
        return views
    mirrors = find_mirrors(small_views(scene, trust))
    if not mirrors:
        return views
    write_mirrors(run.path / MIRRORS, mirrors, scene.origin_m)
    sizes = ", ".join("{:.1f} x {:.1f} m".format(*one.size_m) for one in mirrors)
    run.log(f"mesh: {len(mirrors)} mirrors ({sizes}); what they show is left out (mesh.glass=keep: it stays)")
    return _GlassViews(views, mirrors)


def small_views(scene: Scene, trust: Mapping[str, Trust]) -> list[SmallView]:
    """Training views, up to `MOST_VIEWS`, that the run kept small maps of.

    Raises:
        InputError: a photo cannot be decoded.
    """
    known = [frame for frame in scene.train if frame.name in trust and trust[frame.name].depth is not None]
    return [_small_view(frame, trust[frame.name]) for frame in evenly_spaced(known, MOST_VIEWS)]


def _small_view(frame: Frame, trust: Trust) -> SmallView:
    from room2dgs.mirrors.sights import SmallView

    assert trust.depth is not None
    height, width = trust.depth.shape
    photo = cv2.resize(frame.levelled_color(), (width, height), interpolation=cv2.INTER_AREA)
    color = cv2.cvtColor(photo, cv2.COLOR_RGB2LAB)
    return SmallView(
        frame.camera.resized(width, height),
        trust.depth.astype(np.float64),
        trust.num_consistent,
        color.astype(np.float64),
    )


@dataclass(frozen=True)
class _GlassViews:
    """Views, each time with the glass of mirrors in place of what is seen in them."""

    views: Iterable[FusedView]
    mirrors: Sequence[Mirror]

    def __iter__(self) -> Iterator[FusedView]:
        for view in self.views:
            yield with_glass(view, self.mirrors)


def with_glass(view: FusedView, mirrors: Sequence[Mirror]) -> FusedView:
    """A view with the mirrors' own surface where it has a depth in them."""
    from room2dgs.mirrors.mirror import behind_glass, shown

    there = view.on_cpu()
    depth = np.array(there.depth, np.float32)
    normal = None if there.normal is None else np.array(there.normal)
    for mirror in mirrors:
        glass = shown(depth, view.camera, [mirror])
        if normal is not None:
            normal[(glass > 0) & (depth > 0)] = mirror.normal
        depth = behind_glass(depth, glass)
    found = replace(view, depth=_like(depth, view.depth))
    if normal is None or view.normal is None:
        return found
    return replace(found, normal=_like(normal, view.normal))


def _like(values: np.ndarray, other: np.ndarray | Tensor) -> np.ndarray | Tensor:
    """Values where the other ones are."""
    if isinstance(other, np.ndarray):
        return values
    import torch

    return torch.as_tensor(values, dtype=other.dtype, device=other.device)
