"""Views, their subsampled depth maps and which of them overlap, as tensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
import torch
from torch import Tensor

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Frame
from room2dgs.captures.seen_points import likely_points
from room2dgs.geometry.camera_tensors import CameraTensors, camera_tensors
from room2dgs.geometry.low_res import low_res_step
from room2dgs.geometry.view_selection import shared_view

MAX_GRADIENT = 4.0  # of a textureless region: grey levels of 255 from one sample to the next
MIN_REGION_SHARE = 0.02  # of the image; a smaller textureless region may have any shape
SMOOTH = 7  # samples
NEIGHBOURS = 8
AT_ONCE = 2**17  # points whose depth is looked up
MIN_SHARED = 0.05
# Four neighbouring depths that differ more, relatively, lie on two surfaces.
ONE_SURFACE = 0.1


@dataclass(frozen=True)
class Overlap:
    """V views.

    Attributes:
        step: samples are every step-th pixel of a row and of a column, from step // 2 on.
        depth: (V, h, w) metres, 0 = invalid.
        normal: (V, h, w, 3) camera frame, facing the camera; 0 = invalid.
        region: (V, h, w) int32, connected textureless regions, numbered from 1 in each view; 0 = textured.
        region_normal: (V, h, w, 3) the normals, smoothed.
        depth_confidence, normal_confidence: (V, h, w) confidence in depth and normal, 0..1.
        cameras: of the views, at their full size.
        pairs: (P, 2) int64, views that see the same surface, both ways round.
        point_view: (M,) int64; point_px: (M, 2); point_depth: (M,) sparse points as seen by the views, metres;
            point_tracked: (M,) bool, whether the photo is known to have seen the point; point_prior: (M,) the depth
            map there, metres.
    """

    step: int
    depth: Tensor
    normal: Tensor
    region: Tensor
    region_normal: Tensor
    depth_confidence: Tensor
    normal_confidence: Tensor
    cameras: CameraTensors
    pairs: Tensor
    point_view: Tensor
    point_px: Tensor
    point_depth: Tensor
    point_tracked: Tensor
    point_prior: Tensor

    def __len__(self) -> int:
        return len(self.depth)

    @cached_property
    def points_of_view(self) -> tuple[Tensor, Tensor]:
        """(V,) first of each view's points, and (V,) how many it has; they lie in the views' order."""
        number = torch.bincount(self.point_view, minlength=len(self))
        return torch.cumsum(number, 0) - number, number

    def pixel(self, row: Tensor, column: Tensor) -> Tensor:
        """(N, 2) pixel of the whole image, centre at +0.5, of samples at these rows and columns."""
        return torch.stack([column, row], dim=-1) * self.step + (self.step // 2 + 0.5)

    def depth_at(self, view: Tensor, pixel: Tensor) -> tuple[Tensor, Tensor]:
        """(N,) bilinear depth, and (N,) bool: valid and on one surface; constant, without a gradient."""
        rows, columns = self.depth.shape[1:]
        x, y = ((pixel.detach() - (self.step // 2 + 0.5)) / self.step).unbind(-1)
        left, top = x.floor().clamp(0, columns - 2), y.floor().clamp(0, rows - 2)
        a, b = (x - left).clamp(0, 1), (y - top).clamp(0, 1)
        left, top = left.long(), top.long()
        corners = torch.stack([self.depth[view, top + i, left + j] for i in (0, 1) for j in (0, 1)])
        weights = torch.stack([(1 - b) * (1 - a), (1 - b) * a, b * (1 - a), b * a])
        least = corners.amin(0)
        return (corners * weights).sum(0), (least > 0) & (least > (1 - ONE_SURFACE) * corners.amax(0))

    def confidence_at(self, view: Tensor, pixel: Tensor) -> Tensor:
        """(N,) confidence in the depth at the nearest sample."""
        rows, columns = self.depth.shape[1:]
        column, row = ((pixel.detach() - (self.step // 2 + 0.5)) / self.step).round().long().unbind(-1)
        return self.depth_confidence[view, row.clamp(0, rows - 1), column.clamp(0, columns - 1)]


def overlap(
    frames: Sequence[Frame],
    depths: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    points: PointCloud | None = None,
    depth_confidences: Mapping[str, np.ndarray] | None = None,
    normal_confidences: Mapping[str, np.ndarray] | None = None,
) -> Overlap:
    """Views that have a depth map.

    Args:
        frames: each with a map in `depths`.
        depths: frame name -> (H, W) metres, 0 = invalid.
        normals: frame name -> (H, W, 3) unit, world frame; frames may have none.
        points: metres; None: no points.
        depth_confidences, normal_confidences: frame name -> (H, W) in 0..1; 1 for frames without, and without a depth.
    """
    cameras = [frame.camera for frame in frames]
    step = low_res_step(max(camera.width for camera in cameras))
    sampled = [_finite(_subsampled(depths[frame.name], step)) for frame in frames]
    height, width = (max(2, *(part.shape[axis] for part in sampled)) for axis in (0, 1))
    depth = np.zeros((len(frames), height, width), dtype=np.float32)
    normal, region_normal = (np.zeros((*depth.shape, 3), dtype=np.float32) for _ in range(2))
    region = np.zeros(depth.shape, dtype=np.int32)
    confidence = {"depth": np.ones_like(depth), "normal": np.ones_like(depth)}
    for index, (frame, part) in enumerate(zip(frames, sampled, strict=True)):
        inside = (index, slice(part.shape[0]), slice(part.shape[1]))
        depth[inside] = part
        of_view = np.zeros((height, width, 3))
        if frame.name in normals:
            of_view[inside[1:]] = frame.camera.turned_to_camera(_finite(_subsampled(normals[frame.name], step)))
        normal[index] = of_view
        for kind, given in (("depth", depth_confidences), ("normal", normal_confidences)):
            if given and frame.name in given:
                confidence[kind][inside] = _finite(_subsampled(given[frame.name], step))
        region[index][inside[1:]] = textureless_regions(frame.color(), step)
        smooth = cv2.blur(of_view, (SMOOTH, SMOOTH))
        region_normal[index] = smooth / np.maximum(np.linalg.norm(smooth, axis=-1, keepdims=True), 1e-6)
    point_view, point_px, point_depth, point_tracked = _points(frames, points)
    views = Overlap(
        step=step,
        depth=_float(depth),
        normal=_float(normal),
        region=torch.from_numpy(region),
        region_normal=_float(region_normal),
        depth_confidence=_float(confidence["depth"]),
        normal_confidence=_float(confidence["normal"]),
        cameras=camera_tensors(cameras),
        pairs=_pairs(frames),
        point_view=point_view,
        point_px=point_px,
        point_depth=point_depth,
        point_tracked=point_tracked,
        point_prior=torch.zeros(0, dtype=torch.float32),
    )
    parts = zip(views.point_view.split(AT_ONCE), views.point_px.split(AT_ONCE), strict=True)
    prior, good = map(torch.cat, zip(*(views.depth_at(*part) for part in parts), strict=True))
    seen = {name: getattr(views, name)[good] for name in ("point_view", "point_px", "point_depth", "point_tracked")}
    return replace(views, **seen, point_prior=prior[good])


def textureless_regions(color: np.ndarray, step: int) -> np.ndarray:
    """Connected regions of a photo without texture or edges, subsampled.

    Args:
        color: (H, W, 3) uint8.

    Returns:
        (h, w) int32: 0 = textured or too small, else the number of the region.
    """
    grey = cv2.GaussianBlur(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY).astype(np.float32), (0, 0), max(0.8, 0.5 * step))
    slope = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=1 / 8))
    flat = _subsampled(cv2.dilate(slope, np.ones((step, step))), step) * step < MAX_GRADIENT
    _, label, stats, _ = cv2.connectedComponentsWithStats(flat.astype(np.uint8), connectivity=4)
    large = stats[:, cv2.CC_STAT_AREA] >= MIN_REGION_SHARE * flat.size
    return np.where(flat & large[label], label, 0).astype(np.int32)


def _subsampled(values: np.ndarray, step: int) -> np.ndarray:
    return values[step // 2 :: step, step // 2 :: step]


def _finite(values: np.ndarray) -> np.ndarray:
    """A copy, not a view of a whole map; what is not finite is 0, nothing known: it would spoil all views' sums."""
    return np.nan_to_num(values, posinf=0.0, neginf=0.0)


def _float(values) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))


def _pairs(frames: Sequence[Frame]) -> Tensor:
    cameras = [frame.camera for frame in frames]
    shared = shared_view(cameras)
    if (shared > MIN_SHARED).sum() < len(frames):  # the camera only turned: what two views see still has to agree
        shared = shared_view(cameras, by_angle=False)
    best = np.argsort(-shared, axis=1, kind="stable")[:, :NEIGHBOURS]
    found = [(i, int(j)) for i, row in enumerate(best) for j in row if shared[i, j] > MIN_SHARED]
    return torch.tensor(found, dtype=torch.int64).reshape(-1, 2)


def _points(frames: Sequence[Frame], points: PointCloud | None) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    views, pixels, depths = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2))], [np.zeros(0)]
    tracked = [np.zeros(0, dtype=bool)]
    for index, frame in enumerate(frames):
        if points is None:
            break
        seen, known = likely_points(points, frame)
        views.append(np.full(len(seen.index), index))
        pixels.append(seen.pixel)
        depths.append(seen.depth)
        tracked.append(known)
    return (
        torch.from_numpy(np.concatenate(views)),
        _float(np.concatenate(pixels)),
        _float(np.concatenate(depths)),
        torch.from_numpy(np.concatenate(tracked)),
    )
