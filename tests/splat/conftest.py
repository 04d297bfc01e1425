"""Surfels and views for the rasterizer's tests; the hard ones are those of tools/numerics."""

from __future__ import annotations

import pytest

from room2dgs.tools.numerics.scenes import facing, intrinsics, pose, random_surfels


@pytest.fixture
def make_surfels():
    return random_surfels


@pytest.fixture
def make_view():
    """A call gives (K, cam_from_world)."""
    return lambda **k: (intrinsics(50, 55, 23, 19), pose(**k).float())


@pytest.fixture
def quaternions_facing():
    return facing
