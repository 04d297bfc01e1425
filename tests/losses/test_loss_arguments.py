"""What losses are given: a finite value with finite gradients, or a sentence."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from room2dgs.losses.compared_pixels import Neighbour, Photo, multiview_losses
from room2dgs.losses.depth_prior import depth_prior_loss, edge_band, scale_and_shift
from room2dgs.losses.multiview import (
    correlation,
    multiview_geometric,
    multiview_photometric,
    neighbour_patches,
    round_trip_error,
    round_trip_weight,
)
from room2dgs.losses.normal_prior import normal_prior_loss, reweighting
from room2dgs.losses.photometric import rgb_loss
from room2dgs.losses.sampling import bilinear, patch_offsets, patches_at
from room2dgs.losses.surface import distortion, normal_consistency
from room2dgs.splat.types import Rendering

H, W, M = 24, 32, 50
DRAWN = torch.Generator().manual_seed(0)


def some(*shape: int) -> torch.Tensor:
    return torch.rand(*shape, generator=DRAWN)


def directions(*shape: int) -> torch.Tensor:
    return torch.nn.functional.normalize(some(*shape, 3) - 0.5, dim=-1)


K = torch.tensor([[30.0, 0, 16], [0, 30, 12], [0, 0, 1]])
POSE = torch.eye(4)
BESIDE = torch.eye(4)
BESIDE[0, 3] = 0.1
DEPTH, GREY, VALID = 1 + some(H, W), some(H, W), torch.ones(H, W, dtype=torch.bool)
PIXELS = torch.stack([some(M) * (W - 12) + 6, some(M) * (H - 12) + 6], dim=-1)
ROWS = {"pixels": PIXELS, "depth": 1 + some(M)}
CAMERAS = {"neighbour_from_reference": BESIDE, "K_reference": K, "K_neighbour": K}


def consistency(depth, alpha, normal, K, cam_from_world):
    rendering = Rendering(some(H, W, 3), alpha, depth, depth, normal, some(H, W))
    return normal_consistency(rendering, K, cam_from_world)


def compared(depth, normal, pixels, grey, K, pose, patch, other_grey, other_K, other_pose, other_usable, inverse_depth):
    neighbour = Neighbour(Photo(other_grey, other_K, other_pose), other_usable, inverse_depth, 1)
    return multiview_losses(depth, normal, pixels, Photo(grey, K, pose), neighbour, patch)


DOORS = {
    "rgb_loss": (rgb_loss, {"rendered": some(H, W, 3), "target": some(H, W, 3), "dssim": 0.2}),
    "depth_prior_loss": (
        depth_prior_loss,
        {"depth": DEPTH, "alpha": torch.ones(H, W), "prior": 1 + some(H, W), "valid": VALID, "confidence": some(H, W),
         "step": 1, "scales": 4, "gradient_weight": 0.5},
    ),
    "scale_and_shift": (scale_and_shift, {"prior": 1 + some(H, W), "rendered": DEPTH, "weight": some(H, W)}),
    "normal_prior_loss": (
        normal_prior_loss,
        {"normal": directions(H, W), "alpha": torch.ones(H, W), "prior": directions(H, W), "valid": VALID,
         "confidence": some(H, W), "step": 1, "l1": 0.01, "cosine": 0.01},
    ),
    "reweighting": (reweighting, {"normal": directions(H, W), "prior": directions(H, W), "width_deg": 20.0}),
    "normal_consistency": (
        consistency,
        {"depth": DEPTH, "alpha": torch.ones(H, W), "normal": directions(H, W), "K": K, "cam_from_world": POSE},
    ),
    "distortion": (
        lambda distortion_map: distortion(Rendering(*[distortion_map] * 6)), {"distortion_map": some(H, W)}
    ),
    "round_trip_error": (round_trip_error, {**ROWS, "neighbour_inverse_depth": 1 / DEPTH, **CAMERAS, "step": 1}),
    "round_trip_weight": (round_trip_weight, {"error": some(M), "seen": some(M) > 0.5}),
    "multiview_geometric": (multiview_geometric, {"error": some(M), "weight": some(M)}),
    "multiview_photometric": (
        multiview_photometric, {"reference": some(M, 25), "neighbour": some(M, 25), "weight": some(M)}
    ),
    "correlation": (correlation, {"a": some(M, 25), "b": some(M, 25)}),
    "neighbour_patches": (
        neighbour_patches, {"image": GREY, **ROWS, "normal": directions(M), **CAMERAS, "patch": 5}
    ),
    "bilinear": (bilinear, {"image": GREY, "x": PIXELS[:, :1], "y": PIXELS[:, 1:]}),
    "patches_at": (
        patches_at, {"image": GREY, "column": PIXELS[:, 0].long(), "row": PIXELS[:, 1].long(), "size": 5}
    ),
    "multiview_losses": (
        compared,
        {"depth": DEPTH, "normal": directions(H, W), "pixels": torch.arange(200, 400, dtype=torch.int32), "grey": GREY,
         "other_grey": some(H, W), "inverse_depth": 1 / DEPTH, "K": K, "pose": POSE, "other_K": K,
         "other_pose": BESIDE, "patch": 5, "other_usable": VALID},
    ),
}  # fmt: skip
ARGUMENTS = [(door, name) for door, (_, given) in DOORS.items() for name in given]
TENSORS = [(door, name) for door, name in ARGUMENTS if isinstance(DOORS[door][1][name], torch.Tensor)]
NUMBERS = [pair for pair in ARGUMENTS if pair not in TENSORS]
FROM_ARRAYS = ("K", "cam_from_world")  # of `normal_consistency`, by its docstring
OF_ANY_SIZE = ("image", "neighbour_inverse_depth", "distortion_map")


def run(door: str, **changed):
    function, given = DOORS[door]
    return function(**{**given, **changed})


@pytest.mark.parametrize("door", DOORS)
def test_good_arguments_give_finite_values(door):
    found = run(door)
    for value in found if isinstance(found, tuple) else (found,):
        assert torch.isfinite(torch.as_tensor(value)).all()


@pytest.mark.parametrize(("door", "name"), TENSORS)
def test_what_is_no_such_tensor_is_refused(door, name):
    good = DOORS[door][1][name]
    number = (good * 10 if good.dtype.is_floating_point else good).float()
    odd = [good.tolist(), "x", 3, number.to(torch.complex64), torch.empty_like(good, device="meta"), good[None],
           good.new_zeros(()), good.new_zeros((0,) * (good.ndim + 1))]  # fmt: skip
    if good.dtype.is_floating_point:
        odd += [number.byte(), number.int(), number.long()]
        odd += [] if name == "weight" else [number > 3]
    if good.ndim > 1 or good.dtype == torch.bool:
        odd += [good[:0], good.numpy()]
        odd += [] if name in OF_ANY_SIZE else [good[:-1]]
    for value in odd:
        if door == "normal_consistency" and name in FROM_ARRAYS and not isinstance(value, torch.Tensor | str | int):
            continue
        with pytest.raises((TypeError, ValueError)):
            run(door, **{name: value})


@pytest.mark.parametrize(("door", "name"), TENSORS)
def test_strides_do_not_count(door, name):
    good = DOORS[door][1][name]
    apart = torch.stack([good, good], dim=-1)[..., 0]
    other_way = good.permute(*reversed(range(good.ndim))).contiguous().permute(*reversed(range(good.ndim)))
    expected = run(door)
    for same in (apart, other_way):
        found = run(door, **{name: same})
        for a, b in zip(*(x if isinstance(x, tuple) else (x,) for x in (found, expected)), strict=True):
            assert torch.allclose(torch.as_tensor(a), torch.as_tensor(b), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("door", "name"), NUMBERS)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), "3", None, [1]])
def test_numbers_are_asked_for(door, name, value):
    with pytest.raises((TypeError, ValueError)):
        run(door, **{name: value})


@pytest.mark.parametrize(
    ("door", "name"), [pair for pair in NUMBERS if pair[1] in ("step", "patch", "size", "scales", "width_deg", "dssim")]
)
@pytest.mark.parametrize("value", [-1, 10**9, 1.5])
def test_numbers_have_bounds(door, name, value):
    if (name, value) in {("step", 10**9), ("width_deg", 1.5)}:
        return
    if (name, value) == ("scales", 10**9):
        assert run(door, scales=value) == run(door, scales=10)  # the rest have no pairs
        return
    with pytest.raises((TypeError, ValueError)):
        run(door, **{name: value})


def test_offsets_of_a_patch_without_end_are_refused():
    for size in (0, -3, 10**9, 2.0):
        with pytest.raises((TypeError, ValueError), match="patch"):
            patch_offsets(size)


@pytest.mark.parametrize("name", ["K_reference", "K_neighbour"])
@pytest.mark.parametrize("focal", [0.0, -30.0, float("nan"), 1e-38])
def test_a_camera_without_a_focal_length_is_refused(name, focal):
    matrix = K.clone()
    matrix[0, 0] = focal
    for door in ("round_trip_error", "neighbour_patches"):
        with pytest.raises(ValueError, match="focal length"):
            run(door, **{name: matrix})


def test_patches_that_leave_the_image_and_pixels_that_are_not_there_are_refused():
    column = PIXELS[:, 0].long()
    for wrong in (column + 100, column - 100, column * 10**9):
        with pytest.raises(ValueError, match="leave the image"):
            run("patches_at", column=wrong)
    with pytest.raises(ValueError, match="pixels name 768"):
        run("multiview_losses", pixels=torch.tensor([5, H * W], dtype=torch.int32))
    assert torch.isfinite(run("multiview_losses", pixels=torch.tensor([-1, H * W - 1], dtype=torch.int32))).all()


@pytest.mark.parametrize("level", [1e19, 1e30, float("nan"), float("inf")])
def test_levels_without_room_for_their_squares(level):
    """A finite image gave a value and gradients that were none."""
    for name in ("grey", "other_grey"):
        with pytest.raises(ValueError, match="levels"):
            run("multiview_losses", **{name: torch.full((H, W), level)})
    patches, neighbour = some(M, 25), some(M, 25)
    patches[::3] *= level
    neighbour[::5] *= level
    neighbour.requires_grad_()
    value = multiview_photometric(patches, neighbour, some(M))
    (gradient,) = torch.autograd.grad(value, neighbour)
    assert torch.isfinite(value) and torch.isfinite(gradient).all()
    assert not gradient[::15].any() and gradient[1].any()


def test_what_has_no_weight_has_no_gradient_whatever_it_is():
    neighbour, weight = some(M, 25), torch.ones(M)
    neighbour[7], weight[7] = float("nan"), 0.0
    neighbour.requires_grad_()
    value = multiview_photometric(some(M, 25), neighbour, weight)
    (gradient,) = torch.autograd.grad(value, neighbour)
    assert torch.isfinite(value) and torch.isfinite(gradient).all() and not gradient[7].any()


@pytest.mark.parametrize("far", [1e9, 1e30, float("inf"), float("nan"), -1e30])
def test_points_far_outside_an_image_have_its_border_and_no_gradient(far):
    """torch's own backward read memory that was not the image's."""
    x = PIXELS[:, :1].clone()
    x[3] = far
    x.requires_grad_()
    values = bilinear(GREY, x, PIXELS[:, 1:])
    (gradient,) = torch.autograd.grad(values.sum(), x)
    assert torch.isfinite(values).all() and torch.isfinite(gradient).all() and gradient[3] == 0
    assert GREY.min() <= values.min() and values.max() <= GREY.max()


@pytest.mark.parametrize("special", [0.0, -1.0, 1e-20, 1e-3, 1e20, 3e38])
@pytest.mark.parametrize("shift", [0.0, -1.5, 5.0, 1e20])
def test_any_finite_depth_gives_finite_gradients(special, shift):
    pose = POSE.clone()
    pose[2, 3] = shift
    depth, normal = (1 + some(M)).index_fill(0, torch.arange(0, M, 3), special).requires_grad_(), directions(M)
    error, seen = round_trip_error(PIXELS, depth, 1 / DEPTH, pose, K, K)
    patches, whole = neighbour_patches(GREY, PIXELS, depth, normal.requires_grad_(), pose, K, K, 5)
    terms = (
        multiview_geometric(error, round_trip_weight(error, seen)),
        multiview_photometric(some(M, 25), patches, round_trip_weight(error, seen & whole)),
    )
    for value in terms:
        gradients = torch.autograd.grad(value, [depth, normal], allow_unused=True, retain_graph=True)
        assert torch.isfinite(value)
        assert all(gradient is None or torch.isfinite(gradient).all() for gradient in gradients)


@pytest.mark.parametrize(
    ("prior", "more"),
    [(np.ones((4, 5)), {"width_px": -1}), (np.ones((4, 5)), {"width_px": 1.5}),
     (np.ones((4, 5)), {"relative_jump": float("nan")}), (np.ones(4), {}), (np.ones((0, 5)), {}), (None, {}),
     (np.ones((4, 5), bool), {}), ("x", {})],
)  # fmt: skip
def test_bands_are_of_maps(prior, more):
    with pytest.raises((TypeError, ValueError)):
        edge_band(prior, **{"relative_jump": 0.1, "width_px": 2, **more})


def test_a_band_as_wide_as_anything_is_the_map():
    depth = np.ones((6, 9))
    depth[:, 5:] = 2
    assert edge_band(depth, 0.1, 10**9).all()
