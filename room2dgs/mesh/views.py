"""Which pixels of a rendering are worth fusing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.uncertainty import completed_sigma
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import MeshConfig
from room2dgs.geometry.camera import Camera

LEAST_CONFIDENCE = 1e-4  # of a depth; it stands for a relative error of 2.5
NEAREST_M = 0.5  # what is nearer than this weighs no more
ONE_SURFACE = 0.01  # relative difference of expected and median depth up to which they are of one surface

if TYPE_CHECKING:  # fusion serves renderings and depth maps from elsewhere, and torch takes seconds to import
    import torch
    from torch import Tensor

    from room2dgs.splat.types import Rendering


@dataclass(frozen=True)
class FusedView:
    """One depth map that goes into the volume: numpy's arrays, or tensors on a GPU.

    Attributes:
        camera: K with pixel centres at +0.5, pose in metres.
        depth: (H, W) float32 z-depth, metres; 0 = invalid.
        color: (H, W, 3) uint8 0..255, or float 0..1.
        weight: (H, W) float32, what each pixel counts in the mean; None = the same.
        normal: (H, W, 3) float32, of the surface in each pixel: unit, world frame, towards the camera, 0 = unknown;
            None = nowhere known. Distances are from the plane that depth and normal give, else along the view's axis.
        expected: (H, W) float32, the error that each depth is expected to have: one standard deviation, metres; None =
            nobody said.
    """

    camera: Camera
    depth: np.ndarray | Tensor
    color: np.ndarray | Tensor
    weight: np.ndarray | Tensor | None = None
    normal: np.ndarray | Tensor | None = None
    expected: np.ndarray | Tensor | None = None

    def on_cpu(self) -> FusedView:
        """With numpy's arrays alone."""
        if isinstance(self.depth, np.ndarray):
            return self
        depth, color = _array(self.depth), _array(self.color)
        weight, normal, expected = (None if x is None else _array(x) for x in (self.weight, self.normal, self.expected))
        return FusedView(self.camera, depth, color, weight, normal, expected)


def _array(values: np.ndarray | Tensor) -> np.ndarray:
    return values if isinstance(values, np.ndarray) else values.cpu().numpy()


def chosen_depth(rendering: Rendering, config: MeshConfig) -> Tensor:
    """(H, W) float32 z-depth in metres, as `mesh.depth` says.

    The median jumps from surfel to surfel, the expected depth lies between what is in front of an edge and behind it:
    "smooth" is the expected one where the two hardly differ, the median elsewhere.
    """
    median, expected = (_tensor(depth).float() for depth in (rendering.median_depth, rendering.depth))
    if config.depth == "smooth":
        return expected.where((expected - median).abs() < ONE_SURFACE * median, median)
    return median if config.depth == "median" else expected


def valid_depth(rendering: Rendering, camera: Camera, config: MeshConfig) -> Tensor:
    """Pixels that may be fused: opaque enough, near enough, not seen at a grazing angle.

    Args:
        rendering: maps of (H, W) or (H, W, 3), torch or numpy; the normal (world frame) need not be unit length.

    Returns:
        (H, W) bool, on the rendering's device: alpha >= min_alpha, 0 < depth <= max_depth_m, and the angle between the
        normal's line and the view ray is at most max_angle_deg. A pixel without a normal is not valid.
    """
    import torch

    depth = chosen_depth(rendering, config)
    rotation = torch.from_numpy(camera.rotation.copy()).to(depth.device)
    normal = _tensor(rendering.normal).double() @ rotation.T
    rays = _rays(camera, depth.device)
    along = (normal * rays).sum(-1).abs()
    lengths = normal.norm(dim=-1) * rays.norm(dim=-1)
    facing = (lengths > 0) & (along >= float(np.cos(np.radians(config.max_angle_deg))) * lengths)
    # a NaN fails each comparison, so it is never fused
    return (_tensor(rendering.alpha) >= config.min_alpha) & (depth > 0) & (depth <= config.max_depth_m) & facing


def fused_view(
    rendering: Rendering, camera: Camera, config: MeshConfig, confidence: np.ndarray | None = None
) -> FusedView:
    """The rendering's depth with every unfit pixel set to 0, its unit normals, and its colour clipped to 0..1; where
    the rendering is.

    Args:
        confidence: (h, w) 0..1 in the view's prior depth, of any size, 0 = none; pixels that it expects to be farther
            off than `mesh.max_expected_m` are not fit. None: not asked.
    """
    import torch

    depth = torch.where(valid_depth(rendering, camera, config), chosen_depth(rendering, config), 0.0)
    expected = None
    if confidence is not None:
        known = np.where(confidence > 0, confidence, np.float32(1))
        error = torch.from_numpy(completed_sigma(known))[None, None].to(depth)
        expected = torch.nn.functional.interpolate(error, size=tuple(depth.shape), mode="bilinear")[0, 0] * depth
        if config.max_expected_m is not None:
            depth = torch.where(expected <= config.max_expected_m, depth, 0.0)
    color = torch.nan_to_num(_tensor(rendering.color)).clamp(0.0, 1.0).float()
    normal = torch.nn.functional.normalize(torch.nan_to_num(_tensor(rendering.normal)).float(), dim=-1)
    view = FusedView(camera, depth, color, normal=normal, expected=expected)
    return view.on_cpu() if depth.device.type == "cpu" else view


def trusted_view(maps: ViewMaps[np.ndarray], camera: Camera, color: np.ndarray, config: MeshConfig) -> FusedView:
    """A view's own depth where it is trusted, without any surfels.

    A pixel weighs (confidence / z)^2, as the inverse square of an error in metres does; what is expected to be farther
    off than `mesh.max_expected_m` is left out. Distances are from the plane that depth and normal give: two views
    that have a ceiling in two places, both at a grazing angle, are as far apart as the places are, not as the depths.

    Args:
        maps: of the camera's size; `depth` is not None.
        color: (H, W, 3) uint8 or float 0..1.
    """
    assert maps.depth is not None
    sure = np.ones_like(maps.depth) if maps.depth_confidence is None else maps.depth_confidence
    fit = maps.depth <= config.max_depth_m
    expected = completed_sigma(np.maximum(sure, LEAST_CONFIDENCE)) * maps.depth
    if config.max_expected_m is not None:
        fit &= expected <= config.max_expected_m
    depth = np.where(fit, maps.depth, np.float32(0))
    weight = (sure / np.maximum(depth, NEAREST_M)) ** 2
    return FusedView(camera, depth, color, weight, maps.normal, None if maps.depth_confidence is None else expected)


def _rays(camera: Camera, device: torch.device) -> Tensor:
    """`camera.rays` made on a device."""
    import torch

    (focal_x, focal_y), (cx, cy) = camera.K[(0, 1), (0, 1)].tolist(), camera.K[:2, 2].tolist()
    x = (torch.arange(camera.width, dtype=torch.float64, device=device) + 0.5 - cx) / focal_x
    y = (torch.arange(camera.height, dtype=torch.float64, device=device) + 0.5 - cy) / focal_y
    down, across = torch.meshgrid(y, x, indexing="ij")
    return torch.stack([across, down, torch.ones_like(across)], dim=-1)


def _tensor(values: Tensor | np.ndarray) -> Tensor:
    import torch

    return torch.as_tensor(values).detach()
