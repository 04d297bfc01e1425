"""The multi-view terms on one textured plane that two cameras see, all in closed form."""

import numpy as np
import pytest
import torch

from room2dgs.geometry.homography import relative_pose, transfer
from room2dgs.losses.multiview import (
    correlation,
    multiview_geometric,
    multiview_photometric,
    neighbour_patches,
    round_trip_error,
    round_trip_weight,
)
from room2dgs.losses.sampling import patches_at

W, H = 64, 48
K_R = torch.tensor([[60.0, 0, 33.1], [0, 58.0, 22.7], [0, 0, 1]], dtype=torch.float64)
K_N = torch.tensor([[57.0, 0, 30.2], [0, 61.0, 25.3], [0, 0, 1]], dtype=torch.float64)
PATCH = 7
NORMAL = torch.tensor([0.3, -0.2, -1.0], dtype=torch.float64) / np.sqrt(1.13)  # in the world; faces both cameras
DISTANCE = float(NORMAL @ torch.tensor([0.0, 0.0, 2.0], dtype=torch.float64))


def pose(x: float, y: float, angle: float) -> torch.Tensor:
    """cam_from_world of a camera at (x, y, 0) that looks along z, turned about y."""
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    world = np.eye(4)
    world[:3, :3], world[:3, 3] = rotation, -rotation @ [x, y, 0]
    return torch.from_numpy(world)


REFERENCE, NEIGHBOUR = pose(0.0, 0.0, 0.02), pose(0.25, 0.1, -0.03)


def plane_depth(cam_from_world: torch.Tensor, K: torch.Tensor) -> torch.Tensor:
    """(H, W) z-depth of the plane at pixel centres."""
    rotation, translation = cam_from_world[:3, :3], cam_from_world[:3, 3]
    normal = rotation @ NORMAL
    y, x = torch.meshgrid(torch.arange(H) + 0.5, torch.arange(W) + 0.5, indexing="ij")
    rays = torch.stack([x, y, torch.ones_like(x)], -1).double() @ torch.linalg.inv(K).T
    return (DISTANCE + normal @ translation) / (rays @ normal)


def photo(cam_from_world: torch.Tensor, K: torch.Tensor) -> torch.Tensor:
    """(H, W) brightness of a smooth pattern on the plane."""
    y, x = torch.meshgrid(torch.arange(H) + 0.5, torch.arange(W) + 0.5, indexing="ij")
    rays = torch.stack([x, y, torch.ones_like(x)], -1).double() @ torch.linalg.inv(K).T
    points = rays * plane_depth(cam_from_world, K)[..., None]
    X, Y, _ = ((points - cam_from_world[:3, 3]) @ cam_from_world[:3, :3]).unbind(-1)
    return 0.5 + 0.2 * torch.sin(9 * X + 4 * Y) + 0.15 * torch.cos(11 * Y - 3 * X)


def chosen():
    """Columns, rows and pixels of the reference that the neighbour sees well."""
    row, column = torch.meshgrid(torch.arange(12, 36, 3), torch.arange(22, 52, 3), indexing="ij")
    column, row = column.flatten(), row.flatten()
    return column, row, torch.stack([column, row], -1) + 0.5


def error_of(depth, inverse_depth=None, step=2):
    pixels = chosen()[2]
    if inverse_depth is None:
        inverse_depth = 1 / plane_depth(NEIGHBOUR, K_N)
    relative = relative_pose(REFERENCE, NEIGHBOUR)
    return round_trip_error(pixels.double(), depth, inverse_depth[::step, ::step], relative, K_R, K_N, step)


def true_depth():
    column, row, _ = chosen()
    return plane_depth(REFERENCE, K_R)[row, column]


def true_normal():
    return (REFERENCE[:3, :3] @ NORMAL).expand(len(true_depth()), 3).clone()


def photometric(depth, normal, image=None):
    column, row, pixels = chosen()
    image = photo(NEIGHBOUR, K_N) if image is None else image
    patches, whole = neighbour_patches(
        image, pixels.double(), depth, normal, relative_pose(REFERENCE, NEIGHBOUR), K_R, K_N, PATCH
    )
    assert whole.all()
    reference = patches_at(photo(REFERENCE, K_R), column, row, PATCH)
    return multiview_photometric(reference, patches, torch.ones_like(depth))


@pytest.mark.parametrize("step", [1, 2, 3])
def test_the_round_trip_of_a_true_plane_ends_where_it_began(step):
    error, seen = error_of(true_depth(), step=step)
    assert seen.all() and error.max() < 1e-9
    assert multiview_geometric(error, round_trip_weight(error, seen)) < 1e-9


