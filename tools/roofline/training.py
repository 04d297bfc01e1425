"""Work of the kernels of training, stereo and fusion, counted by hand in their sources as the rest of `ours` is."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import torch

from room2dgs.bench.raster_scene import ROOM_M, inside_view
from room2dgs.kernels.builds import PLAIN
from room2dgs.mesh.device_volume import touched
from room2dgs.mesh.tsdf import STRIDE
from room2dgs.mesh.voxel_table import VOXELS
from room2dgs.report.table import Table, table
from room2dgs.tools.roofline.cost import Cost, Kernel, expected, total
from room2dgs.tools.roofline.devices import DEVICES
from room2dgs.tools.roofline.ours import DIVIDE, DOUBLE_DIVIDE, POWER, ROOT

FRAME = (26 / 16) ** 2  # pixels read for one of a patch with the window's reach about it
COLUMNS = 26 / 16  # likewise, filtered in one direction
RING = (18 / 16) ** 2
NUMBERS = 14  # that a surfel learns: offset, rotation, scales, opacity, colour, one SH coefficient
VOXEL_M, TRUNCATION_VOXELS = 0.01, 5.0


class Counts(NamedTuple):
    """Of one iteration, of one stereo sweep, and of one view's fusion.

    Attributes:
        pixels: of the photo; compared: of them those with prior maps.
        sample_warps: drawn pixels of the multi-view terms, a warp each.
        numbers: learnt ones.
        windows: (pixel, plane, view) triples of a first sweep: 12 planes, 6 views.
        followed: pixels whose rays say which blocks of voxels the view touches.
        voxels: of these blocks.
    """

    pixels: float
    compared: float
    sample_warps: float
    numbers: float
    windows: float
    followed: float
    voxels: float


def counts(width: int = 640, height: int = 480, surfels: int = 500_000, samples: int = 1024) -> Counts:
    """At the default settings."""
    pixels = width * height
    followed = (width // STRIDE) * (height // STRIDE)
    voxels = touched_voxels(width, height)
    return Counts(pixels, pixels / 4, samples, NUMBERS * surfels, 12 * 6 * pixels, followed, voxels)


def touched_voxels(width: int, height: int) -> int:
    """Voxels of the blocks that a view of the box room touches, at the default voxel of 1 cm and 5 of truncation."""
    K, cam_from_world = (matrix.double() for matrix in inside_view(width, height))
    world_from_cam = torch.linalg.inv(cam_from_world)
    y, x = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    rays = torch.stack([x, y, torch.ones_like(x)], -1).double() @ (world_from_cam[:3, :3] @ torch.linalg.inv(K)).T
    room = torch.tensor(ROOM_M, dtype=torch.float64)
    depth, wall = ((torch.where(rays > 0, room, 0.0) - world_from_cam[:3, 3]) / rays).min(-1)
    normal = -torch.nn.functional.one_hot(wall, 3) * rays.sign()
    at = (K.numpy(), cam_from_world.numpy(), VOXEL_M, TRUNCATION_VOXELS * VOXEL_M)
    keys = touched(depth.float(), normal.float(), *at, PLAIN)
    return len(keys) * VOXELS


def kernels() -> list[Kernel]:
    """Values and gradients of every term, torch's Adam, a sweep of PatchMatch over both colours, and fusion."""
    window = 25
    return [
        Kernel(
            "L1 with D-SSIM", True,
            # three channels: 11 taps of 4 moments down (6 to make them) and along; then 3 maps along and down
            {"pixels": Cost(
                flops=3 * (2 * 11 * 4 * (COLUMNS + 1) + 80 + 2 * 11 * 3 * (COLUMNS + 1)),
                instructions=3 * (11 * 10 * COLUMNS + 4 * 11 + 2 * DIVIDE + 30 + 3 * 11 * COLUMNS + 3 * 11 + 25),
                mufu=3 * 2, mio=3 * (11 * 2 * COLUMNS + 4 * 11 + 2 * FRAME + 3 * 11 * (COLUMNS + 1) + 3 * FRAME),
                dram=24 + 36 + 36 + 24 + 12, l2=24 * (FRAME - 1) + 36 * (FRAME - 1),
            )}, launches=3,
        ),
        Kernel(
            "normal consistency", True,
            {"pixels": Cost(
                flops=150, instructions=RING * (70 + 3 * DIVIDE + 2 * ROOT) + 45, mufu=RING * 5,
                mio=RING * 6 + 8 + 13, dram=4 + 4 + 12 + 16,
            )}, launches=2,
        ),
        Kernel(
            "depth prior", True,
            # each pixel, and its neighbours at four strides: 2 2/3 for the sums, 5 1/3 for the gradient
            {"compared": Cost(
                flops=120, instructions=15 + 2.7 * 12 + 15 * 3 + 5.3 * 25 + 30, fp64=12 + 17 * 2, mio=2 * 21,
                dram=2 * 17 + 4, l2=8 * 17,
            )}, launches=4,
        ),
        Kernel(
            "multi-view terms", True,
            # cameras and round trip, the same for all lanes; twice two rounds of a patch of 49
            {"sample_warps": Cost(
                flops=400, instructions=300 + 4 * 100 + 8 * 6, mufu=20 + 4 * 2, mio=40 + 4 * 5 + 8, l2=2 * 49 * 16,
                dram=49 * 8 + 64,
            )}, launches=2,
        ),
        Kernel(
            "Adam", True,
            {"numbers": Cost(flops=14, instructions=14 + DIVIDE + ROOT, mufu=2, dram=28)}, launches=6,
        ),
        Kernel(
            "PatchMatch, a first sweep", False,
            # a window: where the view sees it, then samples in fixed point of one word each; the pixel's weights lie in
            # local memory. What makes them is done once for 72 windows.
            {"windows": Cost(
                flops=60 + 14 * window, instructions=75 + 24 * window + 2 * DIVIDE + ROOT + window * (POWER + 9) / 72,
                mufu=3, mio=14 + 3 * window, l2=64,
            )}, launches=2,
        ),
        Kernel(
            "fusion: blocks touched", False,
            # four points of a line: three divisions and numbers of cells each; what sorts their keys is torch's
            {"followed": Cost(
                flops=26 + 4 * 3 * 5, instructions=40 + 2 * DIVIDE + 4 * (3 * (15 + DIVIDE) + 6), mufu=14,
                dram=8 + 24 + 32,
            )}, launches=1,
        ),
        Kernel(
            "fusion: depth taken in", False,
            # where the voxel is seen and how far it is from the pixel's plane, in double; its six numbers read and
            # written, the pixel's eight from the cache
            {"voxels": Cost(
                flops=24 + 20 + 34, instructions=115 + 2 * DOUBLE_DIVIDE + 2 * DIVIDE,
                fp64=60 + 2 * DOUBLE_DIVIDE, mufu=4, dram=2 * 24, l2=32,
            )}, launches=1,
        ),
    ]  # fmt: skip


def training_table() -> Table:
    """Work and expected time of each at 640x480 with 500 k surfels."""
    of_one = counts()
    columns = {
        "kernel": lambda k: k.name,
        "Gflop": lambda k: f"{total(k, of_one).flops / 1e9:.2f}",
        "M warp instructions": lambda k: f"{total(k, of_one).instructions / 1e6:.1f}",
        "MB memory": lambda k: f"{total(k, of_one).dram / 1e6:.0f}",
    }
    for device in DEVICES:
        columns[device.name] = partial(lambda device, k: _time(k, of_one, device), device)
    return table("Kernels of training, stereo and fusion at 640x480, 500 k surfels", columns, kernels())


def _time(kernel: Kernel, of_one: Counts, device) -> str:
    _, likely, binding = expected(kernel, of_one, device)
    return f"{1e3 * likely:.3f} ms, {binding}"
