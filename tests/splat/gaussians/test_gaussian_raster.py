"""The kernels of 3D Gaussians: bounds, threads, operators, bad values. Against float64: tools/test_numerics.py."""

from __future__ import annotations

import gc
import os
import subprocess
import sys

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C, splat
from room2dgs.splat import Gaussians, frames
from room2dgs.splat.constants import OPACITY_FLOOR
from room2dgs.splat.gaussians import operators, reference
from room2dgs.tools.numerics.kinds import smooth
from room2dgs.tools.numerics.scenes import HardScene

K = torch.tensor([[60.0, 0, 40.2], [0, 60.0, 29.5], [0, 0, 1]])
BACKGROUND = torch.tensor([0.1, 0.4, 0.7])


@pytest.fixture
def make_gaussians(make_surfels):
    def make(count, seed, scale=(0.02, 0.22)):
        s = make_surfels(count, seed, scale)
        return Gaussians(*s._replace(scales=torch.cat([s.scales, 0.4 * s.scales[:, :1]], dim=1)))

    return make


@pytest.fixture
def leaves(make_gaussians, make_view):
    camera, pose = make_view()
    tensors = [*make_gaussians(40, 21), pose, camera, BACKGROUND, torch.zeros(40, 2)]
    return [x.clone().requires_grad_() for x in tensors]


def drawn(leaves, width=37, height=20, **options):
    *gaussians, pose, camera, background, center_px = leaves
    options |= {"background": background, "center_px": center_px}
    return splat.render_gaussians(Gaussians(*gaussians), camera, pose, width, height, **options)


def total_of(images):
    return sum((k + 1) * image.square().sum() for k, image in enumerate(images))


@pytest.mark.parametrize("threads", [2, 3, 5])
@pytest.mark.parametrize("antialias", [False, True])
def test_same_bits_on_any_number_of_threads(make_gaussians, make_view, threads, antialias):
    camera, pose = make_view()
    tensors = [*make_gaussians(3000, 12, (0.01, 0.3)), pose, camera, BACKGROUND, torch.zeros(3000, 2)]
    found = []
    try:
        for count in (1, threads):
            splat.set_threads(count)
            leaves = [x.clone().requires_grad_() for x in tensors]
            images = drawn(leaves, 120, 90, antialias=antialias)
            found.append((*images, *torch.autograd.grad(total_of(images), leaves)))
    finally:
        splat.set_threads()
    assert all(torch.equal(a, b) for a, b in zip(*found, strict=True))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.05, 3.0), st.floats(0.01, 1.0), st.booleans())
def test_no_visible_pixel_is_lost(seed, distance, scale, antialias):
    """One Gaussian, often to the side or near the camera: bounds that are too tight lose whole tiles of it."""
    g = torch.Generator().manual_seed(seed)
    center = torch.randn(1, 3, generator=g) * torch.tensor([1.0, 1.0, 0.1]) * distance + torch.tensor([0, 0, distance])
    center[:, 2].clamp_(min=0.06)
    scales = scale * torch.exp(torch.randn(1, 3, generator=g))
    opacity = torch.rand(1, generator=g) * 0.9 + 0.05
    gaussians = Gaussians(center, torch.randn(1, 4, generator=g), scales, opacity, torch.zeros(1, 1, 3))
    kept = smooth(HardScene(gaussians, K, torch.eye(4).double(), 80, 60))
    exact = Gaussians(*(x.double() for x in gaussians))
    expected = reference.render(exact, K.double(), torch.eye(4).double(), 80, 60, antialias=antialias)
    actual = splat.render_gaussians(gaussians, K, torch.eye(4), 80, 60, antialias=antialias)
    lost = ((expected.alpha > 0) != (actual.alpha > 0)) & kept
    if antialias:  # the other filter has jumps of its own
        lost &= (expected.alpha - actual.alpha).abs() > 1.01 * OPACITY_FLOOR
    assert not lost.any(), f"{int(lost.sum())} pixels differ"


def test_tile_lists_are_tight(make_gaussians):
    """Listed tiles against tiles that hold a visible pixel: a bounding box would list about twice as many."""
    gaussians = make_gaussians(200, 13, (0.02, 0.5))
    camera = torch.tensor([[150.0, 0, 80.0], [0, 150.0, 60.0], [0, 0, 1]])
    needed = listed = 0
    for k in range(200):
        one = Gaussians(*(x[k : k + 1] for x in gaussians))
        *_, alpha, _, _, _, _, state = operators.rasterize(
            *one, torch.eye(4), camera, torch.zeros(3), None, 160, 120, 0.05, OPACITY_FLOOR, False, False, 0.3, False
        )
        padded = torch.nn.functional.pad(alpha, (0, 0, 0, 8))
        needed += int((padded.reshape(8, 16, 10, 16).amax((1, 3)) > 0).sum())
        listed += int(state[1])
    assert needed <= listed < 1.1 * needed