def test_a_wrong_depth_has_the_error_that_geometry_says():
    pixels = chosen()[2]
    depth = 1.01 * true_depth()
    # by hand: the neighbour looks towards the wrong point, and sees the plane
    pixels_h = torch.cat([pixels.double(), torch.ones(len(pixels), 1)], 1)
    world = (pixels_h @ torch.linalg.inv(K_R).T * depth[:, None] - REFERENCE[:3, 3]) @ REFERENCE[:3, :3]
    centre = -NEIGHBOUR[:3, :3].T @ NEIGHBOUR[:3, 3]
    ray = world - centre
    hit = centre + ray * ((DISTANCE - NORMAL @ centre) / (ray @ NORMAL))[:, None]
    back = (hit @ REFERENCE[:3, :3].T + REFERENCE[:3, 3]) @ K_R.T
    wanted = (back[:, :2] / back[:, 2:] - pixels).norm(dim=-1)
    error, seen = error_of(depth)
    assert seen.all() and wanted.min() > 0.05
    torch.testing.assert_close(error, wanted, rtol=1e-9, atol=1e-9)
    weight = round_trip_weight(error, seen)
    expected = (torch.exp(-wanted) * wanted).mean().item()
    assert multiview_geometric(error, weight).item() == pytest.approx(expected, rel=1e-9)


def test_the_weight_falls_with_the_error_and_hidden_pixels_have_none():
    error = torch.tensor([0.0, 0.5, 0.999, 1.0, 0.2], dtype=torch.float64, requires_grad=True)
    seen = torch.tensor([True, True, True, True, False])
    weight = round_trip_weight(error, seen)
    assert weight.tolist() == pytest.approx([1, np.exp(-0.5), np.exp(-0.999), 0, 0])
    assert not weight.requires_grad
    multiview_geometric(error, weight).backward()
    assert error.grad.tolist() == pytest.approx([w / 3 for w in weight.tolist()])


def test_what_something_hides_from_the_neighbour_has_no_weight():
    inverse_depth = 1 / plane_depth(NEIGHBOUR, K_N)
    inverse_depth[:, 32:] = 1 / 1.2  # a board before the plane
    relative = relative_pose(REFERENCE, NEIGHBOUR)
    there, _ = transfer(chosen()[2].double(), true_depth(), relative, K_R, K_N)
    weight = round_trip_weight(*error_of(true_depth(), inverse_depth))
    hidden, free = there[:, 0] > 32.5, there[:, 0] < 30.5  # between them the kept pixels are mixed
    assert hidden.any() and free.any()
    assert (weight[hidden] == 0).all() and (weight[free] > 0.999).all()


def test_points_that_the_neighbour_cannot_see_do_not_count_and_have_finite_gradients():
    relative = torch.eye(4, dtype=torch.float64)
    relative[:3, 3] = torch.tensor([0.0, 0.0, -2.0])  # the neighbour stands 2 m ahead
    pixels = torch.tensor([[33.1, 22.7], [33.0, 22.0], [33.0, 22.0], [1.0, 22.0], [33.0, 22.0]], dtype=torch.float64)
    depth = torch.tensor([2.0, 1.0, 2.000000001, 3.0, 4.1], dtype=torch.float64, requires_grad=True)
    inverse_depth = torch.full((H, W), 0.5, dtype=torch.float64)
    error, seen = round_trip_error(pixels, depth, inverse_depth, relative, K_R, K_N)
    # in its centre, behind it, on its image plane's horizon, outside its image, before it
    assert seen.tolist() == [False, False, False, False, True]
    multiview_geometric(error, round_trip_weight(torch.zeros(5), seen)).backward()
    assert torch.isfinite(depth.grad).all() and (depth.grad[:4] == 0).all() and depth.grad[4] != 0
    # where the neighbour has no depth
    nothing = round_trip_error(pixels, depth, torch.zeros(H, W, dtype=torch.float64), relative, K_R, K_N)[1]
    assert not nothing.any()


def test_without_a_pixel_both_terms_are_zero_with_a_gradient():
    empty = torch.zeros(0, dtype=torch.float64, requires_grad=True)
    assert multiview_geometric(empty, torch.zeros(0)).item() == 0
    multiview_photometric(torch.zeros(0, 9), empty[:, None] + torch.zeros(9), torch.zeros(0)).backward()


