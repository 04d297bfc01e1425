from __future__ import annotations

import pytest
import torch

from room2dgs.splat.types import Surfels

WALL_Z = 2.0


@pytest.fixture(scope="session")
def wall_surfels() -> Surfels:
    """A wall at z = 2 m, red where x < 0 and blue elsewhere, that ends at x = 1.5 m."""
    x, y = torch.meshgrid(torch.arange(-2, 1.5, 0.05), torch.arange(-1.5, 1.5, 0.05), indexing="ij")
    centers = torch.stack([x.ravel(), y.ravel(), torch.full((x.numel(),), WALL_Z)], dim=1)
    count = len(centers)
    red = (centers[:, :1] < 0).float()
    sh = ((torch.cat([red, torch.zeros(count, 1), 1 - red], dim=1) - 0.5) / 0.28209479)[:, None]
    rotations = torch.tensor([[1.0, 0, 0, 0]]).repeat(count, 1)
    return Surfels(centers, rotations, torch.full((count, 2), 0.04), torch.full((count,), 0.95), sh)
