"""Surfels and meshes that exports are tested on."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import trimesh

from room2dgs.splat.types import Surfels


@pytest.fixture
def surfels() -> Surfels:
    """300 surfels with colours of degree 2, anywhere within 4 m."""
    draw = torch.Generator().manual_seed(3)
    quaternions = torch.randn(300, 4, generator=draw)
    return Surfels(
        centers=torch.rand(300, 3, generator=draw) * 8 - 4,
        rotations=quaternions / quaternions.norm(dim=1, keepdim=True),
        scales=torch.rand(300, 2, generator=draw) * 0.05 + 0.002,
        opacities=torch.rand(300, generator=draw) * 0.98 + 0.01,
        sh=torch.randn(300, 9, 3, generator=draw) * 0.2,
    )


@pytest.fixture
def painted() -> trimesh.Trimesh:
    """A ball at (1, 2, 3) of the world, dark where z is low and red where it is high."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    red = np.round((ball.vertices[:, 2] + 0.5) * 255).astype(np.uint8)
    ball.visual = trimesh.visual.ColorVisuals(
        ball, vertex_colors=np.column_stack([red, np.full_like(red, 30), np.full_like(red, 5)])
    )
    ball.apply_translation((1, 2, 3))
    return ball
