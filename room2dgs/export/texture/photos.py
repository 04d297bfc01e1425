"""What photos say of points of a surface: which see them, how well, and how bright each photo is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
import trimesh

from room2dgs.captures.scene import Frame
from room2dgs.geometry.camera import NEAR_M, Camera
from room2dgs.mesh.open3d import o3c, o3d

WIDEST_PX = 2048  # photos are used at their own size up to this
TOLERANCE_M, TOLERANCE_SHARE = 0.02, 0.01  # farther behind what the camera sees first, a point is hidden
STEP_SHARE = 0.05  # depth that differs by more within a pixel's surroundings is an edge: what is behind may show there
SHARPNESS = 4  # power of a view's quality: the best views count, and few others, so that nothing is seen double
MIN_COSINE = 0.1
RIM_PX = 3.0
ROUNDS = 20


class Seen(NamedTuple):
    """Points that a photo sees.

    Attributes:
        points: (N,) which of them, by index.
        color: (N, 3) float32, 0..255.
        quality: (N,) float32: how squarely and how near they are seen.
    """

    points: np.ndarray
    color: np.ndarray
    quality: np.ndarray


class Occluder:
    """A surface that hides what is behind it."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.middle = np.asarray(mesh.vertices).mean(axis=0)
        self._scene = o3d.t.geometry.RaycastingScene()
        vertices = (np.asarray(mesh.vertices) - self.middle).astype(np.float32)
        faces = np.asarray(mesh.faces).astype(np.uint32)
        self._scene.add_triangles(o3c.Tensor(vertices), o3c.Tensor(faces))  # type: ignore[call-overload]

    def depth(self, camera: Camera) -> np.ndarray:
        """(H, W) float32 z-depth of what is hit first; inf where nothing is."""
        rays = np.empty((camera.height, camera.width, 6), np.float32)
        rays[..., :3] = camera.centre - self.middle
        rays[..., 3:] = camera.world_rays()
        return self._scene.cast_rays(o3c.Tensor(rays))["t_hit"].numpy()  # type: ignore[call-overload]


def full_size(frames: Iterable[Frame]) -> Iterator[Frame]:
    """The frames with photos at their own size, or `WIDEST_PX` wide."""
    for frame in frames:
        width, height = frame.full_size()
        size = min(1.0, WIDEST_PX / width)
        camera = frame.camera.resized(max(1, round(width * size)), max(1, round(height * size)))
        yield replace(frame, camera=camera, cache=None)


def seen(frame: Frame, occluder: Occluder, points: np.ndarray, normals: np.ndarray) -> Seen:
    """What one photo says.

    Args:
        points, normals: (N, 3) world.
    """
    camera = frame.camera
    pixel, z = camera.project(points)
    inside = camera.inside(pixel) & (z > NEAR_M)
    index = np.flatnonzero(inside)
    pixel, z = pixel[index], z[index]
    depth = occluder.depth(camera)
    column, row = np.floor(pixel).astype(int).T
    visible = z <= depth[row, column] * (1 + TOLERANCE_SHARE) + TOLERANCE_M
    ray = camera.centre - points[index]
    cosine = np.einsum("ni,ni->n", normals[index], ray) / np.maximum(np.linalg.norm(ray, axis=1), 1e-9)
    good = visible & (cosine > MIN_COSINE) & ~_edges(depth)[row, column]
    mask = frame.mask()
    if mask is not None:
        good &= mask[row, column]
    index, pixel, z, cosine = index[good], pixel[good], z[good], cosine[good]
    rim = np.minimum(pixel, np.array(camera.size) - pixel).min(axis=1)
    quality = cosine * camera.K[0, 0] / z * np.clip(rim / RIM_PX, 0.1, 1)
    return Seen(index, _colors(frame.color(), pixel), quality.astype(np.float32))


def gains(frames: Iterable[Frame], occluder: Occluder, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(V, 3) how much brighter each photo is than the others, of each colour; their geometric mean is 1.

    What several photos see should look the same in all of them: medians over points and photos in turn.

    Args:
        points, normals: (N, 3) a sample of the surface.
    """
    parts = [seen(frame, occluder, points, normals) for frame in frames]
    view = np.concatenate([np.full(len(part.points), number) for number, part in enumerate(parts)]).astype(int)
    point = np.concatenate([part.points for part in parts])
    color = np.concatenate([part.color for part in parts]) if parts else np.zeros((0, 3))
    usable = ((color > 8) & (color < 247)).all(axis=1) & (np.bincount(point, minlength=len(points))[point] > 1)
    view, point, logs = view[usable], point[usable], np.log(color[usable].astype(np.float64))
    found = np.zeros((len(parts), 3))
    for _ in range(ROUNDS):
        albedo = _medians(point, logs - found[view], len(points))
        found = _medians(view, logs - albedo[point], len(parts))
        found -= found.mean(axis=0)
    return np.exp(found)


def _medians(group: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count, C) median of the values (N, C) of each group; 0 of an empty one."""
    result = np.zeros((count, values.shape[1]))
    sizes = np.bincount(group, minlength=count)
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    filled = sizes > 0
    for channel in range(values.shape[1]):
        ordered = values[np.lexsort((values[:, channel], group)), channel]
        low, high = first + (np.maximum(sizes, 1) - 1) // 2, first + sizes // 2
        result[filled, channel] = (ordered[low[filled]] + ordered[high[filled]]) / 2
    return result


def _edges(depth: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels around which the depth jumps."""
    finite = np.where(np.isfinite(depth), depth, 1e3).astype(np.float32)
    square = np.ones((3, 3), np.uint8)
    near, far = cv2.erode(finite, square), cv2.dilate(finite, square)
    middle = cv2.blur(finite, (3, 3))
    # a slanted surface is no jump: its depth lies in the middle between the two
    return (far - near > STEP_SHARE * near) & (np.abs(middle - (near + far) / 2) > 0.1 * (far - near))


def _colors(photo: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """(N, 3) float32 between the pixels' centres; rows of 30,000 are as many as remap takes."""
    x, y = (pixel - 0.5).astype(np.float32).T
    rows = 30_000
    parts = [
        cv2.remap(
            photo, x[None, at : at + rows], y[None, at : at + rows], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        for at in range(0, len(x), rows)
    ]
    return np.concatenate([part[0] for part in parts]).astype(np.float32) if parts else np.zeros((0, 3), np.float32)
