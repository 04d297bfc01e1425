"""Work of the kernels of training and stereo, counted by hand in their sources as the rest of `ours` is."""

from __future__ import annotations

from typing import NamedTuple

from room2dgs.bench.roofline.cost import Cost, Kernel, expected, total
from room2dgs.bench.roofline.devices import DEVICES
from room2dgs.bench.roofline.ours import DIVIDE, POWER, ROOT
from room2dgs.report.table import Table, table

FRAME = (26 / 16) ** 2  # pixels read for one of a patch with the window's reach about it
COLUMNS = 26 / 16  # likewise, filtered in one direction
RING = (18 / 16) ** 2
NUMBERS = 14  # that a surfel learns: offset, rotation, scales, opacity, colour, one SH coefficient


class Counts(NamedTuple):
    """Of one iteration, and of one stereo sweep.

    Attributes:
        pixels: of the photo; compared: of them those with prior maps.
        sample_warps: drawn pixels of the multi-view terms, a warp each.
        numbers: learnt ones.
        windows: (pixel, plane, view) triples of a first sweep: 12 planes, 6 views.
    """

    pixels: float
    compared: float
    sample_warps: float
    numbers: float
    windows: float


def counts(width: int = 640, height: int = 480, surfels: int = 500_000, samples: int = 1024) -> Counts:
    """At the default settings."""
    pixels = width * height
    return Counts(pixels, pixels / 4, samples, NUMBERS * surfels, 12 * 6 * pixels)


def kernels() -> list[Kernel]:
    """Values and gradients of every term, Adam (all rows), and a sweep of PatchMatch over both colours."""
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
        columns[device.name] = lambda k, device=device: _time(k, of_one, device)
    return table("Kernels of training and stereo at 640x480, 500 k surfels", columns, kernels())


def _time(kernel: Kernel, of_one: Counts, device) -> str:
    _, likely, binding = expected(kernel, of_one, device)
    return f"{1e3 * likely:.3f} ms, {binding}"
