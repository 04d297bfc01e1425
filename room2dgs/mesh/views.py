"""Which pixels of a rendering are worth fusing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import MeshConfig
from room2dgs.geometry.camera import Camera

NEAREST_M = 0.5  # what is nearer than this weighs no more

if TYPE_CHECKING:  # fusion serves renderings and depth maps from elsewhere
    from room2dgs.splat.types import Rendering


@dataclass(frozen=True)
class FusedView:
    """One depth map that goes into the volume.

    Attributes:
        camera: K with pixel centres at +0.5, pose in metres.
        depth: (H, W) float32 z-depth, metres; 0 = invalid.
        color: (H, W, 3) uint8 0..255, or float 0..1.
        weight: (H, W) float32, what each pixel counts in the mean; None = the same.
    """

    camera: Camera
    depth: np.ndarray
    color: np.ndarray
    weight: np.ndarray | None = None


def chosen_depth(rendering: Rendering, config: MeshConfig) -> np.ndarray:
    """(H, W) float32 z-depth in metres: the rendering's median or expected depth, as `mesh.depth` says."""
    return _numpy(rendering.median_depth if config.depth == "median" else rendering.depth).astype(np.float32)


def valid_depth(rendering: Rendering, camera: Camera, config: MeshConfig) -> np.ndarray:
    """Pixels that may be fused: opaque enough, near enough, not seen at a grazing angle.

    Args:
        rendering: maps of (H, W) or (H, W, 3), torch or numpy; the normal (world frame) need not be unit length.

    Returns:
        (H, W) bool: alpha >= min_alpha, 0 < depth <= max_depth_m, and the angle between the normal's line
        and the view ray is at most max_angle_deg. A pixel without a normal is not valid.
    """
    depth = chosen_depth(rendering, config)
    normal = camera.turned_to_camera(_numpy(rendering.normal).astype(np.float64))
    rays = camera.rays()
    along = np.abs(np.einsum("hwc,hwc->hw", normal, rays))
    lengths = np.linalg.norm(normal, axis=-1) * np.linalg.norm(rays, axis=-1)
    facing = (lengths > 0) & (along >= np.cos(np.radians(config.max_angle_deg)) * lengths)
    # a NaN fails each comparison, so it is never fused
    return (_numpy(rendering.alpha) >= config.min_alpha) & (depth > 0) & (depth <= config.max_depth_m) & facing


def fused_view(rendering: Rendering, camera: Camera, config: MeshConfig) -> FusedView:
    """The rendering's depth with every unfit pixel set to 0, and its colour clipped to 0..1."""
    depth = np.where(valid_depth(rendering, camera, config), chosen_depth(rendering, config), np.float32(0))
    color = np.clip(np.nan_to_num(_numpy(rendering.color)), 0.0, 1.0).astype(np.float32)
    return FusedView(camera, depth, color)


def trusted_view(maps: ViewMaps[np.ndarray], camera: Camera, color: np.ndarray, config: MeshConfig) -> FusedView:
    """A view's own depth where it is trusted, without any surfels.

    A pixel weighs confidence^2 / z, which keeps more detail than flat weights. Leaving out pixels of little confidence
    (`mesh.min_confidence`) helps one scene and hurts another (docs/results.md), so it is no default.

    Args:
        maps: of the camera's size; `depth` is not None.
        color: (H, W, 3) uint8 or float 0..1.
    """
    sure = np.ones_like(maps.depth) if maps.depth_confidence is None else maps.depth_confidence
    depth = np.where((sure >= config.min_confidence) & (maps.depth <= config.max_depth_m), maps.depth, np.float32(0))
    return FusedView(camera, depth, color, sure**2 / np.maximum(depth, NEAREST_M))


def _numpy(values) -> np.ndarray:
    return values.detach().cpu().numpy() if hasattr(values, "detach") else np.asarray(values)
