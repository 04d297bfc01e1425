"""Hard scenes for the rasterizer: one function each, all numbers float32 (the pose float64, as cameras have it)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from torch import Tensor

from room2dgs.splat.constants import OPACITY_FLOOR
from room2dgs.splat.types import Surfels

NEAR_M = 0.05  # of a scene in metres
COUNT = 60  # surfels of most scenes


class HardScene(NamedTuple):
    """What is drawn.

    Attributes:
        surfels: float32; or 3D Gaussians (numerics/gaussians.py).
        K: (3, 3) float32.
        cam_from_world: (4, 4) float64.
        width, height: pixels.
        near_m: near plane, in the scene's unit of length.
        opacity_floor: fainter hits are skipped.
    """

    surfels: Any
    K: Tensor
    cam_from_world: Tensor
    width: int
    height: int
    near_m: float = NEAR_M
    opacity_floor: float = OPACITY_FLOOR


def random_surfels(
    count: int, seed: int = 0, scale: tuple[float, float] = (0.02, 0.22), depth: float = 3.0, sh: int = 4,
    opacity: tuple[float, float] = (0.01, 0.99),
) -> Surfels:  # fmt: skip
    """Surfels in a box of 3 x 2 x 3 m about (0, 0, depth), turned at random."""
    g = torch.Generator().manual_seed(seed)
    centers = (torch.rand(count, 3, generator=g) - 0.5) * torch.tensor([3.0, 2.0, 3.0]) + torch.tensor([0, 0, depth])
    rotations = torch.randn(count, 4, generator=g)
    scales = torch.rand(count, 2, generator=g) * (scale[1] - scale[0]) + scale[0]
    opacities = torch.rand(count, generator=g) * (opacity[1] - opacity[0]) + opacity[0]
    return Surfels(centers, rotations, scales, opacities, torch.randn(count, sh, 3, generator=g) * 0.3)


def intrinsics(fx: float = 36.0, fy: float = 40.0, cx: float = 17.0, cy: float = 14.0) -> Tensor:
    """(3, 3) K, off-centre and of two focal lengths."""
    return torch.tensor([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], dtype=torch.float32)


def pose(angle: float = 0.1, axis: tuple[float, float, float] = (1.0, 0.3, -0.2), t=(0.1, -0.05, 0.2)) -> Tensor:
    """(4, 4) float64 cam_from_world: a turn about an axis, and a shift."""
    a = torch.tensor(axis, dtype=torch.float64)
    a = a / a.norm()
    skew = torch.tensor([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]], dtype=torch.float64)
    m = torch.eye(4, dtype=torch.float64)
    m[:3, :3] += math.sin(angle) * skew + (1 - math.cos(angle)) * skew @ skew
    m[:3, 3] = torch.tensor(t, dtype=torch.float64)
    return m


def facing(normal: Tensor) -> Tensor:
    """(N, 4) quaternions that turn z to the unit `normal` (N, 3)."""
    q = torch.stack([1 + normal[:, 2], -normal[:, 1], normal[:, 0], torch.zeros(len(normal))], dim=-1)
    return q / q.norm(dim=-1, keepdim=True)


def _at_home() -> Tensor:
    return torch.eye(4, dtype=torch.float64)


def _scene(surfels: Surfels, K: Tensor | None = None, cam_from_world: Tensor | None = None, size=(37, 29), near=NEAR_M):
    K = intrinsics() if K is None else K
    return HardScene(surfels, K, pose() if cam_from_world is None else cam_from_world, size[0], size[1], near)


def _some(seed: int = 3, **changes) -> Surfels:
    return random_surfels(COUNT, seed)._replace(**changes)


def ordinary() -> HardScene:
    """Nothing hard: what the others are to be compared with."""
    return _scene(random_surfels(120))


def many_small() -> HardScene:
    return _scene(random_surfels(200, 1, (0.004, 0.05), sh=9))


def below_a_pixel() -> HardScene:
    return _scene(random_surfels(150, 2, (0.0005, 0.01), sh=16))


def image_filling() -> HardScene:
    surfels = random_surfels(40, 9, (5.0, 50.0), 4.0)
    return _scene(surfels._replace(rotations=surfels.rotations * 0.2 + torch.tensor([1.0, 0, 0, 0])), size=(31, 24))


def opaque() -> HardScene:
    return _scene(_some(opacities=torch.full((COUNT,), 0.999)))


def faint() -> HardScene:
    opacities = torch.rand(COUNT, generator=torch.Generator().manual_seed(5)) * 0.01
    return _scene(_some(opacities=opacities))


def opacities_at_the_limits() -> HardScene:
    limits = torch.tensor([0.0, 1 / 255, 0.99, 1.0, 0.5])
    return _scene(_some(4, opacities=limits.repeat(COUNT // 5)))


def a_high_floor() -> HardScene:
    """What training has, and opacities on both sides of it and at it."""
    opacities = torch.tensor([1.0, 0.3, 0.05, 1 / 32, 0.02])
    return _scene(_some(6, opacities=opacities.repeat(COUNT // 5)))._replace(opacity_floor=1 / 32)


def deep_stack() -> HardScene:
    return _scene(random_surfels(200, 4, (0.5, 1.5), 4.0, opacity=(0.05, 0.4)), size=(23, 18))


def coincident_layers() -> HardScene:
    """10^4 times the same disc, in colours of their own: what is blended is decided by the order of indices."""
    count = 10_000
    g = torch.Generator().manual_seed(8)
    one = torch.tensor([[0.05, -0.02, 2.0]])
    surfels = Surfels(
        one.repeat(count, 1), torch.tensor([[0.9, 0.3, -0.2, 0.1]]).repeat(count, 1), torch.full((count, 2), 0.4),
        torch.tensor([0.0045, 0.006, 0.009, 0.013]).repeat(count // 4), torch.randn(count, 1, 3, generator=g) * 0.3,
    )  # fmt: skip
    return _scene(surfels, intrinsics(8, 8, 5.2, 4.1), _at_home(), (10, 7))


def equal_depths() -> HardScene:
    """All in one plane across the optical axis: the order of indices decides."""
    surfels = _some(10)
    centers = surfels.centers.clone()
    centers[:, 2] = 2.5
    rotations = torch.tensor([1.0, 0, 0, 0]) + 0.05 * surfels.rotations
    return _scene(surfels._replace(centers=centers, rotations=rotations), cam_from_world=_at_home())


def depths_within_one_rounding() -> HardScene:
    """One plane across the axis of a turned camera: depths differ by what float32 leaves of the centres."""
    surfels, turned = _some(11), pose(0.7)
    flat = surfels.centers.double()
    flat[:, 2] = 2.5
    centers = (flat - turned[:3, 3]) @ turned[:3, :3]
    return _scene(surfels._replace(centers=centers.float()), cam_from_world=turned)


def edge_on() -> HardScene:
    """Every normal within a degree of the plane across the optical axis."""
    angle, tilt = torch.linspace(0, 2 * math.pi, COUNT), torch.linspace(-0.02, 0.02, COUNT)
    normals = torch.stack([angle.cos() * tilt.cos(), angle.sin() * tilt.cos(), tilt.sin()], dim=-1)
    return _scene(_some(rotations=facing(normals)), cam_from_world=_at_home())


def floor_under_the_camera() -> HardScene:
    """1.2 m under a camera that looks along it: discs run under and behind the camera."""
    floor = random_surfels(COUNT, 5, (0.2, 1.2))
    g = torch.Generator().manual_seed(6)
    spread = torch.rand(COUNT, 3, generator=g)
    floor = floor._replace(
        centers=torch.stack([4 * spread[:, 0] - 2, 1.2 + 0.02 * spread[:, 1], 0.1 + 4 * spread[:, 2]], dim=-1),
        rotations=facing(torch.tensor([[0.0, -1.0, 0.0]]).expand(COUNT, 3)) + 0.02 * torch.randn(COUNT, 4, generator=g),
    )
    return _scene(floor, intrinsics(24, 24, 18, 12), _at_home())


def around_the_camera() -> HardScene:
    """Across the near plane and the camera's own."""
    return _scene(random_surfels(100, 7, (0.1, 1.0), 0.0), cam_from_world=_at_home())


