"""Hard inputs for the loss terms: each case gives a value and its gradients, in the dtype that is asked for.

Inputs are drawn in float32 and then converted, so that float64 differs by its arithmetic alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from room2dgs.geometry.homography import relative_pose
from room2dgs.losses import reference
from room2dgs.losses.depth_prior import depth_prior_loss
from room2dgs.losses.multiview import (
    multiview_geometric,
    multiview_photometric,
    neighbour_patches,
    round_trip_error,
    round_trip_weight,
)
from room2dgs.losses.normal_prior import normal_prior_loss
from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.surface import normal_consistency
from room2dgs.splat.types import Rendering
from room2dgs.tools.numerics.compare import TOLERANCE, relative_error

H, W = 30, 37
PATCH = 7
Result = tuple[Tensor, dict[str, Tensor]]
NOTHING = 1e-9  # a millionth of the gradient that a mean over these pixels has where a residual is 1
NAN = float("nan")


class TermComparison(NamedTuple):
    """A term in float32 against itself, or its reference, in float64.

    Attributes:
        value: relative error; absolute where the value is below 1e-6 of its usual size, 1.
        gradients: name of an input -> worst relative error.
        finite: value and gradients are.
        bound: of all.
    """

    value: float
    gradients: dict[str, float]
    finite: bool
    bound: float

    @property
    def worst(self) -> float:
        return max([self.value, *self.gradients.values()])

    @property
    def passed(self) -> bool:
        return self.finite and self.worst <= self.bound


def compare_term(case: Callable[[torch.dtype], Result]) -> TermComparison:
    """One case in both precisions."""
    value, gradients = case(torch.float32)
    expected, to_expect = case(torch.float64)
    off = abs(value.item() - expected.item()) / max(abs(expected.item()), 1e-6)
    return TermComparison(
        off,
        {name: relative_error(gradients[name], to_expect[name], NOTHING) for name in to_expect},
        bool(torch.isfinite(value)) and all(torch.isfinite(g).all() for g in gradients.values()),
        TOLERANCE,
    )


def _noise(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float32)


def _ramp() -> Tensor:
    """(H, W) depth of a slanted wall, 2 to 4 m."""
    return (2 + 2 * torch.arange(W) / W + 0.3 * torch.arange(H)[:, None] / H).float()


def _differentiated(loss: Callable[..., Tensor], **inputs: Tensor) -> Result:
    leaves = {name: x.clone().requires_grad_() for name, x in inputs.items()}
    value = loss(*leaves.values())
    grads = torch.autograd.grad(value, list(leaves.values()), allow_unused=True, materialize_grads=True)
    return value.detach(), dict(zip(leaves, grads, strict=True))


def _depth_term(depth: Tensor, prior: Tensor, dtype: torch.dtype, unit: float = 1.0, **options) -> Result:
    """The gradient is per metre, of which the depth's unit is `unit`."""
    depth, prior = depth.to(dtype), prior.to(dtype)
    ones = torch.ones_like(depth)
    value, found = _differentiated(lambda d: depth_prior_loss(d, ones, prior, ones.bool(), **options), depth=depth)
    return value, {"depth": unit * found["depth"]}


def depth_prior(dtype: torch.dtype) -> Result:
    """Nothing hard."""
    return _depth_term(_ramp() + 0.2 * _noise(H, W), _ramp(), dtype)


def depth_prior_constant_depth(dtype: torch.dtype) -> Result:
    return _depth_term(torch.full((H, W), 2.7), _ramp(), dtype)


def depth_prior_constant_prior(dtype: torch.dtype) -> Result:
    return _depth_term(_ramp() + 0.2 * _noise(H, W), torch.full((H, W), 0.3), dtype)


def depth_prior_both_constant(dtype: torch.dtype) -> Result:
    return _depth_term(torch.full((H, W), 2.7), torch.full((H, W), 0.3), dtype)


def depth_prior_that_is_right(dtype: torch.dtype) -> Result:
    """Up to scale and shift: the residual is rounding, and rounding must not push."""
    return _depth_term(_ramp(), 0.37 * _ramp() + 0.7, dtype)


