"""What the views of a capture say of points in space: seen through, seen as surface, or hidden.

A view's depth, of the truth, a sensor or the run's trusted pixels, ends the ray of each pixel. A point well before its
end was seen through, a point about there is surface, a point behind it is hidden. Where no depth is known, the mesh
that is judged hides what is behind it, and nothing is said of free space.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from room2dgs.eval.surface import Surface
from room2dgs.geometry.camera import Camera

WIDTH = 160  # pixels of a view's small copy
# Depths this near to each other are of one surface: trusted depth is off by 2.5 % and less (`COMPLETED_HALF`).
SAME_M, SAME = 0.05, 0.05
SEEN = 3  # views that a place is to be seen by to be judged


@dataclass(frozen=True)
class Sightlines:
    """A view, small, with where its rays end.

    Attributes:
        camera: of the small size.
        usable: (h, w) bool: pixels that the capture's mask leaves.
        depth: (h, w) float32 known z-depth, metres; 0 = unknown.
        mesh: (h, w) float32 z-depth of the mesh that is judged; 0 where it has none.
    """

    camera: Camera
    usable: np.ndarray
    depth: np.ndarray
    mesh: np.ndarray

    @cached_property
    def shallow(self) -> np.ndarray:
        """(h, w) the least known depth of each pixel and its neighbours; 0 where its own is unknown."""
        known = np.where(self.depth > 0, self.depth, np.float32(np.inf))
        return np.where(self.depth > 0, cv2.erode(known, np.ones((3, 3), np.uint8)), np.float32(0))


@dataclass(frozen=True)
class Tally:
    """What the views say of N points.

    Attributes:
        looked: (N,) int32 number of views that the point is not hidden from.
        free: (N,) int32 of these, views that see through it.
        surface: (N,) int32 of these, views that see surface there.
        first: (N,) int32 first view that it is not hidden from, -1 without one.
    """

    looked: np.ndarray
    free: np.ndarray
    surface: np.ndarray
    first: np.ndarray

    @property
    def seen(self) -> np.ndarray:
        """(N,) bool: enough views look there to judge it."""
        return self.looked >= SEEN

    @property
    def empty(self) -> np.ndarray:
        """(N,) bool: more views see through it than see surface there."""
        return self.free > self.surface


def sightlines(
    camera: Camera, mesh: Surface, depths: Iterable[np.ndarray] = (), usable: np.ndarray | None = None
) -> Sightlines:
    """A view at `WIDTH` pixels.

    Args:
        camera: of any size.
        mesh: what is judged.
        depths: known z-depth, metres, maps of any size, 0 or not finite = unknown. The first that knows a pixel counts.
        usable: bool, of any size; None: all pixels.
    """
    camera = small_camera(camera)
    if usable is None:
        usable = np.ones(camera.size[::-1], bool)
    usable = _small(usable.astype(np.uint8), camera) > 0
    known = np.zeros(usable.shape, np.float32)
    for depth in depths:
        known = np.where(known > 0, known, _small(np.nan_to_num(depth, posinf=0, neginf=0).astype(np.float32), camera))
    return Sightlines(camera, usable, np.where(usable, known, np.float32(0)), ray_depth(mesh, camera))


def small_camera(camera: Camera) -> Camera:
    """The same view at `WIDTH` pixels, or its own width if that is less."""
    return camera.resized_to_width(min(WIDTH, camera.width))


def ray_depth(surface: Surface, camera: Camera) -> np.ndarray:
    """(H, W) float32 z-depth of a surface, metres; 0 where there is none."""
    hits = surface.seen_by(camera)
    return np.where(hits.triangle >= 0, hits.t, np.float32(0)).reshape(camera.size[::-1])


def tally(points: np.ndarray, views: Sequence[Sightlines], careful: bool = False) -> Tally:
    """Ask all views about points.

    Args:
        points: (N, 3) metres, world.
        careful: a view sees through a point only if its neighbouring pixels do so too: no thin thing that a pixel
            misses is called free space.
    """
    looked, free, surface = (np.zeros(len(points), np.int32) for _ in range(3))
    first = np.full(len(points), -1, np.int32)
    for index, view in enumerate(views):
        pixel, z = view.camera.project(points)
        inside = np.flatnonzero(view.camera.inside(pixel) & (z > 0))
        at = tuple(pixel[inside].astype(np.int64).T[::-1])
        usable = view.usable[at]
        inside, at = inside[usable], (at[0][usable], at[1][usable])
        z, known, mesh = z[inside], view.depth[at], view.mesh[at]
        ends = np.where(known > 0, known, np.where(mesh > 0, mesh, np.inf))
        visible = z <= ends + same(ends)
        through = (view.shallow[at] if careful else known) - same(known) > z
        looked[inside] += visible
        free[inside] += through
        surface[inside] += visible & (known > 0) & (z >= known - same(known))
        new = inside[visible & (first[inside] < 0)]
        first[new] = index
    return Tally(looked, free, surface, first)


def same(depth: np.ndarray) -> np.ndarray:
    """Difference of depth, metres, up to which two depths are of one surface."""
    return np.maximum(SAME_M, SAME * depth)


def _small(values: np.ndarray, camera: Camera) -> np.ndarray:
    if values.shape[1::-1] == camera.size:
        return values
    return cv2.resize(values, camera.size, interpolation=cv2.INTER_NEAREST_EXACT)
