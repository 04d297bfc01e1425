"""The multi-view terms by block code, which float32 takes on the CPU, too: torch's in float64, in any order."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from room2dgs.kernels.builds import set_order
from room2dgs.splat.types import Rendering
from room2dgs.train.grey import GreyPhoto
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.terms.multiview import GEOMETRIC, PHOTOMETRIC, drawn_slots, multiview_terms
from room2dgs.train.views import View
from tests.oracles import multiview_terms as oracle

W, H = 64, 48
K_R = torch.tensor([[60.0, 0, 33.1], [0, 58.0, 22.7], [0, 0, 1]], dtype=torch.float64)
K_N = torch.tensor([[57.0, 0, 30.2], [0, 61.0, 25.3], [0, 0, 1]], dtype=torch.float64)
NORMAL = torch.tensor([0.3, -0.2, -1.0], dtype=torch.float64) / np.sqrt(1.13)  # of the wall, in the world
BOTH = [GEOMETRIC, PHOTOMETRIC]


@pytest.fixture(autouse=True)
def as_before():
    dtype = torch.get_default_dtype()
    yield
    torch.set_default_dtype(dtype)
    set_order(0)


def pose(x: float, angle: float) -> torch.Tensor:
    world = torch.eye(4, dtype=torch.float64)
    c, s = np.cos(angle), np.sin(angle)
    world[:3, :3] = torch.tensor([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    world[:3, 3] = -world[:3, :3] @ torch.tensor([x, 0.1, 0], dtype=torch.float64)
    return world


def wall(cam_from_world: torch.Tensor, K: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """(H, W) depth and brightness of a patterned wall."""
    rotation, translation = cam_from_world[:3, :3], cam_from_world[:3, 3]
    y, x = torch.meshgrid(torch.arange(H) + 0.5, torch.arange(W) + 0.5, indexing="ij")
    rays = torch.stack([x, y, torch.ones_like(x)], -1).double() @ torch.linalg.inv(K).T
    normal = rotation @ NORMAL
    depth = (2 * NORMAL[2] + normal @ translation) / (rays @ normal)
    X, Y, _ = ((rays * depth[..., None] - translation) @ rotation).unbind(-1)
    return depth, 0.5 + 0.2 * torch.sin(9 * X + 4 * Y) + 0.15 * torch.cos(11 * Y - 3 * X)


def case(name: str, dtype=torch.float64):
    """A rendering of the wall with errors, its view, and a neighbour."""
    g = torch.Generator().manual_seed(3)
    draw = lambda *shape: torch.randn(*shape, generator=g, dtype=torch.float64)  # noqa: E731
    place, other_place = pose(0.0, 0.02), pose(0.25, -0.03)
    depth, grey = wall(place, K_R)
    other_depth, other_grey = wall(other_place, K_N)
    normal = 0.8 * NORMAL + 0.05 * draw(H, W, 3)
    alpha = torch.where(draw(H, W) > -1.5, 0.9, 0.3)
    textured = torch.zeros(H, W, dtype=torch.bool)
    textured[5:-5, 5:-5] = draw(H - 10, W - 10) > -1
    mask = None
    depth = depth * (1 + 0.004 * draw(H, W))
    inverse = (1 / other_depth)[::2, ::2].clone()
    if name == "hidden":
        inverse[:, 20:] = 1 / 1.2  # a board before the wall
        inverse[:6] = 0
    elif name == "masked":
        mask = torch.ones(H, W, dtype=torch.bool)
        mask[20:30, 25:40] = False
    elif name == "edge-on and behind":
        normal[:, :30] = torch.tensor([1.0, 0.02, 0.02], dtype=torch.float64)
        depth[:10] = 1e-3
        normal[:, 40:45] = 0
    elif name == "flat":
        other_grey = torch.full_like(other_grey, 0.25)
    elif name == "nothing":
        alpha = torch.zeros_like(alpha)
    elif name == "few":
        textured[:] = False
        textured[20, 30:34] = True
    to = lambda x: x.to(dtype).contiguous()  # noqa: E731
    view = View("a", None, to(K_R), to(place), W, H)
    neighbour = View("b", None, to(K_N), to(other_place), W, H, mask=mask)
    photos = [GreyPhoto(to(values), textured) for values in (grey, other_grey)]
    pair = Pair(photos[0], neighbour, photos[1], to(inverse), 11)
    drawn = Rendering(None, to(alpha), to(depth), None, to(normal), None)
    return drawn, view, pair


CONFIG = SimpleNamespace(samples=300, patch=7)


def found(drawn, view, pair, names=BOTH, config=CONFIG):
    """Values and the gradients of their weighted sum."""
    torch.set_default_dtype(drawn.depth.dtype)
    leaves = [x.clone().requires_grad_() for x in (drawn.depth, drawn.normal)]
    terms_of = multiview_terms if drawn.depth.dtype == torch.float32 else oracle.multiview_terms
    terms = terms_of(drawn._replace(depth=leaves[0], normal=leaves[1]), view, pair, config, names)
    total = sum((1 + k) * value for k, value in enumerate(terms.values()))
    gradients = torch.autograd.grad(total, leaves, allow_unused=True, materialize_grads=True)
    return [*(value.detach() for value in terms.values()), *gradients]


CASES = ["plain", "hidden", "masked", "edge-on and behind", "flat", "nothing", "few"]


@pytest.mark.parametrize("names", [BOTH, BOTH[:1], BOTH[1:]], ids=["both", "geometric", "photometric"])
@pytest.mark.parametrize("name", CASES)
def test_they_equal_torchs_terms(name, names):
    single = case(name, torch.float32)
    mine = found(*single, names)
    for a, b in zip(mine, found(*case(name), names), strict=True):
        # a pixel's error has float32's digits of its place in the picture
        torch.testing.assert_close(a.double(), b, rtol=1e-3, atol=1e-3 * float(b.abs().max()) + 5e-7)
    assert (mine[0] > 0) == (name != "nothing")
    if name not in ("nothing", "flat"):
        assert mine[len(names)].abs().max() > 0
    for order in (1, 12345):
        set_order(order)
        again = found(*single, names)
        assert all(torch.equal(a, b) for a, b in zip(again, mine, strict=True))


@pytest.mark.parametrize("patch", [1, 3, 11])
def test_patches_of_other_sizes(patch):
    config = SimpleNamespace(samples=40, patch=patch)
    mine, theirs = (found(*case("plain", dtype), BOTH, config) for dtype in (torch.float32, torch.float64))
    for a, b in zip(mine, theirs, strict=True):
        torch.testing.assert_close(a.double(), b, rtol=1e-3, atol=1e-3 * float(b.abs().max()) + 5e-7)


@pytest.mark.parametrize("name", CASES)
def test_the_same_pixels_are_drawn_without_counting_them(name):
    drawn, _, pair = case(name, torch.float32)
    column, row = oracle.drawn_pixels(drawn, pair, 300)
    slots = drawn_slots(drawn, pair, 300)
    assert slots.dtype == torch.int32 and len(slots) == 300
    assert slots[: len(row)].tolist() == (row * W + column).tolist() and (slots[len(row) :] == -1).all()
