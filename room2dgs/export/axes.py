"""Which way is up: other programs expect it along y or against it, a capture's world has it anywhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from room2dgs.geometry.camera import Camera
from room2dgs.geometry.rotations import quaternions_from
from room2dgs.geometry.spherical_harmonics import sh_basis
from room2dgs.geometry.up_axis import up_axis
from room2dgs.primitives.primitive import S

SNAP_DEG = 1.5  # a world that is this upright is taken as quite upright: its numbers stay, their order changes
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}
NORMALS = 200_000  # of the mesh's faces, at most
DIRECTIONS = 64  # at which turned spherical harmonics are fitted; their up to 16 functions are met exactly


def up_of(setting: str, cameras: Sequence[Camera], normals: np.ndarray) -> np.ndarray | None:
    """(3,) unit, world; None: nothing is to be turned.

    Args:
        setting: auto (from how the cameras were held and what is level), an axis such as z or -y, or keep.
        normals: (N, 3) unit normals of the surface; may be empty. Used by auto alone.
    """
    if setting == "keep":
        return None
    if setting in AXES:
        return np.array(AXES[setting], float)
    up = up_axis(cameras, normals[:: max(1, len(normals) // NORMALS)])
    nearest = max(AXES.values(), key=lambda axis: float(up @ axis))
    return np.array(nearest, float) if up @ nearest > np.cos(np.radians(SNAP_DEG)) else up


def y_up_from(up: np.ndarray | None) -> np.ndarray:
    """(3, 3) rotation from the world to a frame with y up, as glTF, SPZ and three.js have it.

    A world with z up comes out as (x, z, -y).

    Args:
        up: (3,) unit, or None: no rotation.
    """
    if up is None:
        return np.eye(3)
    # the world's x stays, as far as it is level; if it is up itself, y does
    across = np.array([1.0, 0, 0]) if abs(up[0]) < 0.9 else np.array([0, 1.0, 0])
    right = across - (across @ up) * up
    right /= np.linalg.norm(right)
    return np.stack([right, up, np.cross(right, up)]) + 0.0


def y_down_from(up: np.ndarray | None) -> np.ndarray:
    """(3, 3) rotation from the world to a frame with y down and z forward, as PLY splats have it by habit."""
    return np.eye(3) if up is None else np.diag([1.0, -1.0, -1.0]) @ y_up_from(up)


def z_up_from(up: np.ndarray | None) -> np.ndarray:
    """(3, 3) rotation from the world to a frame with z up, as programs of printing and building have it.

    A world with z up stays as it is.
    """
    return np.eye(3) if up is None else np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]) @ y_up_from(up) + 0.0


def turned(splats: S, rotation: np.ndarray) -> S:
    """The primitives in another frame, with their colours from every side.

    Args:
        rotation: (3, 3) from the world to that frame, proper.
    """
    if np.array_equal(rotation, np.eye(3)):
        return splats
    R = torch.tensor(rotation, dtype=torch.float64)
    w, x, y, z = torch.tensor(quaternions_from(rotation[None])[0]).unbind()
    by = torch.stack(
        [torch.stack(row) for row in ((w, -x, -y, -z), (x, w, -z, y), (y, z, w, -x), (z, -y, x, w))]
    )  # the matrix of the product q_R * q
    return splats._replace(
        centers=(splats.centers.double() @ R.T).float(),
        rotations=(splats.rotations.double() @ by.T).float(),
        sh=_turned_sh(splats.sh, R),
    )


def _turned_sh(sh: torch.Tensor, R: torch.Tensor) -> torch.Tensor:
    """The same function of the turned directions: Y(D) c' = Y(D R) c for directions D of the new frame, as rows."""
    count = sh.shape[1]
    if count == 1:
        return sh
    generator = torch.Generator().manual_seed(0)
    directions = torch.randn(DIRECTIONS, 3, dtype=torch.float64, generator=generator)
    directions = directions / directions.norm(dim=1, keepdim=True)
    matrix = torch.linalg.pinv(sh_basis(directions, count)) @ sh_basis(directions @ R, count)
    return torch.einsum("kl,nlc->nkc", matrix, sh.double()).float()
