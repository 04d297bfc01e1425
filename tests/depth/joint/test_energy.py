"""The compiled gradient of the joint depth optimisation, and Adam."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from room2dgs import _C
from room2dgs.depth.joint import draws, optimise
from room2dgs.depth.joint.energy import Energy, Weights
from room2dgs.depth.joint.overlap import Overlap, overlap
from room2dgs.depth.joint.reference import energy, in_float64
from room2dgs.splat import set_threads

AXES = torch.eye(3)[[2, 0, 1]]  # the box room's, up first


@pytest.fixture(scope="module")
def views(box_room, tmp_path_factory) -> Overlap:
    """A box room of blank walls with a textured floor, its depth off by waves: every term has residuals, none is 0."""
    return seen(box_room(count=8, turn=0.3), tmp_path_factory.mktemp("photos"), wave=0.05)


def seen(room, folder, wave: float) -> Overlap:
    random = np.random.default_rng(3)
    frames, depths, normals, confidence = [], {}, {}, {}
    for frame, depth, normal in zip(room.frames, room.depths, room.normals, strict=True):
        photo = np.full((*depth.shape, 3), 90, np.uint8)
        photo[-15:] = random.integers(0, 255, photo[-15:].shape)
        path = folder / f"{frame.name}.png"
        cv2.imwrite(str(path), photo)
        frames.append(replace(frame, color_path=path))
        y, x = np.mgrid[: depth.shape[0], : depth.shape[1]] / 60
        depths[frame.name] = (depth * np.exp(wave * np.sin(3 * x + len(frames)) * np.cos(2 * y))).astype(np.float32)
        depths[frame.name][10:14, 20:30] = 0
        normals[frame.name] = (normal @ frame.camera.cam_from_world[:3, :3]).astype(np.float32)
        confidence[frame.name] = random.random(depth.shape, np.float32)
    return overlap(frames, depths, normals, room.points, confidence, confidence)


def rough(views: Overlap, rows: int, columns: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """A grid that is not smooth, a stiffness, and draws of 3001 samples: no whole number of vectors."""
    random = torch.Generator().manual_seed(1)
    grid = 0.03 * torch.randn(len(views), rows, columns, generator=random)
    return grid, 0.1 + torch.rand(grid.shape, generator=random), draws.drawn(views, 3001, random, axes=True)


def weights(only: int | None = None, regular: bool = True) -> Weights:
    """Those of the last stage; of one term alone."""
    found = optimise.weights_of(optimise.STAGES[-1])
    terms = found.terms if only is None else found.terms * (torch.arange(5) == only)
    return found._replace(terms=terms, smoothness=regular * found.smoothness, magnitude=regular * found.magnitude)


@pytest.mark.parametrize("shape", [(3, 4), (24, 32), (2, 2), (5, 13)])
@pytest.mark.parametrize("term", [None, *range(5)])
def test_energy_and_gradient_are_those_of_the_float64_reference(views, term, shape):
    """Each term by itself, so that none hides behind another; None: the regularisers alone."""
    grid, stiffness, some = rough(views, *shape)
    of_term = weights(-1 if term is None else term, regular=term is None)
    found = torch.full_like(grid, torch.nan)
    value = Energy(views, of_term, stiffness, AXES).gradient(grid, some, found)

    leaf = grid.double().requires_grad_()
    expected = energy(in_float64(views), leaf, some, of_term, stiffness.double(), AXES.double())
    expected.backward()
    assert value == pytest.approx(float(expected.detach()), rel=1e-5) and value > 0
    size = float(leaf.grad.abs().max())
    assert size > 0
    np.testing.assert_allclose(found.numpy(), leaf.grad.numpy(), atol=2e-5 * size)


def slopes(views: Overlap, of: Weights, grid: torch.Tensor, size: float) -> tuple[float, float]:
    """The energy's slope along its gradient: as the gradient has it, and by finite differences."""
    _, stiffness, some = rough(views, *grid.shape[1:])
    of_term = Energy(views, of, stiffness, AXES)
    gradient, unused = torch.empty_like(grid), torch.empty_like(grid)
    of_term.gradient(grid, some, gradient)
    along = gradient / gradient.norm()
    up, down = (of_term.gradient(grid + sign * size * along, some, unused) for sign in (1, -1))
    return float(gradient.norm()), (up - down) / (2 * size)


@pytest.mark.parametrize("term", [0, 2, 3, None])
def test_the_gradient_is_what_finite_differences_of_the_energy_say(views, term):
    of_term = weights(-1 if term is None else term, regular=term is None)
    exact, found = slopes(views, of_term, rough(views, 6, 8)[0], 0.01)
    assert found == pytest.approx(exact, rel=0.02)