def at_5_cm() -> HardScene:
    """From the near plane to 8 cm."""
    surfels = _some(12)
    g = torch.Generator().manual_seed(12)
    depth = 0.05 + 0.03 * torch.rand(COUNT, generator=g)
    sides = (torch.rand(COUNT, 2, generator=g) - 0.5) * depth[:, None]
    centers, scales = torch.cat([sides, depth[:, None]], 1), 0.02 * surfels.scales
    return _scene(surfels._replace(centers=centers, scales=scales), cam_from_world=_at_home())


def at_100_m() -> HardScene:
    surfels = _some(13)
    centers = surfels.centers * torch.tensor([20.0, 20, 3]) + torch.tensor([0, 0, 90.0])
    return _scene(surfels._replace(centers=centers, scales=30 * surfels.scales))


def from_5_cm_to_100_m() -> HardScene:
    surfels = _some(14)
    depth = 0.05 * 2000 ** torch.linspace(0, 1, COUNT)
    rays = surfels.centers / 3
    rays[:, 2] = 1
    return _scene(
        surfels._replace(centers=rays * depth[:, None], scales=surfels.scales * depth[:, None] / 3),
        cam_from_world=_at_home(),
    )


def _in_unit(unit: float) -> HardScene:
    surfels, moved = _some(15), pose()
    moved[:3, 3] *= unit
    return _scene(
        surfels._replace(centers=surfels.centers * unit, scales=surfels.scales * unit), None, moved, near=NEAR_M * unit
    )


