"""The network and its parts."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from torch.nn import functional as F

from room2dgs.errors import InputError
from room2dgs.tools.prior_network.angular import angle_between, expected_angle, negative_log_likelihood
from room2dgs.tools.prior_network.encoder import FEATURE_WIDTHS, Encoder, imagenet_file, load_imagenet
from room2dgs.tools.prior_network.network import (
    LEAST_PLANE_FACING,
    FullSize,
    PriorNetwork,
    facing,
    ln_depth_of_plane,
)
from room2dgs.tools.prior_network.rays import plane_distance, ray_slopes, unit_rays


@pytest.fixture(scope="module")
def network() -> PriorNetwork:
    torch.manual_seed(0)
    made = PriorNetwork()
    load_imagenet(made.encoder, imagenet_file())
    return made.eval()


@pytest.fixture(scope="module")
def classifier() -> dict[str, torch.Tensor]:
    return torch.load(imagenet_file(), weights_only=True)


def photo(seed: int, height: int = 64, width: int = 96) -> torch.Tensor:
    return torch.rand(1, 3, height, width, generator=torch.Generator().manual_seed(seed))


def camera(focal: float, height: int = 64, width: int = 96) -> torch.Tensor:
    return torch.tensor([[[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]]])


def with_norm(x, state, convolution, norm, **settings):
    y = F.conv2d(x, state[f"{convolution}.weight"], **settings)
    names = ("running_mean", "running_var", "weight", "bias")
    return F.batch_norm(y, *(state[f"{norm}.{name}"] for name in names), eps=1e-3)


def test_folded_convolutions_give_what_batch_norm_gave(classifier):
    encoder = Encoder()
    load_imagenet(encoder, imagenet_file())
    x = torch.randn(1, 3, 32, 32)
    stem = with_norm(x, classifier, "_conv_stem", "_bn0", stride=2, padding=1)
    torch.testing.assert_close(encoder.stem(x), stem, atol=1e-3, rtol=1e-4)
    # the fifth bottleneck has a shortcut and a kernel of 5
    y = torch.randn(1, 40, 8, 8)
    z = F.relu6(with_norm(y, classifier, "_blocks.4._expand_conv", "_blocks.4._bn0"))
    z = F.relu6(with_norm(z, classifier, "_blocks.4._depthwise_conv", "_blocks.4._bn1", padding=2, groups=240))
    z = y + with_norm(z, classifier, "_blocks.4._project_conv", "_blocks.4._bn2")
    torch.testing.assert_close(encoder.stages[2][1](y), z, atol=1e-3, rtol=1e-4)


def test_features_have_five_scales_and_about_unit_size(network):
    with torch.no_grad():
        features = network.encoder(F.interpolate(photo(1, 8, 8), size=(128, 160), mode="bilinear"))
    for scale, (feature, width) in enumerate(zip(features, FEATURE_WIDTHS, strict=True)):
        assert feature.shape == (1, width, 64 >> scale, 80 >> scale)
        assert 0.2 < feature.std() < 3.0


def test_a_file_that_is_not_the_classifier_is_named(tmp_path):
    torch.save({"weight": torch.zeros(1)}, tmp_path / "other.pth")
    with pytest.raises(InputError, match=r"other\.pth"):
        load_imagenet(Encoder(), tmp_path / "other.pth")


def test_slopes_lead_back_to_the_pixel_centres():
    intrinsics = torch.tensor([[[90.0, 0.0, 31.0], [0.0, 110.0, 20.0], [0.0, 0.0, 1.0]]])
    slopes = ray_slopes(intrinsics, height=3, width=5, stride=4)
    rays = torch.cat([slopes, torch.ones(1, 1, 3, 5)], dim=1)
    pixels = torch.einsum("bij,bjhw->bihw", intrinsics, rays)
    torch.testing.assert_close(pixels[0, 0, 0], torch.tensor([2.0, 6.0, 10.0, 14.0, 18.0]))
    torch.testing.assert_close(pixels[0, 1, :, 0], torch.tensor([2.0, 6.0, 10.0]))


@pytest.mark.parametrize("kappa", [0.2, 1.0, 3.0, 30.0])
def test_likelihood_is_a_density_on_the_sphere_and_its_mean_angle_the_expected_one(kappa):
    def density(angle: float) -> float:
        # the constant 2 pi that the likelihood leaves out cancels the circle's 2 pi
        loss = negative_log_likelihood(torch.tensor(angle, dtype=torch.float64), torch.tensor(kappa).double())
        return float(torch.exp(-loss)) * np.sin(angle)

    assert quad(density, 0, np.pi)[0] == pytest.approx(1.0, rel=1e-5)
    mean = quad(lambda angle: angle * density(angle), 0, np.pi)[0]
    assert float(expected_angle(torch.tensor(kappa))) == pytest.approx(mean, rel=1e-5)


@given(degrees=st.floats(2.0, 175.0))
def test_angle_between_is_the_angle(degrees):
    turned = torch.tensor([[np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))]])
    angle = angle_between(torch.tensor([[0.0, 0.0, 1.0]]).double(), turned)
    assert float(torch.rad2deg(angle)) == pytest.approx(degrees, abs=0.02)


def test_angle_has_a_finite_gradient_where_the_normals_agree_or_oppose():
    for sign in (1.0, -1.0):
        normal = torch.tensor([[0.0, 0.0, 1.0]], requires_grad=True)
        angle_between(normal, sign * torch.tensor([[0.0, 0.0, 1.0]])).sum().backward()
        assert torch.isfinite(normal.grad).all()


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10**6), focal=st.floats(20.0, 500.0))
def test_facing_normals_are_unit_and_face_the_camera_and_others_stay(seed, focal):
    vectors = torch.randn(1, 3, 6, 8, generator=torch.Generator().manual_seed(seed))
    slopes = ray_slopes(camera(focal, 6, 8), 6, 8, 1)
    rays = unit_rays(slopes)
    normals = facing(vectors, slopes)
    torch.testing.assert_close(normals.norm(dim=1), torch.ones(1, 6, 8))
    assert ((normals * rays).sum(dim=1) < 0).all()
    before = F.normalize(vectors, dim=1)
    good = ((before * rays).sum(dim=1, keepdim=True) < -0.02).expand_as(before)
    torch.testing.assert_close(normals[good], before[good])


@pytest.mark.parametrize(("height", "width"), [(32, 32), (64, 96)])
def test_exported_maps_have_the_photos_size_and_units(network, height, width):
    intrinsics = camera(70.0, height, width)
    with torch.no_grad():
        depth, depth_error, normal, normal_error = FullSize(network)(photo(2, height, width), intrinsics)
    assert depth.shape == depth_error.shape == normal_error.shape == (1, 1, height, width)
    assert (depth > 0).all() and (depth_error > 0).all() and (normal_error > 0).all()
    assert float(normal_error.max()) < np.pi
    torch.testing.assert_close(normal.norm(dim=1), torch.ones(1, height, width))
    assert ((normal * unit_rays(ray_slopes(intrinsics, height, width, 1))).sum(dim=1) < 0).all()


def test_a_photo_gives_the_same_maps_alone_and_in_a_batch(network):
    cameras = torch.cat([camera(60.0), camera(120.0)])
    with torch.no_grad():
        both = network(torch.cat([photo(3), photo(4)]), cameras)
        alone = network(photo(4), camera(120.0))
    for one, other in zip(both, alone, strict=True):
        torch.testing.assert_close(one[1:], other, atol=1e-4, rtol=1e-4)


def test_maps_depend_on_the_field_of_view(network):
    with torch.no_grad():
        wide, narrow = network(photo(5), camera(40.0)), network(photo(5), camera(160.0))
    assert float((wide.ln_depth - narrow.ln_depth).abs().max()) > 1e-3
    assert float((wide.normal - narrow.normal).abs().max()) > 1e-3


def test_depth_and_a_planes_distance_lead_to_each_other():
    slopes = ray_slopes(camera(70.0), 64, 96, 1)
    wall = F.normalize(torch.tensor([0.3, -0.2, -0.8]), dim=0)[None, :, None, None].expand(1, 3, 64, 96)
    points_z = 1.7 / -(wall * torch.cat([slopes, torch.ones_like(slopes[:, :1])], dim=1)).sum(dim=1, keepdim=True)
    distance = plane_distance(points_z, wall, slopes)
    torch.testing.assert_close(distance, torch.full_like(distance, 1.7))
    torch.testing.assert_close(ln_depth_of_plane(wall, distance.log(), slopes), points_z.log())


def test_a_plane_seen_along_itself_has_a_finite_depth_and_gradient():
    slopes = ray_slopes(camera(70.0), 64, 96, 1)
    side = torch.tensor([-1.0, 0.0, 0.0])[None, :, None, None].expand(1, 3, 64, 96).clone().requires_grad_()
    depth = ln_depth_of_plane(side, torch.zeros(1, 1, 64, 96), slopes)
    depth.sum().backward()
    assert torch.isfinite(depth).all() and torch.isfinite(side.grad).all()
    assert float(side.grad.abs().max()) <= 1.0 / LEAST_PLANE_FACING
