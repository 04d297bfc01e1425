"""The compiled kernels as torch operators: registration, tracing, and who owns the buffers of a view."""

from __future__ import annotations

import gc

import pytest
import torch

from room2dgs import splat
from room2dgs.splat import Surfels, frames, operators
from room2dgs.splat.constants import OPACITY_FLOOR


@pytest.fixture
def leaves(make_surfels, make_view):
    """centers, rotations, scales, opacities, sh, cam_from_world, K, background, center_px, all requiring grad."""
    K, pose = make_view()
    tensors = [*make_surfels(40, 21), pose, K, torch.tensor([0.1, 0.4, 0.7]), torch.zeros(40, 2)]
    return [x.clone().requires_grad_() for x in tensors]


def drawn(leaves, width=37, height=20, **options):
    *surfels, pose, K, background, center_px = leaves
    options |= {"background": background, "center_px": center_px}
    return splat.render(Surfels(*surfels), K, pose, width, height, **options)


def total_of(images):
    return sum((k + 1) * image.square().sum() for k, image in enumerate(images))


@pytest.mark.parametrize("options", [(True, True), (False, False)])
def test_the_operator_is_registered_as_torch_wants_it(leaves, options):
    torch.library.opcheck(torch.ops.room2dgs.rasterize.default, (*leaves, 37, 20, 0.05, OPACITY_FLOOR, *options))


def test_the_backward_operator_is_registered_as_torch_wants_it(leaves):
    with torch.no_grad():
        color, alpha, depth, *_, state = operators.rasterize(*leaves, 37, 20, 0.05, OPACITY_FLOOR, True, True)
    values = [x.detach() for x in leaves[:-1]]
    flowing = [torch.ones_like(color), None, torch.ones_like(depth), None, None, None]
    args = (*values, alpha, depth, state, *flowing, 37, 20, 0.05, OPACITY_FLOOR, True, True, True)
    torch.library.opcheck(torch.ops.room2dgs.rasterize_backward.default, args)


def test_torch_compile_takes_it_whole(leaves):
    eager = torch.autograd.grad(total_of(drawn(leaves)), leaves)
    compiled = torch.compile(lambda *x: total_of(drawn(x)), fullgraph=True, backend="aot_eager")
    again = torch.autograd.grad(compiled(*leaves), leaves)
    assert all(torch.equal(a, b) for a, b in zip(eager, again, strict=True))
    with pytest.raises(ValueError, match="skewed"):  # values are looked at when the compiled code runs
        skew = leaves[6].detach().clone()
        skew[0, 1] = 1.0
        compiled(*leaves[:6], skew, *leaves[7:])


def test_a_view_holds_its_buffers_as_long_as_its_graph_lives(leaves):
    gc.collect()
    before = frames.num_kept()
    with torch.no_grad():
        images = drawn(leaves)
    assert frames.num_kept() == before  # nothing to go back to
    views = [drawn(leaves) for _ in range(7)]
    assert frames.num_kept() == before + 7
    total = total_of(views[0])
    torch.autograd.grad(total, leaves, retain_graph=True)
    assert frames.num_kept() == before + 7
    torch.autograd.grad(total, leaves)
    assert frames.num_kept() == before + 6
    kept = views[1].alpha.detach()
    del views, total, images
    gc.collect()
    assert frames.num_kept() == before
    assert torch.isfinite(kept).all()


def test_interleaved_views_do_not_mix(leaves):
    first, second = drawn(leaves), drawn(leaves, 30, 33, with_distortion=False)
    expected = [torch.autograd.grad(total_of(drawn(leaves)), leaves)]
    expected.append(torch.autograd.grad(total_of(drawn(leaves, 30, 33, with_distortion=False)), leaves))
    actual = [torch.autograd.grad(total_of(images), leaves) for images in (first, second)]
    for a, b in zip(actual, expected, strict=True):
        assert all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def test_saved_tensors_that_were_copied_give_the_same_gradients(leaves):
    """Hooks that store activations elsewhere lose the buffers; the view is drawn again then."""
    expected = torch.autograd.grad(total_of(drawn(leaves)), leaves)
    with torch.autograd.graph.saved_tensors_hooks(lambda x: x.clone(), lambda x: x):
        total = total_of(drawn(leaves))
    before = frames.num_kept()
    actual = torch.autograd.grad(total, leaves)
    assert frames.num_kept() == before
    assert all(torch.equal(a, b) for a, b in zip(actual, expected, strict=True))


def test_the_background_alone_may_want_a_gradient(leaves):
    *surfels, pose, K, background, _ = (x.detach() for x in leaves)
    background.requires_grad_()
    out = splat.render(Surfels(*surfels), K, pose, 37, 20, background=background)
    (gradient,) = torch.autograd.grad(out.color.sum(), background)
    torch.testing.assert_close(gradient, (1 - out.alpha.detach()).sum().expand(3), rtol=1e-5, atol=1e-4)


def test_a_second_derivative_is_refused(leaves):
    first = torch.autograd.grad(drawn(leaves).color.square().sum(), leaves[0], create_graph=True)[0]
    with pytest.raises(RuntimeError):
        first.sum().backward()


def test_tensors_without_values_get_shapes(leaves):
    with torch._subclasses.FakeTensorMode() as mode:
        fakes = [mode.from_tensor(x) for x in leaves]
        images = drawn(fakes)
    assert [tuple(x.shape) for x in images] == [(20, 37, 3), *[(20, 37)] * 3, (20, 37, 3), (20, 37)]