def test_true_depth_and_normal_are_the_photometric_minimum():
    depth, normal = true_depth().requires_grad_(), true_normal()
    tilted = torch.nn.functional.normalize(normal + torch.tensor([0.4, 0, 0], dtype=torch.float64), dim=-1)
    least = photometric(depth, normal)
    assert least < 1e-3  # what bilinear sampling costs
    assert photometric(depth, tilted) > 2 * least
    slopes = {}
    for factor in (0.97, 1.03):
        value = photometric(factor * depth, normal)
        assert value > 20 * least
        (slopes[factor],) = torch.autograd.grad(value, depth)
    assert slopes[0.97].sum() < 0 < slopes[1.03].sum()


def test_the_normal_feels_the_photos():
    depth, start = true_depth(), true_normal()
    tilted = torch.nn.functional.normalize(start + torch.tensor([0.5, 0, 0], dtype=torch.float64), dim=-1)
    tilted.requires_grad_()
    (gradient,) = torch.autograd.grad(photometric(depth, tilted), tilted)
    # down the slope is back towards the true normal
    assert (gradient * (start - tilted.detach())).sum() < 0


def test_neither_brightness_nor_contrast_matters():
    depth, normal, image = true_depth(), true_normal(), photo(NEIGHBOUR, K_N)
    plain = photometric(depth, normal, image).item()
    assert photometric(depth, normal, 0.4 * image + 0.3).item() == pytest.approx(plain, abs=1e-12)


def test_correlation_is_signed():
    patch = torch.rand(4, 49, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    assert correlation(patch, 0.2 * patch + 0.7).tolist() == pytest.approx([1] * 4)
    assert correlation(patch, 0.9 - 0.5 * patch).tolist() == pytest.approx([-1] * 4)
    assert correlation(patch, 1 - patch).mean().item() == pytest.approx(np.corrcoef(patch[0], 1 - patch[0])[0, 1])
    negative = 1 - photo(NEIGHBOUR, K_N)
    assert photometric(true_depth(), true_normal(), negative).item() > 1.99


def test_a_flat_neighbour_is_not_singular():
    patches = torch.full((3, 49), 0.5, dtype=torch.float32, requires_grad=True)
    reference = torch.rand(3, 49, generator=torch.Generator().manual_seed(0))
    loss = multiview_photometric(reference, patches, torch.ones(3))
    loss.backward()
    assert loss.item() == pytest.approx(1) and torch.isfinite(patches.grad).all()


def test_patches_that_leave_the_image_or_are_seen_edge_on_are_told():
    relative, image = relative_pose(REFERENCE, NEIGHBOUR), photo(NEIGHBOUR, K_N)
    pixels, depth, normal = chosen()[2].double(), true_depth(), true_normal()

    def whole(normal, K):
        return neighbour_patches(image, pixels, depth, normal, relative, K_R, K, PATCH)[1]

    there, _ = transfer(pixels, depth, relative, K_R, K_N)
    for axis in (0, 1):
        for middle, edge in ((there[:, axis].min(), 0), (there[:, axis].max(), (W, H)[axis])):
            moved = K_N.clone()
            moved[axis, 2] += edge - middle + (2.0 if edge == 0 else -2.0)  # that patch's middle is 2 px inside
            inside = whole(normal, moved)
            assert not inside[there[:, axis] == middle].any() and inside.any()
    ray = torch.linalg.inv(K_R) @ torch.tensor([*pixels[0], 1.0], dtype=torch.float64)
    sideways = torch.linalg.cross(ray, torch.tensor([0.0, 1, 0], dtype=torch.float64))
    normal[0] = torch.nn.functional.normalize(sideways, dim=0)
    assert whole(normal, K_N).tolist() == [False] + [True] * (len(depth) - 1)


def test_gradcheck_geometric():
    depth = (1.01 * true_depth()).requires_grad_()
    weight = round_trip_weight(*error_of(depth))

    def geometric(depth):
        return multiview_geometric(error_of(depth)[0], weight)

    assert torch.autograd.gradcheck(geometric, depth)


def test_gradcheck_photometric():
    depth = (1.013 * true_depth()).requires_grad_()
    normal = (true_normal() + 0.05).requires_grad_()
    assert torch.autograd.gradcheck(photometric, (depth, normal))


def test_float32_is_enough():
    pixels = chosen()[2]
    relative = relative_pose(REFERENCE, NEIGHBOUR).float()
    inverse_depth = (1 / plane_depth(NEIGHBOUR, K_N)).float()
    error, seen = round_trip_error(
        pixels.float(), true_depth().float(), inverse_depth, relative, K_R.float(), K_N.float()
    )
    assert seen.all() and error.max() < 1e-3 and error.dtype == torch.float32
