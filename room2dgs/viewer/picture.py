"""One picture of a viewer, and what lies under a point of it; nothing here knows of a server."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from room2dgs.geometry.camera import NEAR_M, Camera
from room2dgs.geometry.camera_tensors import view_matrices
from room2dgs.geometry.poses import inverse_pose, rigid_pose
from room2dgs.primitives.primitive import Splats
from room2dgs.primitives.registry import render
from room2dgs.runs.page.mesh_views import DrawnMesh
from room2dgs.runs.pictures import depth_picture, normal_picture
from room2dgs.splat.types import Rendering

KINDS = ("colour", "depth", "normals")
BACKGROUND = (0.1, 0.1, 0.1)
PROBE = 9  # pixels across the small picture that a click is looked up in
PROBE_HALF = 0.004  # tangent of half its opening


class Picture(NamedTuple):
    """What a camera sees.

    Attributes:
        pixels: (H, W, 3) uint8.
        depth: (H, W) float32 z-depth, metres; 0 = nothing there.
    """

    pixels: np.ndarray
    depth: np.ndarray


def picture(shown: Splats | DrawnMesh, camera: Camera, kind: str, near_m: float = NEAR_M) -> Picture:
    """Draw colour, depth or normals.

    Raises:
        ValueError: another kind.
    """
    if kind not in KINDS:
        raise ValueError(f"{kind!r} is none of {', '.join(KINDS)}")
    if isinstance(shown, DrawnMesh):
        view = shown.rendering(camera, BACKGROUND)
    else:
        view = _rendered(shown, camera, kind, near_m)
    covered, depth = view.covered.numpy(), view.covered_depth().numpy()
    if kind == "depth":
        pixels = depth_picture(depth, covered)
    elif kind == "normals":
        pixels = normal_picture(view.normal.numpy(), camera, covered)
    else:
        pixels = np.round(view.color.clamp(0, 1).numpy() * 255).astype(np.uint8)
    return Picture(pixels, depth)


def cropped(shown: Splats | DrawnMesh, low: np.ndarray, high: np.ndarray) -> Splats | DrawnMesh:
    """Without the splats whose centres lie outside a box; a mesh stays whole.

    Args:
        low, high: (3,) metres, the box's corners.
    """
    if isinstance(shown, DrawnMesh):
        return shown
    corners = (torch.as_tensor(end, dtype=shown.centers.dtype) for end in (low, high))
    least, most = corners
    inside = ((shown.centers >= least) & (shown.centers <= most)).all(dim=1)
    return shown._replace(**{name: part[inside] for name, part in shown._asdict().items()})


def _rendered(splats: Splats, camera: Camera, kind: str, near_m: float) -> Rendering:
    with torch.no_grad():
        return render(
            splats,
            *view_matrices(camera),
            *camera.size,
            background=torch.tensor(BACKGROUND),
            near_m=near_m,
            with_normal=kind == "normals",
            with_distortion=False,
        )


def camera_at(wxyz: np.ndarray, position: np.ndarray, fov: float, size: tuple[int, int]) -> Camera:
    """A camera as viser has it: world from camera, OpenCV axes, upright opening in radians; size in pixels."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_quat(np.asarray(wxyz, np.float64)[[1, 2, 3, 0]]).as_matrix()
    width, height = size
    focal = height / 2 / np.tan(fov / 2)
    K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    return Camera(K, width, height, inverse_pose(rigid_pose(rotation, np.asarray(position, np.float64))))


def hit(
    shown: Splats | DrawnMesh, origin: np.ndarray, direction: np.ndarray, near_m: float = NEAR_M
) -> np.ndarray | None:
    """(3,) metres: the surface along a ray, from a tiny picture around it; None: nothing is there."""
    forward = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    beside = np.cross(forward, np.eye(3)[np.abs(forward).argmin()])
    beside /= np.linalg.norm(beside)
    rotation = np.stack([beside, np.cross(forward, beside), forward])  # rows: the camera's axes
    focal = PROBE / 2 / PROBE_HALF
    K = np.array([[focal, 0, PROBE / 2], [0, focal, PROBE / 2], [0, 0, 1.0]])
    origin = np.asarray(origin, np.float64)
    camera = Camera(K, PROBE, PROBE, rigid_pose(rotation, -rotation @ origin))
    depth = float(picture(shown, camera, "colour", near_m).depth[PROBE // 2, PROBE // 2])
    return origin + depth * forward if depth > 0 else None
