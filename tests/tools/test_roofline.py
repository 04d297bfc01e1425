"""What the roofline counts is what happens: hits, boxes and operations with answers known by other means."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch

from room2dgs import _C
from room2dgs.bench.raster_scene import box_surfels, inside_view
from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.splat import Surfels, reference
from room2dgs.splat.constants import OPACITY_FLOOR
from room2dgs.tools.roofline import training
from room2dgs.tools.roofline.__main__ import main
from room2dgs.tools.roofline.cost import Cost, Kernel, expected, seconds, total
from room2dgs.tools.roofline.devices import DEVICES
from room2dgs.tools.roofline.scene import Counts, boxes, measured

W, H = 53, 40


@pytest.fixture(scope="module")
def room():
    surfels = box_surfels(3000, 4)
    return surfels, *inside_view(W, H)


def work_of(surfels, K, pose, every=1):
    images = [torch.empty(H, W, *tail) for tail in ((3,), (), (), (), (3,))]
    frame = _C.RasterFrame()
    frame.forward(*surfels, pose.double(), K.double(), W, H, 0.2, OPACITY_FLOOR, torch.zeros(3), *images, None)
    work = np.empty((12, 11))
    _C.bench.tile_work(frame, every, work)
    return frame, work


def hits(surfels, K, pose):
    """(N, H, W) the float64 opacity of each surfel at each pixel, whether or not light reaches it."""
    p = reference.project(Surfels(*(x.double() for x in surfels)), K.double(), pose.double(), 0.2)
    y, x = torch.meshgrid(torch.arange(H) + 0.5, torch.arange(W) + 0.5, indexing="ij")
    delta = torch.stack([x, y], -1).double() - p.center_px[:, None, None]
    den = 1 + (p.b[:, None, None] * delta).sum(-1)
    u, v = ((a[:, None, None] * delta).sum(-1) / den for a in (p.a_u, p.a_v))
    rho = 2 * delta.square().sum(-1)
    plane = p.plane[:, None, None] & (den > 1e-6) & (0.2 * den <= p.depth[:, None, None])
    rho = torch.where(plane, rho.minimum(u * u + v * v), rho)
    return torch.where(p.visible[:, None, None], p.opacity[:, None, None] * torch.exp(-rho / 2), 0.0), p.depth


def test_blended_pairs_and_walks_are_those_of_the_reference(room):
    surfels, K, pose = room
    surfels = Surfels(*(x[:1000] for x in surfels))
    surfels = surfels._replace(scales=surfels.scales * 1.5)
    _, work = work_of(surfels, K, pose)
    assert (work[:, 4] < work[:, 3]).any()
    raw, depth = hits(surfels, K, pose)
    near = ((raw - 1 / 255).abs() < 1e-6).sum()
    order = depth.argsort()
    alpha = torch.where(raw >= 1 / 255, raw.clamp_max(0.99), 0.0)[order]
    before = torch.cat([torch.ones_like(alpha[:1]), torch.cumprod(1 - alpha, 0)[:-1]])
    blended = (alpha > 0) & (before >= 1e-4)
    assert abs(work[:, 6].sum() - blended.sum().item()) <= near + 5
    whole = torch.nn.functional.pad(blended, (0, 64 - W, 0, 48 - H))
    assert abs(work[:, 7].sum() - whole.reshape(-1, 24, 2, 4, 16).any(2).any(-1).sum().item()) <= near + 5
    assert abs(work[:, 10].sum() - whole.reshape(-1, 12, 4, 8, 8).any(2).any(-1).sum().item()) <= near + 5
    # a warp walks at least over what it blends, and at most over the list
    for less, more in ((7, 4), (4, 3), (10, 9), (9, 8)):
        assert (work[:, less] <= work[:, more]).all()
    assert (work[:, 3] <= 8 * work[:, 0]).all() and (work[:, 8] <= 8 * work[:, 1]).all()


def test_a_dark_tile_ends_its_walk_and_a_light_one_does_not(room):
    surfels, K, pose = room
    dense = surfels._replace(opacities=torch.full_like(surfels.opacities, 0.9), scales=surfels.scales * 2)
    thin = surfels._replace(opacities=torch.full_like(surfels.opacities, 0.02))
    (_, opaque), (_, light) = work_of(dense, K, pose), work_of(thin, K, pose)
    assert (opaque[:, 1] < opaque[:, 0]).any()
    assert (light[:, 1] == light[:, 0]).all() and (light[:, 5] == 1e30).all()


def test_every_nth_tile_stands_for_all(room):
    ours, theirs = measured(*room, W, H)
    _, work = work_of(*room)
    assert ours.entries == work[:, 0].sum() and ours.forward_entries == work[:, 1].sum()
    for found, column in zip((ours.kept, ours.forward_warps, ours.kept_warps), (6, 8, 10), strict=True):
        assert found == pytest.approx(work[:, column].sum(), rel=0.35)  # from 3 of 12 tiles
    assert theirs.entries > ours.entries and theirs.forward_warps > ours.forward_warps


def test_boxes_hold_the_discs_outlines(room):
    surfels, K, pose = room
    # by points of the circle of one standard deviation, three times as far from their middle
    turn = torch.linspace(0, 2 * torch.pi, 721, dtype=torch.float64)
    axes = rotation_matrices(surfels.rotations.double())[:, :, :2] * surfels.scales.double()[:, None]
    points = surfels.centers.double()[:, None] + torch.stack([turn.cos(), turn.sin()], -1) @ axes.transpose(1, 2)
    camera = points @ pose[:3, :3].double().T + pose[:3, 3].double()
    ahead = (surfels.centers.double() @ pose[:3, :3].double().T + pose[:3, 3].double())[:, 2] >= 0.2
    pixels = (camera @ K.double().T)[..., :2] / camera[..., 2:]
    low, high = pixels.amin(1), pixels.amax(1)
    middle, half = (low + high) / 2, (1.5 * (high - low).clamp_min(2e-2)).ceil()
    size = torch.tensor([4.0, 3.0], dtype=torch.float64)
    first, end = ((middle - half) / 16).floor().clamp_min(0), ((middle + half) / 16).ceil().minimum(size)
    whole = (camera[..., 2] > 0.01).all(1)
    assert (ahead & ~whole).sum() < 10
    tiles = (end - first).clamp_min(0).prod(-1)[ahead & whole]
    listed, _, seen = boxes(Surfels(*(x[whole] for x in surfels)), K, pose, W, H)
    assert listed.sum() == pytest.approx(tiles.sum().item(), rel=2e-3)
    assert seen == pytest.approx((tiles > 0).sum().item(), abs=3)


def test_operations_are_counted_in_the_source():
    counted = _C.bench.operations(1)
    # intersect: a line for each in pixel.h, the two squares of rho's and of the filter's terms among them
    assert counted["intersect"] == {
        "fma": 6, "add": 0, "multiply": 5, "divide": 1, "root": 0, "power": 1, "other": 5,
    }  # fmt: skip
    more = _C.bench.operations(16)
    assert more["project"] == counted["project"] and more["color"]["multiply"] > 100 > counted["color"]["multiply"]


def test_the_slowest_resource_is_the_bound():
    counts = Counts(*[0.0] * len(Counts._fields))._replace(surfels=3.2e6, kept_warps=1e6)
    device = DEVICES[0]
    clocks = device.sms * device.clock_hz
    # a thread's instruction is a 32nd of a warp's
    arithmetic = Kernel("x", False, {"surfels": Cost(instructions=40), "kept_warps": Cost(instructions=4)})
    assert total(arithmetic, counts).instructions == pytest.approx(8e6)
    assert seconds(arithmetic, counts, device)["instructions"] == pytest.approx(8e6 / (4 * clocks))
    memory = Kernel("y", False, {"surfels": Cost(instructions=1, dram=1000)})
    bound, likely, name = expected(memory, counts, device)
    assert name == "memory" and bound == pytest.approx(3.2e9 / 3.35e12) and likely > bound


@pytest.mark.slow
def test_the_command_prints_and_writes(tmp_path, capsys):
    assert main(["--quick", "--json", str(tmp_path / "r.json"), "--markdown", str(tmp_path / "r.md")]) == 0
    printed = capsys.readouterr().out
    assert "gsplat / ours" in printed and "RTX 4090" in printed
    row = json.loads((tmp_path / "r.json").read_text())["cases"][0]
    assert row["ours"]["counts"]["surfels"] == 100_000
    assert "| ours: blend" in (tmp_path / "r.md").read_text()


def test_kernels_of_training_by_hand():
    """A copy's bytes are memory's alone; and twice the pixels are twice the work of all but what no pixel decides."""
    by_name = {kernel.name: kernel for kernel in training.kernels()}
    one, two = training.counts(320, 240), training.counts(640, 240)
    work = {name: (total(kernel, one), total(kernel, two)) for name, kernel in by_name.items()}
    assert work["Adam"][0].dram == 28 * 14 * 500_000 and work["Adam"][0] == work["Adam"][1]
    for name in ("L1 with D-SSIM", "depth prior", "PatchMatch, a first sweep"):
        assert work[name][1].instructions == pytest.approx(2 * work[name][0].instructions)
    assert expected(by_name["Adam"], one, DEVICES[0])[2] == "memory"
    # walls in blocks of 8 cm, two or three thick
    blocks = one.voxels / 512
    assert work["fusion: depth taken in"][0].dram == 48 * one.voxels and 4000 < blocks < 12000