def in_millimetres() -> HardScene:
    return _in_unit(1000.0)


def in_kilometres() -> HardScene:
    return _in_unit(0.001)


def ten_km_from_the_origin() -> HardScene:
    """Centres have steps of a millimetre there; a few lie within two of the near plane."""
    surfels, away = _some(16), torch.tensor([8000.0, -6000.0, 500.0])
    centers = surfels.centers.clone()
    centers[:30] *= 0.02
    centers[:30, 2] = torch.linspace(0.0499, 0.0509, 30)
    moved = pose(1.1)
    # the camera is where `pose(t=0)` is, and goes along with the scene
    moved[:3, 3] = -moved[:3, :3] @ away.double()
    world = centers.double() @ moved[:3, :3] + away.double()  # the camera's axes, then the world's
    scales = torch.cat([0.02 * surfels.scales[:30], surfels.scales[30:]])
    return _scene(surfels._replace(centers=world.float(), scales=scales), cam_from_world=moved)


def needles() -> HardScene:
    """1 : 10^4."""
    surfels = _some(17)
    long = surfels.scales.amax(dim=1, keepdim=True) * 3
    scales = torch.cat([long, long * 1e-4], dim=1)
    scales[::2] = scales[::2].flip(1)
    return _scene(surfels._replace(scales=scales))


def quaternions_of_any_norm() -> HardScene:
    surfels = _some(18)
    return _scene(surfels._replace(rotations=surfels.rotations * 10 ** torch.linspace(-3, 3, COUNT)[:, None]))


def quaternions_near_zero() -> HardScene:
    """Down to float32's smallest numbers, and some that are 0: those have no disc."""
    surfels = _some(19)
    norms = 10 ** torch.linspace(-18, -44, COUNT)
    norms[::10] = 0
    return _scene(surfels._replace(rotations=surfels.rotations * norms[:, None]))


def nothing_in_view() -> HardScene:
    return _scene(_some(20, centers=-random_surfels(COUNT, 20).centers))


def no_surfel() -> HardScene:
    return _scene(Surfels(*(x[:0] for x in _some())))


def one_pixel() -> HardScene:
    return _scene(_some(21), intrinsics(2, 2, 0.5, 0.5), _at_home(), (1, 1))


def prime_sized() -> HardScene:
    return _scene(_some(22), size=(41, 23))


def four_k() -> HardScene:
    return _scene(random_surfels(400, 23), intrinsics(3000, 3100, 1900, 1100), size=(3840, 2160))


def wide_angle() -> HardScene:
    """170 degrees from left to right."""
    focal = 37 / 2 / math.tan(math.radians(85))
    return _scene(random_surfels(100, 24, (0.1, 0.8), 0.5), intrinsics(focal, focal, 18.5, 14.5), _at_home())


def principal_point_outside() -> HardScene:
    return _scene(_some(25), intrinsics(50, 30, -6.5, 37.2), pose(0.3))


def principal_point_far_outside() -> HardScene:
    """A crop of a picture of 20,000 pixels."""
    surfels = _some(26)
    K = intrinsics(4000, 4100, -9000, 7000)
    centers, depth = surfels.centers.clone(), surfels.centers[:, 2]
    centers[:, 0] = (9000 + 37 * (centers[:, 0] / 3 + 0.5)) / 4000 * depth
    centers[:, 1] = (-7000 + 29 * (centers[:, 1] / 2 + 0.5)) / 4100 * depth
    return _scene(surfels._replace(centers=centers, scales=surfels.scales * 0.02), K, _at_home())


def off_screen() -> HardScene:
    """Discs so far to the side that what is seen of them is their rim."""
    surfels = _some(27)
    centers = surfels.centers.clone()
    centers[:, 0] += torch.where(centers[:, 0] > 0, 3.0, -3.0)
    return _scene(surfels._replace(centers=centers, scales=surfels.scales * 5))


ALL: tuple[Callable[[], HardScene], ...] = (
    ordinary, many_small, below_a_pixel, image_filling, opaque, faint, opacities_at_the_limits, a_high_floor,
    deep_stack, coincident_layers, equal_depths, depths_within_one_rounding, edge_on,
    floor_under_the_camera, around_the_camera, at_5_cm, at_100_m, from_5_cm_to_100_m, in_millimetres, in_kilometres,
    ten_km_from_the_origin, needles, quaternions_of_any_norm, quaternions_near_zero, nothing_in_view, no_surfel,
    one_pixel, prime_sized, wide_angle, principal_point_outside, principal_point_far_outside, off_screen,
)  # fmt: skip
SCENES: dict[str, Callable[[], HardScene]] = {scene.__name__.replace("_", " "): scene for scene in ALL}
ILL_CONDITIONED = ("needles", "around the camera")  # what float32 stores of them costs more than 1e-4
LARGE = "four k"  # compared in a few windows, see `compare.large`