def depth_prior_nearly_constant_depth(dtype: torch.dtype) -> Result:
    """2 m, and half a millimetre of noise."""
    return _depth_term(2 + 5e-4 * _noise(H, W), _ramp(), dtype)


def depth_prior_in_millimetres(dtype: torch.dtype) -> Result:
    return _depth_term(1000 * (_ramp() + 0.2 * _noise(H, W)), 1e-3 * _ramp(), dtype, 1000.0)


def depth_prior_from_5_cm_to_100_m(dtype: torch.dtype) -> Result:
    return _depth_term(0.05 * 2000 ** _noise(H, W), 0.05 * 2000 ** (0.8 * _noise(H, W) + 0.1), dtype)


def depth_prior_of_disparity(dtype: torch.dtype) -> Result:
    """Inverse depth, of depths from 5 cm to 100 m."""
    depth = 0.05 * 2000 ** _noise(H, W)
    return _depth_term(depth, 1 / depth + _noise(H, W, seed=1), dtype, space="disparity")


def depth_prior_all_nan(dtype: torch.dtype) -> Result:
    return _depth_term(_ramp(), torch.full((H, W), NAN), dtype)


def depth_prior_nan_confidence(dtype: torch.dtype) -> Result:
    return _depth_term(_ramp(), torch.full((H, W), NAN), dtype, confidence=torch.full((H, W), NAN, dtype=dtype))


def _normal_term(normal: Tensor, prior: Tensor, dtype: torch.dtype, valid: bool = True) -> Result:
    alpha = torch.ones(H, W, dtype=dtype)
    mask = torch.full((H, W), valid)
    return _differentiated(lambda n: normal_prior_loss(n, alpha, prior.to(dtype), mask), normal=normal.to(dtype))


def _normals(seed: int) -> Tensor:
    return torch.nn.functional.normalize(_noise(H, W, 3, seed=seed) - 0.5, dim=-1)


def normal_prior(dtype: torch.dtype) -> Result:
    """Nothing hard."""
    return _normal_term(0.9 * _normals(1), _normals(2), dtype)


def normal_prior_all_nan(dtype: torch.dtype) -> Result:
    return _normal_term(_normals(1), torch.full((H, W, 3), NAN), dtype, valid=False)


def normal_prior_normals_that_cancel(dtype: torch.dtype) -> Result:
    """Rendered normals of length 0 and of 1e-5, which have no direction."""
    normal = 1e-5 * _normals(1)
    normal[:, ::2] = 0
    return _normal_term(normal, _normals(2), dtype)


def _photo_term(rendered: Tensor, target: Tensor, dtype: torch.dtype) -> Result:
    loss = rgb_loss if dtype == torch.float32 else reference.rgb_loss
    return _differentiated(lambda x: loss(x, target.to(dtype), 0.2), rendered=rendered.to(dtype))


def photometric(dtype: torch.dtype) -> Result:
    """Nothing hard."""
    return _photo_term(_noise(H, W, 3), _noise(H, W, 3, seed=1), dtype)


def photometric_black_on_black(dtype: torch.dtype) -> Result:
    return _photo_term(torch.zeros(H, W, 3), torch.zeros(H, W, 3), dtype)


def photometric_blank_photos(dtype: torch.dtype) -> Result:
    return _photo_term(torch.full((H, W, 3), 0.75), torch.full((H, W, 3), 0.5), dtype)


def photometric_nearly_right(dtype: torch.dtype) -> Result:
    """Off by half a step of eight bits."""
    photo = _noise(H, W, 3)
    return _photo_term(photo + 0.004 * (_noise(H, W, 3, seed=1) - 0.5), photo, dtype)


def photometric_one_pixel(dtype: torch.dtype) -> Result:
    return _photo_term(_noise(1, 1, 3), _noise(1, 1, 3, seed=1), dtype)


def _consistency(depth: Tensor, normal: Tensor, dtype: torch.dtype, focal: float = 40.0) -> Result:
    K = torch.tensor([[focal, 0, W / 2], [0, focal, H / 2], [0, 0, 1]], dtype=torch.float64)
    pose = torch.eye(4, dtype=torch.float64)
    alpha = 0.2 + 0.8 * _noise(H, W, seed=5).to(dtype)

    def loss(depth: Tensor, normal: Tensor) -> Tensor:
        if dtype == torch.float64:
            return reference.normal_consistency(depth, alpha, normal, K, pose)
        flat = torch.zeros_like(alpha)
        return normal_consistency(Rendering(torch.zeros_like(normal), alpha, depth, flat, normal, flat), K, pose)

    return _differentiated(loss, depth=depth.to(dtype), normal=normal.to(dtype))


