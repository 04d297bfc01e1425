"""The compiled kernels: bounds, threads, bad values. Against the float64 reference: tests/bench/test_numerics.py."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C, splat
from room2dgs.splat import Rendering, Surfels, operators, reference
from room2dgs.splat.constants import OPACITY_FLOOR
from room2dgs.tools.numerics.kinds import smooth
from room2dgs.tools.numerics.scenes import HardScene

BACKGROUND = torch.tensor([0.1, 0.4, 0.7])


def differentiate(render, surfels, K, cam_from_world, width, height, weights, dtype):
    surfels = Surfels(*(x.to(dtype).requires_grad_() for x in surfels))
    K, pose, background = (x.to(dtype).requires_grad_() for x in (K, cam_from_world, BACKGROUND.clone()))
    center_px = torch.zeros(len(surfels.centers), 2, dtype=dtype, requires_grad=True)
    images = render(surfels, K, pose, width, height, background=background, center_px=center_px)
    total = sum((w.to(dtype) * image).sum() for w, image in zip(weights, images, strict=True))
    names = [*Surfels._fields, "K", "cam_from_world", "background", "center_px"]
    gradients = torch.autograd.grad(total, [*surfels, K, pose, background, center_px])
    return images, dict(zip(names, gradients, strict=True))


@pytest.mark.parametrize("threads", [2, 3, 5])
def test_same_bits_on_any_number_of_threads(make_surfels, make_view, threads):
    surfels, (K, pose) = make_surfels(3000, 12, (0.01, 0.3)), make_view()
    g = torch.Generator().manual_seed(2)
    weights = [torch.randn(s, generator=g) for s in [(90, 120, 3), *[(90, 120)] * 3, (90, 120, 3), (90, 120)]]
    args = (surfels, K * torch.tensor([[2.3], [2.3], [1.0]]), pose, 120, 90, weights, torch.float32)
    try:
        splat.set_threads(1)
        images, gradients = differentiate(splat.render, *args)
        splat.set_threads(threads)
        again, gradients_again = differentiate(splat.render, *args)
    finally:
        splat.set_threads()
    for name, a, b in zip(images._fields, images, again, strict=True):
        assert torch.equal(a, b), name
    for name, gradient in gradients.items():
        assert torch.equal(gradient, gradients_again[name]), name


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.05, 3.0), st.floats(0.05, 2.0), st.booleans())
def test_no_visible_pixel_is_lost(seed, distance, scale, floor):
    """One disc, often across the camera plane: bounds that are too tight lose whole tiles of it."""
    g = torch.Generator().manual_seed(seed)
    center = torch.randn(1, 3, generator=g) * torch.tensor([0.5, 0.5, 0.1]) * distance + torch.tensor([0, 0, distance])
    center[:, 2].clamp_(min=0.06)
    rotation = torch.randn(1, 4, generator=g)
    if floor:
        rotation = torch.tensor([[0.7071, 0.7071, 0.0, 0.0]]) + 0.05 * rotation
        center[:, 1] += 1.0
    scales = scale * torch.exp(torch.randn(1, 2, generator=g))
    surfels = Surfels(center, rotation, scales, torch.rand(1, generator=g) * 0.9 + 0.05, torch.zeros(1, 1, 3))
    K = torch.tensor([[60.0, 0, 40.2], [0, 60.0, 29.5], [0, 0, 1]])
    exact = Surfels(*(x.double() for x in surfels))
    scene = HardScene(surfels, K, torch.eye(4).double(), 80, 60)
    kept = smooth(scene)
    expected = reference.render(exact, K.double(), torch.eye(4).double(), 80, 60)
    actual = splat.render(surfels, K, torch.eye(4), 80, 60)
    lost = ((expected.alpha > 0) != (actual.alpha > 0)) & kept
    assert not lost.any(), f"{int(lost.sum())} pixels differ"


def test_tile_lists_are_tight(make_surfels):
    """Listed tiles against tiles that hold a visible pixel: a bounding box would list about twice as many."""
    surfels = make_surfels(200, 13, (0.02, 0.5))
    K = torch.tensor([[150.0, 0, 80.0], [0, 150.0, 60.0], [0, 0, 1]])
    needed = listed = 0
    for k in range(200):
        one = Surfels(*(x[k : k + 1] for x in surfels))
        *images, state = operators.rasterize(
            *one, torch.eye(4), K, torch.zeros(3), None, 160, 120, 0.05, OPACITY_FLOOR, True, True
        )
        out = Rendering(*images)
        listed += int(state[1])
        alpha = torch.nn.functional.pad(out.alpha.detach(), (0, 0, 0, 8))
        needed += int((alpha.reshape(8, 16, 10, 16) > 0).any(dim=3).any(dim=1).sum())
    assert needed <= listed <= 1.06 * needed, (listed, needed)


def test_nothing_to_see():
    empty = Surfels(*(torch.zeros(s) for s in [(0, 3), (0, 4), (0, 2), (0,), (0, 1, 3)]))
    K = torch.tensor([[50.0, 0, 10], [0, 50.0, 10], [0, 0, 1]])
    pose = torch.eye(4, requires_grad=True)
    out = splat.render(empty, K, pose, 20, 20, background=BACKGROUND)
    assert torch.equal(out.color, BACKGROUND.expand(20, 20, 3)) and not out.alpha.any() and not out.depth.any()
    out.color.sum().backward()
    assert torch.equal(pose.grad, torch.zeros(4, 4))


@pytest.mark.parametrize("field", Surfels._fields)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 0.0, -1.0])
def test_a_bad_surfel_spoils_nothing_else(make_surfels, make_view, field, value):
    surfels, (K, pose) = make_surfels(60, 14), make_view()
    bad = Surfels(*(x.clone() for x in surfels))
    getattr(bad, field)[7] = value
    leaves = Surfels(*(x.requires_grad_() for x in bad))
    out = splat.render(leaves, K, pose, 53, 40)
    assert all(torch.isfinite(image).all() for image in out)
    sum(image.sum() for image in out).backward()
    for name, x in zip(Surfels._fields, leaves, strict=True):
        others = torch.ones(60, dtype=torch.bool)
        others[7] = False
        assert torch.isfinite(x.grad[others]).all(), name


@pytest.mark.parametrize("isa", ["baseline", "avx2"])
def test_the_kernels_of_other_instruction_sets_agree(isa, make_surfels, make_view, tmp_path):
    """All are in every build. AVX-512 draws the bits of AVX2, and sums gradients in another order; the baseline, which
    fuses nothing, draws the same picture."""
    if isa == "avx2" and _C.isa() == "baseline":
        pytest.skip("the processor has no AVX2")
    surfels, (K, pose) = make_surfels(300, 15), make_view()
    torch.save([*surfels, K, pose], tmp_path / "scene.pt")
    program = (
        "import sys, torch\n"
        "from room2dgs import _C\n"
        "from room2dgs.splat import Surfels, render\n"
        "*s, K, pose = torch.load(sys.argv[1], weights_only=True)\n"
        "s = [x.requires_grad_() for x in s]\n"
        "out = render(Surfels(*s), K, pose, 53, 40)\n"
        "sum(x.sum() for x in out).backward()\n"
        "assert _C.isa() == sys.argv[3]\n"
        "torch.save([x.detach() for x in out] + [x.grad for x in s], sys.argv[2])\n"
    )
    env = {**os.environ, "ROOM2DGS_ISA": isa}
    command = [sys.executable, "-c", program, str(tmp_path / "scene.pt"), str(tmp_path / "out.pt"), isa]
    subprocess.run(command, check=True, env=env, cwd=tmp_path)
    theirs = torch.load(tmp_path / "out.pt", weights_only=True)
    leaves = [x.requires_grad_() for x in surfels]
    out = splat.render(Surfels(*leaves), K, pose, 53, 40)
    sum(x.sum() for x in out).backward()
    for a, b in zip(out, theirs, strict=False):
        assert isa == "baseline" or torch.equal(a, b)
    for a, b in zip([*out, *(x.grad for x in leaves)], theirs, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-4 * b.abs().max().item())


def test_outputs_that_are_not_wanted_cost_nothing_else(make_surfels, make_view):
    surfels, (K, pose) = make_surfels(200, 16), make_view()
    full = splat.render(surfels, K, pose, 53, 40)
    lean = splat.render(surfels, K, pose, 53, 40, with_normal=False, with_distortion=False)
    assert not lean.normal.any() and not lean.distortion.any()
    for name in ("color", "alpha", "depth", "median_depth"):
        assert torch.equal(getattr(full, name), getattr(lean, name)), name


def test_wrong_shapes_and_types_are_named(make_surfels, make_view):
    surfels, (K, pose) = make_surfels(5), make_view()
    with pytest.raises(ValueError, match="rotations"):
        splat.render(surfels._replace(rotations=torch.zeros(5, 3)), K, pose, 8, 8)
    with pytest.raises(ValueError, match="sh has shape"):
        splat.render(surfels._replace(sh=torch.zeros(5, 5, 3)), K, pose, 8, 8)
    with pytest.raises(ValueError, match="float64"):
        splat.render(surfels._replace(scales=surfels.scales.double()), K, pose, 8, 8)
    with pytest.raises(ValueError, match="image size"):
        splat.render(surfels, K, pose, 0, 8)


@pytest.mark.parametrize("background", [torch.zeros(0), torch.ones(1), torch.ones(4), torch.ones(1, 3)])
def test_a_background_of_another_size_is_refused(make_surfels, make_view, background):
    surfels, (K, pose) = make_surfels(5), make_view()
    with pytest.raises(ValueError, match="background has shape"):
        splat.render(surfels, K, pose, 8, 8, background=background)


@pytest.mark.parametrize("near_m", [0.0, -0.1, float("nan"), float("inf")])
def test_a_near_plane_behind_the_camera_is_refused(make_surfels, make_view, near_m):
    surfels, (K, pose) = make_surfels(5), make_view()
    with pytest.raises(ValueError, match="near"):
        splat.render(surfels, K, pose, 8, 8, near_m=near_m)


def test_a_frame_that_has_drawn_another_view_has_no_gradient(make_surfels, make_view):
    surfels, (K, pose) = make_surfels(5), make_view()
    view = (pose.double(), K.double(), 8, 8, 0.05, OPACITY_FLOOR, BACKGROUND)
    maps = [torch.zeros(8, 8, 3), *(torch.zeros(8, 8) for _ in range(3)), torch.zeros(8, 8, 3), torch.zeros(8, 8)]
    frame = _C.RasterFrame()
    number = frame.forward(*surfels, *view, *maps)
    frame.forward(*surfels, *view, *maps)
    to = [*(torch.zeros_like(x) for x in surfels), torch.zeros(5, 2), torch.zeros(4, 4).double()]
    none = [None] * 6
    with pytest.raises(ValueError, match="another view"):
        frame.backward(number, *surfels, maps[1], maps[2], *none, *to, torch.zeros(3, 3).double(), None)


def test_two_backward_passes_through_one_view_are_equal(make_surfels, make_view):
    surfels, (K, pose) = make_surfels(50), make_view()
    leaves = Surfels(*(x.requires_grad_() for x in surfels))
    total = splat.render(leaves, K, pose, 53, 40).color.sum()
    first = torch.autograd.grad(total, leaves, retain_graph=True)
    again = torch.autograd.grad(total, leaves)
    assert all(torch.equal(a, b) for a, b in zip(first, again, strict=True))