def test_so_it_is_for_walls_that_all_face_an_axis(box_room, tmp_path):
    """Where others came to face one, the energy would jump."""
    views = seen(box_room(count=8, turn=0.3), tmp_path, wave=0.0)
    exact, found = slopes(views, weights(4, regular=False), 0.1 * rough(views, 6, 8)[0], 1e-3)
    assert found == pytest.approx(exact, rel=0.02)


def test_so_it_is_between_views_of_depth_that_the_warp_does_not_change(views):
    """What the other view's map says where a sample comes to lie counts as constant: here it is."""
    cameras = views.cameras._replace(
        rotation=torch.eye(3).expand(len(views), 3, 3).contiguous(),
        translation=torch.tensor([[0.1 * k, -0.03 * k, 0.02] for k in range(len(views))]),
    )
    sure = torch.ones_like(views.depth_confidence)
    flat = replace(views, depth=torch.full_like(views.depth, 2.0), depth_confidence=sure, cameras=cameras)
    exact, found = slopes(flat, weights(1, regular=False), rough(flat, 4, 5)[0], 2e-3)
    assert found == pytest.approx(exact, rel=0.05)


def test_a_solved_grid_is_the_one_that_torch_finds_on_any_number_of_threads(views):
    stage = optimise.STAGES[-1]._replace(rows=6, columns=8, steps=15)
    start = torch.zeros(len(views), stage.rows, stage.columns)
    found = []
    try:
        for threads in (1, 2, 3):
            set_threads(threads)
            found.append(optimise._solved(views, start, stage, AXES))
    finally:
        set_threads()
    assert torch.equal(found[0], found[1]) and torch.equal(found[0], found[2])

    leaf = start.double().requires_grad_()
    adam = torch.optim.Adam([leaf], lr=stage.rate)
    random, wide = torch.Generator().manual_seed(0), in_float64(views)
    stiffness = optimise._stiffness(views, stage).double()
    for step in range(stage.steps):
        adam.param_groups[0]["lr"] = stage.rate * optimise.LAST_RATE ** (step / stage.steps)
        adam.zero_grad()
        some = draws.drawn(views, optimise.SAMPLES[0], random, axes=True)
        energy(wide, leaf, some, weights(), stiffness, AXES.double()).backward()
        adam.step()
    assert leaf.detach().abs().max() > 0.02
    np.testing.assert_allclose(found[0].numpy(), leaf.detach().numpy(), atol=2e-4)


def test_adam_is_the_usual_one():
    random = torch.Generator().manual_seed(0)
    leaf = torch.randn(10001, generator=random, dtype=torch.float64, requires_grad=True)
    adam = torch.optim.Adam([leaf], lr=0.01)
    values = leaf.detach().float()
    first, second = torch.zeros(10001), torch.zeros(10001)
    for step in range(1, 30):
        gradient = torch.randn(10001, generator=random) * 10 ** float(step % 5 - 2)
        adam.param_groups[0]["lr"] = rate = 0.01 * 0.9**step
        leaf.grad = gradient.double()
        adam.step()
        _C.adam(values, gradient, first, second, rate, step)
    np.testing.assert_allclose(values.numpy(), leaf.detach().numpy(), atol=2e-6)


@pytest.mark.parametrize("row", range(draws.ROWS))
@pytest.mark.parametrize("wrong", [-(2**31), -(2**21), 2**31 - 1])
def test_draws_of_what_is_not_there_are_refused_and_nothing_is_written(views, row, wrong):
    grid, stiffness, some = rough(views, 3, 4)
    some[row, 1234] = wrong
    gradient = torch.full_like(grid, 7.0)
    with pytest.raises(ValueError, match="not there"):
        Energy(views, weights(), stiffness, AXES).gradient(grid, some, gradient)
    assert (gradient == 7.0).all()


def test_maps_with_normals_and_confidences_that_are_not_finite_spoil_no_other(box_room, tmp_path):
    room = box_room(count=3, turn=0.3)
    path = tmp_path / "grey.png"
    cv2.imwrite(str(path), np.full((*room.depths[0].shape, 3), 90, np.uint8))
    frames = [replace(frame, color_path=path) for frame in room.frames]
    depths = {frame.name: depth.astype(np.float32) for frame, depth in zip(frames, room.depths, strict=True)}
    nothing = {frames[1].name: np.full(depths[frames[1].name].shape, np.nan, np.float32)}
    normals = {frames[1].name: np.full((*depths[frames[1].name].shape, 3), np.nan, np.float32)}
    found = optimise.joint_depths(frames, depths, normals, room.points, True, nothing, nothing).depths
    assert all(np.isfinite(depth).all() for depth in found.values())