def consistency(dtype: torch.dtype) -> Result:
    """Nothing hard."""
    return _consistency(2 + _noise(H, W), _normals(1), dtype)


def consistency_flat_wall(dtype: torch.dtype) -> Result:
    return _consistency(torch.full((H, W), 2.0), _normals(1), dtype)


def consistency_from_5_cm_to_100_m(dtype: torch.dtype) -> Result:
    """From one pixel to the next."""
    return _consistency(0.05 * 2000 ** _noise(H, W), _normals(1), dtype)


def consistency_holes(dtype: torch.dtype) -> Result:
    return _consistency((2 + _noise(H, W)) * (_noise(H, W, seed=2) > 0.3), _normals(1), dtype)


def consistency_in_millimetres(dtype: torch.dtype) -> Result:
    value, found = _consistency(1000 * (2 + _noise(H, W)), _normals(1), dtype)
    return value, {**found, "depth": 1000 * found["depth"]}


def consistency_telephoto(dtype: torch.dtype) -> Result:
    """A wall at 2 m in pixels of 0.5 mm."""
    return _consistency(2 + 1e-3 * _noise(H, W), _normals(1), dtype, focal=4000.0)


def _two_views(dtype: torch.dtype, baseline: float = 0.2) -> tuple[Tensor, Tensor, Tensor]:
    """Pixels (M, 2), neighbour_from_reference and K."""
    row, column = torch.meshgrid(torch.arange(6, 24, 3), torch.arange(6, 31, 3), indexing="ij")
    pixels = torch.stack([column.flatten(), row.flatten()], -1) + 0.5
    here, there = torch.eye(4, dtype=dtype), torch.eye(4, dtype=dtype)
    there[:3, 3] = torch.tensor([-baseline, 0.1 * baseline, 0.05 * baseline])
    K = torch.tensor([[40.0, 0, W / 2], [0, 41, H / 2], [0, 0, 1]], dtype=dtype)
    return pixels.to(dtype), relative_pose(here, there), K


def _patches(depth: Tensor, normal: Tensor, dtype: torch.dtype, image: Tensor | None = None, baseline=0.2) -> Result:
    pixels, relative, K = _two_views(dtype, baseline)
    y, x = torch.meshgrid(torch.arange(H), torch.arange(W), indexing="ij")
    image = 0.5 + 0.2 * torch.sin(0.7 * x + 0.2 * y) * torch.cos(0.5 * y) if image is None else image
    wanted = _noise(len(pixels), PATCH * PATCH, seed=3).to(dtype)

    def loss(depth: Tensor, normal: Tensor) -> Tensor:
        patches, whole = neighbour_patches(image.to(dtype), pixels, depth, normal, relative, K, K, PATCH)
        return multiview_photometric(wanted, patches, whole.to(dtype))

    return _differentiated(loss, depth=depth.to(dtype), normal=normal.to(dtype))


COUNT = 6 * 9  # pixels of `_two_views`


def _facing() -> Tensor:
    return torch.nn.functional.normalize(torch.tensor([0.2, -0.1, -1.0]) + 0.2 * _noise(COUNT, 3), dim=-1)


def homography(dtype: torch.dtype) -> Result:
    """Nothing hard."""
    return _patches(2 + 0.3 * _noise(COUNT), _facing(), dtype)


def homography_plane_through_the_camera(dtype: torch.dtype) -> Result:
    """Its distance is 0: the ray lies in the plane."""
    pixels, _, K = _two_views(torch.float32)
    rays = torch.cat([pixels, torch.ones(COUNT, 1)], 1) @ torch.linalg.inv(K).T
    across = torch.linalg.cross(rays, torch.tensor([0.0, 1.0, 0.0]).expand_as(rays))
    return _patches(2 + 0.3 * _noise(COUNT), torch.nn.functional.normalize(across, dim=-1), dtype)


