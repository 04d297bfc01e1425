"""What must not change a picture: where the world's origin lies, the unit, the surfels' order, the threads.

The changes are such that float32 holds the changed scene exactly, so that only the kernels can tell the difference.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs import splat
from room2dgs.splat import Rendering, Surfels
from room2dgs.tools.numerics.compare import POWERS, differentiate, image_weights, relative_error
from room2dgs.tools.numerics.kinds import kind_of, smooth
from room2dgs.tools.numerics.scenes import NEAR_M, HardScene

UNIT = 1024.0  # a power of two: metres to (almost) millimetres, without rounding
THREADS = (1, 3)
CYCLE = torch.tensor([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]], dtype=torch.float64)  # x to y to z to x, as (1, 1, 1, 1) does


class Invariances(NamedTuple):
    """Worst relative errors, of images and gradients together; 0 where all bits are equal.

    Attributes:
        moved: scene and camera turned by 120 degrees about (1, 1, 1) and shifted by several times the scene's size.
        scaled: another unit of length.
        reordered: the surfels shuffled; None where depths are equal, since then the order decides by design.
        threads: other numbers of threads.
    """

    moved: float
    scaled: float
    reordered: float | None
    threads: float

    def within(self, bound: float) -> bool:
        """Threads may change no bit at all."""
        return self.threads == 0 and all((x or 0.0) <= bound for x in self)


def invariances(scene: HardScene) -> Invariances:
    """All four, on one scene."""
    scene = scene._replace(surfels=scene.surfels._replace(sh=scene.surfels.sh[:, :1]))  # a colour that does not turn
    weights = image_weights(scene.width, scene.height, unit=scene.near_m / NEAR_M)
    return Invariances(_moved(_snapped(scene)), _scaled(scene, weights), _reordered(scene, weights), _threads(scene))


def _moved(scene: HardScene) -> float:
    kept = smooth(scene)
    weights = image_weights(scene.width, scene.height, unit=scene.near_m / NEAR_M)
    weights = [w * (kept[..., None] if w.ndim == 3 else kept) for w in weights]
    shift = _power_above(scene.surfels.centers) * torch.tensor([4.0, -2.0, 1.0], dtype=torch.float64)
    pose = scene.cam_from_world.clone()
    pose[:3, :3] = pose[:3, :3] @ CYCLE.T
    pose[:3, 3] -= pose[:3, :3] @ shift
    s = scene.surfels
    centers = (s.centers.double() @ CYCLE.T + shift).float()
    rotations = (s.rotations.double() @ _by_ones().T).float()
    there = scene._replace(surfels=s._replace(centers=centers, rotations=rotations), cam_from_world=pose)
    turned = [w @ CYCLE.T.float() if k == 4 else w for k, w in enumerate(weights)]  # normals are in the world
    (images, gradients), (images_there, gradients_there) = (
        differentiate(kind_of(scene).render, *which, torch.float32) for which in ((scene, weights), (there, turned))
    )
    images_there = images_there._replace(normal=images_there.normal @ CYCLE.float())
    back = {
        **gradients_there,
        "centers": gradients_there["centers"] @ CYCLE.float(),
        "rotations": gradients_there["rotations"] @ _by_ones().float(),
        "cam_from_world": gradients["cam_from_world"],  # of another matrix: its own test is the comparison
    }
    errors = [relative_error(b[kept], a[kept]) for a, b in zip(images, images_there, strict=True)]
    return max(errors + [relative_error(back[name], value) for name, value in gradients.items()])


def _scaled(scene: HardScene, weights: list[Tensor]) -> float:
    s, pose = scene.surfels, scene.cam_from_world.clone()
    pose[:3, 3] *= UNIT
    there = HardScene(
        s._replace(centers=s.centers * UNIT, scales=s.scales * UNIT), scene.K, pose, scene.width, scene.height,
        scene.near_m * UNIT, scene.opacity_floor,
    )  # fmt: skip
    images, gradients = differentiate(kind_of(scene).render, scene, weights, torch.float32)
    lighter = [w * UNIT**-p for w, p in zip(weights, POWERS, strict=True)]
    images_there, gradients_there = differentiate(kind_of(there).render, there, lighter, torch.float32)
    images_there = Rendering(*(x * UNIT**-p for x, p in zip(images_there, POWERS, strict=True)))
    for name in ("centers", "scales"):
        gradients_there[name] = gradients_there[name] * UNIT
    gradients_there["cam_from_world"][:3, 3] *= UNIT
    return _difference((images_there, gradients_there), (images, gradients))


def _reordered(scene: HardScene, weights: list[Tensor]) -> float | None:
    depth = (scene.surfels.centers.double() @ scene.cam_from_world[2, :3] + scene.cam_from_world[2, 3]).float()
    if len(depth.unique()) < len(depth):
        return None
    order = torch.randperm(len(depth), generator=torch.Generator().manual_seed(2))
    there = scene._replace(surfels=type(scene.surfels)(*(x[order] for x in scene.surfels)))
    images, gradients = differentiate(kind_of(scene).render, scene, weights, torch.float32)
    images_there, gradients_there = differentiate(kind_of(there).render, there, weights, torch.float32)
    back = torch.argsort(order)
    for name in (*Surfels._fields, "center_px"):
        gradients_there[name] = gradients_there[name][back]
    return _difference((images_there, gradients_there), (images, gradients))


def _threads(scene: HardScene) -> float:
    weights = image_weights(scene.width, scene.height, unit=scene.near_m / NEAR_M)
    found = []
    try:
        for count in THREADS:
            splat.set_threads(count)
            found.append(differentiate(kind_of(scene).render, scene, weights, torch.float32))
    finally:
        splat.set_threads()
    one, several = found
    same = all(torch.equal(a, b) for a, b in zip(one[0], several[0], strict=True))
    same &= all(torch.equal(value, several[1][name]) for name, value in one[1].items())
    return 0.0 if same else max(_difference(several, one), 2.0**-24)


def _difference(actual, expected) -> float:
    """Of (images, gradients)."""
    errors = [relative_error(a, b) for a, b in zip(actual[0], expected[0], strict=True)]
    return max(errors + [relative_error(actual[1][name], value) for name, value in expected[1].items()])


def _power_above(x: Tensor) -> float:
    return float(2 ** torch.ceil(torch.log2(x.abs().max().double()))) if x.numel() and x.any() else 1.0


def _snapped(scene: HardScene) -> HardScene:
    """Centres and quaternions on grids so coarse that they can be moved without rounding."""
    s = scene.surfels
    step = _power_above(s.centers) * 2.0**-17
    q = torch.nn.functional.normalize(s.rotations.double(), dim=-1, eps=1e-300)
    return scene._replace(
        surfels=s._replace(
            centers=((s.centers.double() / step).round() * step).float(), rotations=(q * 4096).round().float() / 4096
        )
    )


def _by_ones() -> Tensor:
    """(4, 4): the quaternion product (1, 1, 1, 1) * q, whose norm is twice that of q."""
    return torch.tensor([[1.0, -1, -1, -1], [1, 1, -1, 1], [1, 1, 1, -1], [1, -1, 1, 1]], dtype=torch.float64)
