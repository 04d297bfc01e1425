"""`splat.render`'s door: what cannot be drawn as it stands is refused."""

from __future__ import annotations

import pytest
import torch

from room2dgs import splat
from room2dgs.kernels.emulation import cuda_kernels_on_cpu
from room2dgs.splat import Surfels, reference


def by_blocks(*args, **more):
    with cuda_kernels_on_cpu():
        return splat.render(*args, **more)


@pytest.fixture
def scene(make_surfels, make_view):
    return make_surfels(5), *make_view()


def changed(matrix, row, column, value):
    matrix = matrix.clone()
    matrix[row, column] = value
    return matrix


@pytest.mark.parametrize("render", [splat.render, reference.render])
@pytest.mark.parametrize(
    ("row", "column", "value", "sentence"),
    [
        (0, 1, 0.5, "skewed"), (1, 0, -0.5, "skewed"), (0, 0, -50.0, "focal"), (1, 1, 0.0, "focal"),
        (2, 2, 2.0, "last row"), (2, 0, 0.1, "last row"), (0, 2, float("nan"), "finite"),
        (0, 0, float("inf"), "finite"),
    ],
)  # fmt: skip
def test_a_camera_matrix_that_is_none_is_refused(scene, render, row, column, value, sentence):
    surfels, K, pose = scene
    with pytest.raises(ValueError, match=sentence):
        render(surfels, changed(K, row, column, value), pose, 8, 8)


@pytest.mark.parametrize(
    ("row", "column", "value", "sentence"),
    [(0, 0, 2.0, "rigid"), (3, 3, 2.0, "last row"), (3, 0, 1.0, "last row"), (0, 3, float("nan"), "finite")],
)
def test_a_pose_that_is_not_rigid_is_refused(scene, row, column, value, sentence):
    surfels, K, pose = scene
    with pytest.raises(ValueError, match=sentence):
        splat.render(surfels, K, changed(pose, row, column, value), 8, 8)


@pytest.mark.parametrize("near_m", [0.0, -0.05, float("nan"), float("inf")])
@pytest.mark.parametrize("render", [splat.render, reference.render])
def test_a_near_plane_that_is_not_in_front_is_refused(scene, near_m, render):
    with pytest.raises(ValueError, match="near_m"):
        render(*scene, 8, 8, near_m=near_m)


@pytest.mark.parametrize("floor", [0.0, -0.1, 1 / 256, 1.0, float("nan")])
@pytest.mark.parametrize("render", [splat.render, reference.render, by_blocks])
def test_a_floor_that_is_no_share_of_the_light_is_refused(scene, floor, render):
    with pytest.raises(ValueError, match="opacity_floor"):
        render(*scene, 8, 8, opacity_floor=floor)


def test_projected_centres_cannot_be_moved(scene):
    center_px = torch.zeros(5, 2)
    splat.render(*scene, 8, 8, center_px=center_px)
    center_px[3, 1] = 0.5
    for render in (splat.render, by_blocks):
        with pytest.raises(ValueError, match="center_px is not zero"):
            render(*scene, 8, 8, center_px=center_px)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"background": torch.zeros(4)}, "background has shape"),
        ({"background": torch.tensor([0.0, float("nan"), 0.0])}, "background has an entry"),
        ({"background": torch.zeros(3, dtype=torch.uint8)}, "background is torch.uint8"),
        ({"center_px": torch.zeros(5, 3)}, "center_px has shape"),
        ({"center_px": torch.zeros(0)}, "center_px has shape"),
    ],
)
def test_other_arguments_are_refused_by_name(scene, options, sentence):
    with pytest.raises(ValueError, match=sentence):
        splat.render(*scene, 8, 8, **options)


def test_surfels_that_do_not_fit_the_kernels_are_sent_to_the_reference(scene):
    surfels, K, pose = scene
    exact = Surfels(*(x.double() for x in surfels))
    with pytest.raises(ValueError, match=r"float64.*splat.reference"):
        splat.render(exact, K, pose, 8, 8)
    with pytest.raises(ValueError, match="no rasterizer for tensors on meta"):
        splat.render(*(Surfels(*(x.to("meta") for x in surfels)), K.to("meta"), pose.to("meta")), 8, 8)


def test_outputs_that_are_not_wanted_are_zeros_and_the_others_those_of_the_reference(make_surfels, make_view):
    surfels, (K, pose) = make_surfels(60, 3), make_view()
    exact = Surfels(*(x.double() for x in surfels))
    background = torch.tensor([0.1, 0.4, 0.7])
    expected = reference.render(exact, K, pose, 20, 17, background=background)
    actual = splat.render(surfels, K, pose, 20, 17, background=background, with_distortion=False, with_normal=False)
    assert expected.color.dtype == torch.float64 and not actual.normal.any() and not actual.distortion.any()
    for name in ("color", "alpha", "depth", "median_depth"):  # one pixel beside a jump may differ
        assert ((getattr(actual, name) - getattr(expected, name)).abs() > 1e-4).sum() <= 3, name


def test_a_default_dtype_of_float64_changes_nothing(scene):
    surfels, K, pose = scene
    expected = splat.render(surfels, K, pose, 16, 12)
    torch.set_default_dtype(torch.float64)
    try:
        leaves = Surfels(*(x.clone().requires_grad_() for x in surfels))
        actual = splat.render(leaves, K, pose, 16, 12)
        sum(x.sum() for x in actual).backward()
    finally:
        torch.set_default_dtype(torch.float32)
    assert all(torch.equal(a, b) for a, b in zip(actual, expected, strict=True))
    assert all(x.grad.dtype == torch.float32 for x in leaves)