def homography_normal_across_the_ray(dtype: torch.dtype) -> Result:
    """On either side of perpendicular by up to a tenth of a radian."""
    pixels, _, K = _two_views(torch.float32)
    rays = torch.cat([pixels, torch.ones(COUNT, 1)], 1) @ torch.linalg.inv(K).T
    across = torch.linalg.cross(rays, torch.tensor([1.0, 0.0, 0.0]).expand_as(rays))
    normal = torch.nn.functional.normalize(across, dim=-1)
    tilt = torch.linspace(-0.1, 0.1, COUNT)[:, None]
    return _patches(2 + 0.3 * _noise(COUNT), normal + tilt * torch.nn.functional.normalize(rays, dim=-1), dtype)


def homography_depth_near_zero(dtype: torch.dtype) -> Result:
    return _patches(10 ** torch.linspace(-9, 0, COUNT), _facing(), dtype)


def homography_views_at_one_place(dtype: torch.dtype) -> Result:
    return _patches(2 + 0.3 * _noise(COUNT), _facing(), dtype, baseline=0.0)


def ncc_blank_neighbour(dtype: torch.dtype) -> Result:
    return _patches(2 + 0.3 * _noise(COUNT), _facing(), dtype, torch.full((H, W), 0.4))


def ncc_nearly_blank_neighbour(dtype: torch.dtype) -> Result:
    """A variance of the threshold's size."""
    return _patches(2 + 0.3 * _noise(COUNT), _facing(), dtype, 0.4 + 2e-4 * _noise(H, W, seed=4))


def ncc_blank_both(dtype: torch.dtype) -> Result:
    patches = torch.full((COUNT, PATCH * PATCH), 0.5, dtype=dtype)
    weight = torch.ones(COUNT, dtype=dtype)
    return _differentiated(lambda x: multiview_photometric(patches, x, weight), patches=0.3 * patches)


def _round_trip(depth: Tensor, inverse: Tensor, dtype: torch.dtype) -> Result:
    pixels, relative, K = _two_views(dtype)

    def loss(depth: Tensor, inverse: Tensor) -> Tensor:
        error, seen = round_trip_error(pixels, depth, inverse, relative, K, K)
        return multiview_geometric(error, round_trip_weight(error, seen))

    return _differentiated(loss, depth=depth.to(dtype), inverse_depth=inverse.to(dtype))


def round_trip(dtype: torch.dtype) -> Result:
    """Nothing hard: off by 3 to 6 %."""
    return _round_trip(2.06 + 0.06 * _noise(COUNT), torch.full((H, W), 0.5), dtype)


def round_trip_nothing_seen(dtype: torch.dtype) -> Result:
    return _round_trip(2 + _noise(COUNT), torch.zeros(H, W), dtype)


def round_trip_behind_the_neighbour(dtype: torch.dtype) -> Result:
    return _round_trip(10 ** torch.linspace(-9, -1, COUNT), torch.full((H, W), 0.5), dtype)


ALL: tuple[Callable[[torch.dtype], Result], ...] = (
    depth_prior, depth_prior_constant_depth, depth_prior_constant_prior, depth_prior_both_constant,
    depth_prior_that_is_right, depth_prior_nearly_constant_depth, depth_prior_in_millimetres,
    depth_prior_from_5_cm_to_100_m, depth_prior_of_disparity, depth_prior_all_nan, depth_prior_nan_confidence,
    normal_prior, normal_prior_all_nan, normal_prior_normals_that_cancel,
    photometric, photometric_black_on_black, photometric_blank_photos, photometric_nearly_right, photometric_one_pixel,
    consistency, consistency_flat_wall, consistency_from_5_cm_to_100_m, consistency_holes, consistency_in_millimetres,
    consistency_telephoto,
    homography, homography_plane_through_the_camera, homography_normal_across_the_ray, homography_depth_near_zero,
    homography_views_at_one_place, ncc_blank_neighbour, ncc_nearly_blank_neighbour, ncc_blank_both,
    round_trip, round_trip_nothing_seen, round_trip_behind_the_neighbour,
)  # fmt: skip
TERMS: dict[str, Callable[[torch.dtype], Result]] = {case.__name__.replace("_", " "): case for case in ALL}
