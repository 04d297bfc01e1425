"""What the rasterizer's doors are given: pictures, or a sentence."""

from __future__ import annotations

import pytest
import torch

from room2dgs.splat import rasterization, render, render_gaussians
from room2dgs.splat.contribution import contributions, least_needed
from room2dgs.splat.footprint import footprint
from room2dgs.splat.gaussians.reference import render as plain_gaussians
from room2dgs.splat.gsplat_2dgs import rasterization_2dgs
from room2dgs.splat.reference import render as plain
from room2dgs.splat.types import Gaussians, Surfels

DRAWN = torch.Generator().manual_seed(0)
N = 12


def some(*shape: int) -> torch.Tensor:
    return torch.rand(*shape, generator=DRAWN)


DISCS = {
    "centers": torch.cat([some(N, 2) - 0.5, some(N, 1) + 1.5], dim=1),
    "rotations": some(N, 4) - 0.5,
    "scales": some(N, 2) * 0.1 + 0.02,
    "opacities": some(N) * 0.8 + 0.1,
    "sh": some(N, 4, 3) - 0.3,
}
VIEW = {
    "K": torch.tensor([[30.0, 0, 16], [0, 30, 12], [0, 0, 1]]),
    "cam_from_world": torch.eye(4),
    "width": 32,
    "height": 24,
    "near_m": 0.05,
}
MORE = {"background": some(3), "center_px": torch.zeros(N, 2), "opacity_floor": 1 / 255}


def taken(given: dict, kind=Surfels) -> tuple:
    given = dict(given)
    return kind(*(given.pop(name) for name in kind._fields)), given


def drawn(draw, kind=Surfels):
    def run(**given):
        splats, options = taken(given, kind)
        return tuple(draw(splats, **options))

    return run


def counted(**given):
    surfels, view = taken(given)
    return contributions(surfels, [(view["K"], view["cam_from_world"], view["width"], view["height"])], view["near_m"])


RASTERIZED = {
    "means": DISCS["centers"], "quats": DISCS["rotations"], "scales": DISCS["scales"], "opacities": DISCS["opacities"],
    "colors": some(N, 3), "viewmats": VIEW["cam_from_world"][None], "Ks": VIEW["K"][None], "width": 32, "height": 24,
    "near_plane": 0.01, "far_plane": 100.0, "backgrounds": some(1, 3), "render_mode": "RGB+ED",
}  # fmt: skip
ELLIPSOIDS = {**DISCS, "scales": some(N, 3) * 0.1 + 0.02}
DOORS = {
    "render": (drawn(render), {**DISCS, **VIEW, **MORE}),
    "the plain renderer": (drawn(plain), {**DISCS, **VIEW, **MORE}),
    "contributions": (counted, {**DISCS, **VIEW}),
    "footprint": (drawn(footprint), {**DISCS, **VIEW, "far_m": 10.0}),
    "rasterization_2dgs": (lambda **given: rasterization_2dgs(**given)[:6], RASTERIZED),
    "render_gaussians": (
        drawn(render_gaussians, Gaussians),
        {**ELLIPSOIDS, **VIEW, **MORE},
    ),
    "the plain renderer of Gaussians": (drawn(plain_gaussians, Gaussians), {**ELLIPSOIDS, **VIEW, **MORE}),
    "rasterization": (
        lambda **given: rasterization(**given)[:2],
        {**RASTERIZED, "scales": ELLIPSOIDS["scales"], "radius_clip": 0.0, "eps2d": 0.3},
    ),
    "least_needed": (least_needed, {"contributions": some(N), "share": 0.1}),
}
TENSORS = [
    (door, name) for door, (_, given) in DOORS.items() for name in given if isinstance(given[name], torch.Tensor)
]
NUMBERS = [pair for pair in ((door, name) for door, (_, given) in DOORS.items() for name in given)
           if pair not in TENSORS]  # fmt: skip


def run(door: str, **changed):
    function, given = DOORS[door]
    return function(**{**given, **changed})


def equal(a, b) -> bool:
    a, b = (x if isinstance(x, tuple) else (x,) for x in (a, b))
    return all(torch.equal(one, other) for one, other in zip(a, b, strict=True))


@pytest.mark.parametrize(("door", "name"), TENSORS)
def test_what_is_no_such_tensor_is_refused(door, name):
    good = DOORS[door][1][name]
    odd = [good.tolist(), good.numpy(), "x", 3, good.to(torch.complex64), (good * 9).byte(), (good * 9).long(),
           good > 0.5, torch.empty_like(good, device="meta"), good[None, None], good.new_zeros(())]  # fmt: skip
    odd += [] if name == "contributions" else [good[:0], good[:-1], good[..., :-1]]
    if name == "centers" and door == "contributions":
        odd = [value for value in odd if not (isinstance(value, torch.Tensor) and value.shape == (0, 3))]
    for value in odd:
        with pytest.raises((TypeError, ValueError, NotImplementedError)):
            run(door, **{name: value})


@pytest.mark.parametrize(("door", "name"), TENSORS)
def test_strides_do_not_count(door, name):
    good = DOORS[door][1][name]
    assert equal(run(door, **{name: torch.stack([good, good], dim=-1)[..., 0]}), run(door))


@pytest.mark.parametrize(("door", "name"), NUMBERS)
@pytest.mark.parametrize("value", [float("nan"), "3", None, [1], torch.zeros(3)], ids=str)
def test_numbers_are_asked_for(door, name, value):
    with pytest.raises((TypeError, ValueError)):
        run(door, **{name: value})


@pytest.mark.parametrize("door", [door for door, (_, given) in DOORS.items() if "width" in given])
@pytest.mark.parametrize("side", [0, -1, 10**9, 3.5, True, torch.tensor(32)])
def test_a_picture_without_a_size_is_refused(door, side):
    for name in ("width", "height"):
        with pytest.raises((TypeError, ValueError)):
            run(door, **{name: side})


@pytest.mark.parametrize("value", [0.0, 1.5, float("nan"), "3", [1], torch.zeros(3)], ids=str)
def test_the_filter_of_gaussians_is_a_small_variance(value):
    for door, name in (("render_gaussians", "filter_px2"), ("rasterization", "eps2d")):
        with pytest.raises((TypeError, ValueError), match=name):
            run(door, **{name: value})


@pytest.mark.parametrize(
    ("door", "name"),
    [
        *((door, name) for door in ("render", "render_gaussians") for name in ("with_normal", "with_distortion")),
        ("render_gaussians", "antialias"),
    ],
)
def test_switches_are_switches(door, name):
    for value in (None, "no", torch.zeros(3), 0.5):
        with pytest.raises(TypeError, match=name):
            run(door, **{name: value})


def test_surfels_with_nan_are_as_documented():
    """Not drawn, and NaN among the coefficients is black; neither reaches other surfels."""
    for name in ("centers", "rotations", "scales", "opacities"):
        given = DISCS[name].clone()
        given[4] = float("nan")
        without = {
            key: torch.cat([value[:4], value[5:]]) for key, value in {**DISCS, "center_px": MORE["center_px"]}.items()
        }
        assert equal(run("render", **{name: given}), run("render", **without))
    sh, black = DISCS["sh"].clone(), DISCS["sh"].clone()
    sh[4], black[4] = float("nan"), 0.0
    black[4, 0] = -10.0
    assert equal(run("render", sh=sh), run("render", sh=black))