@pytest.mark.parametrize("isa", ["baseline", "avx2"])
def test_instruction_sets_agree(tmp_path, leaves, isa):
    program = (
        "import sys, torch\nfrom room2dgs import splat\nfrom room2dgs.splat import Gaussians\n"
        "leaves = [x.requires_grad_() for x in torch.load(sys.argv[1])]\n"
        "images = splat.render_gaussians(Gaussians(*leaves[:5]), leaves[6], leaves[5], 37, 20)\n"
        "total = sum((k + 1) * image.square().sum() for k, image in enumerate(images))\n"
        "torch.save([*images, *torch.autograd.grad(total, leaves[:7])], sys.argv[2])\n"
    )
    torch.save([x.detach() for x in leaves], tmp_path / "in.pt")
    command = [sys.executable, "-c", program, tmp_path / "in.pt", tmp_path / "out.pt"]
    subprocess.run(command, check=True, env=os.environ | {"ROOM2DGS_ISA": isa})
    images = drawn([*leaves[:7], torch.zeros(3), None])
    mine = [*images, *torch.autograd.grad(total_of(images), leaves[:7])]
    for a, b in zip(mine, torch.load(tmp_path / "out.pt"), strict=True):
        torch.testing.assert_close(a, b, rtol=1e-3, atol=1e-3 * float(a.abs().max()))


@pytest.mark.parametrize("options", [(True, True, 0.3, False), (False, False, 0.1, True)])
def test_the_operators_are_registered_as_torch_wants_them(leaves, options):
    args = (37, 20, 0.05, OPACITY_FLOOR, *options)
    torch.library.opcheck(torch.ops.room2dgs.rasterize_gaussians.default, (*leaves, *args))
    with torch.no_grad():
        color, alpha, depth, *_, state = operators.rasterize(*leaves, *args)
    values = [x.detach() for x in leaves[:-1]]
    flowing = [torch.ones_like(color), None, torch.ones_like(depth), None, None, None]
    back = (*values, alpha, depth, state, *flowing, *args, True)
    torch.library.opcheck(torch.ops.room2dgs.rasterize_gaussians_backward.default, back)


def test_torch_compile_takes_it_whole(leaves):
    eager = torch.autograd.grad(total_of(drawn(leaves)), leaves)
    compiled = torch.compile(lambda *x: total_of(drawn(x)), fullgraph=True, backend="aot_eager")
    again = torch.autograd.grad(compiled(*leaves), leaves)
    assert all(torch.equal(a, b) for a, b in zip(eager, again, strict=True))


def test_saved_tensors_that_were_copied_give_the_same_gradients(leaves):
    expected = torch.autograd.grad(total_of(drawn(leaves, antialias=True)), leaves)
    with torch.autograd.graph.saved_tensors_hooks(lambda x: x.clone(), lambda x: x):
        total = total_of(drawn(leaves, antialias=True))
    gc.collect()
    before = frames.num_kept()
    actual = torch.autograd.grad(total, leaves)
    assert frames.num_kept() == before
    assert all(torch.equal(a, b) for a, b in zip(actual, expected, strict=True))


def test_values_that_are_none_are_not_drawn(make_gaussians, make_view):
    camera, pose = make_view()
    gaussians = make_gaussians(60, 4)
    good = splat.render_gaussians(gaussians, camera, pose, 37, 20)
    bad = {"centers": float("nan"), "rotations": 0.0, "scales": float("nan"), "opacities": float("nan")}
    for name, value in bad.items():
        values = {field: torch.cat([x, x[:8]]) for field, x in gaussians._asdict().items()}
        values[name][60:] = value
        leaves = Gaussians(*(x.requires_grad_() for x in values.values()))
        out = splat.render_gaussians(leaves, camera, pose, 37, 20)
        assert torch.equal(out.color, good.color), name
        gradients = torch.autograd.grad(out.color.sum() + out.depth.sum(), leaves)
        assert all(torch.isfinite(x).all() and not x[60:].any() for x in gradients), name


def test_what_cannot_be_drawn_is_refused(make_gaussians, make_surfels, make_view):
    camera, pose = make_view()
    gaussians = make_gaussians(5, 1)
    with pytest.raises(ValueError, match=r"gaussians\.scales has shape \(5, 2\), not \(5, 3\)"):
        splat.render_gaussians(gaussians._replace(scales=gaussians.scales[:, :2]), camera, pose, 8, 8)
    with pytest.raises(ValueError, match=r"torch\.float32"):
        splat.render_gaussians(Gaussians(*(x.double() for x in gaussians)), camera, pose, 8, 8)
    with pytest.raises(ValueError, match=r"filter_px2 is 0\.0"):
        splat.render_gaussians(gaussians, camera, pose, 8, 8, filter_px2=0.0)
    with pytest.raises(ValueError, match="center_px is not zero"):
        splat.render_gaussians(gaussians, camera, pose, 8, 8, center_px=torch.ones(5, 2))


@pytest.mark.parametrize("frame_class", [_C.GaussianFrame, _C.device.GaussianBlockFrame])
def test_a_frame_takes_no_surfels(make_surfels, make_view, frame_class):
    """Scales of two would be read as three."""
    camera, pose = make_view()
    surfels = make_surfels(5, 1)
    frame = frame_class()
    images = [torch.zeros(8, 8, *tail).numpy() for tail in ((3,), (), (), (), (3,), ())]
    with pytest.raises(ValueError, match=r"scales has shape \(5, 2\), not \(5, 3\)"):
        frame.forward(
            *(x.numpy() for x in surfels), pose.double().numpy(), camera.double().numpy(), 8, 8, 0.05, OPACITY_FLOOR,
            torch.zeros(3).numpy(), *images, 0.3, False,
        )  # fmt: skip
