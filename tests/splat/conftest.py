"""Scenes for the rasterizer's tests: name -> (surfels, K, cam_from_world, width, height), all float32."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from room2dgs.splat.types import Surfels


def random_surfels(
    count: int, seed: int = 0, scale: tuple[float, float] = (0.02, 0.22), depth: float = 3.0, sh: int = 4,
    opacity: tuple[float, float] = (0.01, 0.99),
) -> Surfels:  # fmt: skip
    g = torch.Generator().manual_seed(seed)
    centers = (torch.rand(count, 3, generator=g) - 0.5) * torch.tensor([3.0, 2.0, 3.0]) + torch.tensor([0, 0, depth])
    rotations = torch.randn(count, 4, generator=g)
    scales = torch.rand(count, 2, generator=g) * (scale[1] - scale[0]) + scale[0]
    opacities = torch.rand(count, generator=g) * (opacity[1] - opacity[0]) + opacity[0]
    return Surfels(centers, rotations, scales, opacities, torch.randn(count, sh, 3, generator=g) * 0.3)


def intrinsics(fx: float = 50.0, fy: float = 55.0, cx: float = 23.0, cy: float = 19.0) -> Tensor:
    return torch.tensor([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def pose(angle: float = 0.1, axis: tuple[float, float, float] = (1.0, 0.3, -0.2), t=(0.1, -0.05, 0.2)) -> Tensor:
    a = torch.tensor(axis, dtype=torch.float64)
    a = a / a.norm()
    skew = torch.tensor([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]], dtype=torch.float64)
    m = torch.eye(4, dtype=torch.float64)
    m[:3, :3] += math.sin(angle) * skew + (1 - math.cos(angle)) * skew @ skew
    m[:3, 3] = torch.tensor(t, dtype=torch.float64)
    return m.float()


def facing(normal: Tensor) -> Tensor:
    """(N, 4) quaternions that turn z to the unit `normal` (N, 3)."""
    q = torch.stack([1 + normal[:, 2], -normal[:, 1], normal[:, 0], torch.zeros(len(normal))], dim=-1)
    return q / q.norm(dim=-1, keepdim=True)


def _hard() -> dict[str, tuple]:
    scenes: dict[str, tuple] = {}
    base = random_surfels(150, 3)
    scenes["random"] = (random_surfels(300), intrinsics(), pose(), 53, 40)
    scenes["many small"] = (random_surfels(800, 1, (0.004, 0.05), sh=9), intrinsics(), pose(), 48, 48)
    scenes["below a pixel"] = (random_surfels(300, 2, (0.0005, 0.01), sh=16), intrinsics(), pose(), 53, 40)
    scenes["opaque"] = (base._replace(opacities=torch.full((150,), 0.999)), intrinsics(), pose(), 53, 40)
    scenes["faint"] = (base._replace(opacities=torch.rand(150) * 0.01), intrinsics(), pose(), 53, 40)
    scenes["deep stack"] = (
        random_surfels(400, 4, (0.5, 1.5), 4.0, opacity=(0.05, 0.4)),
        intrinsics(),
        pose(),
        33,
        20,
    )
    # nearly edge-on: every normal within a degree of the plane across the optical axis
    angle = torch.linspace(0, 2 * math.pi, 150)
    tilt = torch.linspace(-0.02, 0.02, 150)
    normals = torch.stack([angle.cos() * tilt.cos(), angle.sin() * tilt.cos(), tilt.sin()], dim=-1)
    scenes["edge-on"] = (base._replace(rotations=facing(normals)), intrinsics(), torch.eye(4), 53, 40)
    # a floor 1.2 m under a camera that looks along it: discs run under and behind the camera
    floor = random_surfels(120, 5, (0.2, 1.2))
    spread = torch.rand(120, 3, generator=torch.Generator().manual_seed(6))
    floor = floor._replace(
        centers=torch.stack([4 * spread[:, 0] - 2, 1.2 + 0.02 * spread[:, 1], 0.1 + 4 * spread[:, 2]], dim=-1),
        rotations=facing(torch.tensor([[0.0, -1.0, 0.0]]).expand(120, 3)) + 0.02 * torch.randn(120, 4),
    )
    scenes["floor under the camera"] = (floor, intrinsics(30, 30, 24, 18), torch.eye(4), 48, 40)
    scenes["around the camera"] = (
        random_surfels(200, 7, (0.1, 1.0), 0.0),
        intrinsics(),
        torch.eye(4),
        53,
        40,
    )
    scenes["off-centre"] = (base, intrinsics(70, 40, -9.3, 51.7), pose(0.3), 53, 40)
    scenes["one pixel"] = (base, intrinsics(2, 2, 0.5, 0.5), torch.eye(4), 1, 1)
    scenes["unnormalised quaternions"] = (
        base._replace(rotations=base.rotations * 37.0),
        intrinsics(),
        pose(),
        53,
        40,
    )
    scenes["far from the origin"] = (
        base._replace(centers=base.centers + torch.tensor([40.0, -25.0, 10.0])),
        intrinsics(), pose(0.0, t=(-40.0, 25.0, -10.0)), 53, 40,
    )  # fmt: skip
    return scenes


SCENES = _hard()


@pytest.fixture(params=list(SCENES))
def hard_scene(request) -> tuple:
    """(surfels, K, cam_from_world, width, height)."""
    return SCENES[request.param]


@pytest.fixture
def make_surfels():
    return random_surfels


@pytest.fixture
def make_view():
    """A call gives (K, cam_from_world)."""
    return lambda **k: (intrinsics(), pose(**k))


@pytest.fixture
def quaternions_facing():
    return facing
