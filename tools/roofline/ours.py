"""Our kernels' work. What the maths of a surfel and of a hit costs is counted in its source (`_C.bench.operations`)."""

from __future__ import annotations

from room2dgs import _C
from room2dgs.tools.roofline.cost import Cost, Kernel

# instructions of CUDA's correctly rounded float operations, beside the special function unit's one
DIVIDE, ROOT = 7, 6
POWER = 11  # exp2_from: a polynomial, no special function
DOUBLE_DIVIDE, DOUBLE_ROOT = 9, 9
RECORD = 112  # bytes, raster.h
ROWS = 32  # bytes, block_frame.h: the tiles of a surfel's rows
HOT = 4  # 16-byte loads of what every pixel needs of a record
COLD = 2  # of colour and normal
REACH = 16 * 30  # instructions: the columns that a record reaches in each of a tile's rows
SUMS = 19  # of a record's gradient
SHUFFLES = 21  # of 19 sums by halves: 10 + 5 + 3 + 2 + 1


def in_float(operations: dict[str, int], rows: int = 0) -> Cost:
    """Counted operations as instructions; `rows` more that the CPU does once for a row of pixels."""
    o = operations
    plain = o["fma"] + o["add"] + o["multiply"] + o["other"] + rows
    return Cost(
        flops=2 * o["fma"] + o["add"] + o["multiply"] + o["divide"] + o["root"] + rows + 2 * 6 * o["power"],
        instructions=plain + DIVIDE * o["divide"] + ROOT * o["root"] + POWER * o["power"],
        mufu=o["divide"] + o["root"],
    )


def in_double(operations: dict[str, int]) -> Cost:
    """Counted operations of the surfels' maths, which is in double."""
    o = operations
    fp64 = o["fma"] + o["add"] + o["multiply"] + o["other"] + DOUBLE_DIVIDE * o["divide"] + DOUBLE_ROOT * o["root"]
    flops = 2 * o["fma"] + o["add"] + o["multiply"] + o["divide"] + o["root"]
    return Cost(flops=flops, instructions=fp64, fp64=fp64, mufu=o["divide"] + o["root"])


def kernels(terms: int = 1) -> list[Kernel]:
    """Forward and backward of colour, alpha, both depths and normals, with `terms` SH coefficients.

    The distortion is not drawn: training leaves it out.
    """
    op = _C.bench.operations(terms)
    surfel_bytes = 4 * (3 + 4 + 2 + 1 + 3 * terms)
    # bounds.h: the ellipse (about 70 operations, 8 roots and divisions), then 30 and 3 for each row of tiles, say 2
    bounds = Cost(flops=150, instructions=260, fp64=260, mufu=14)
    forward_hit = in_float(op["intersect"], rows=7) + Cost(instructions=5 + 6 + HOT, mio=HOT, flops=4)
    # alpha, weight, T, covered, colour, normal, depth, last, median
    forward_kept = Cost(instructions=22 + COLD, mio=COLD, flops=20)
    backward_hit = in_float(op["intersect"], rows=7) + Cost(instructions=5 + 6 + HOT, mio=HOT, flops=4)
    backward_kept = in_float(op["hit_backward"]) + Cost(
        # 1 / (1 - alpha), weight, worth, behind, the sums' products; then the sum over the warp by halves, each with a
        # choice, a shuffle and an addition, and the 8 warps' sums added in shared memory
        instructions=DIVIDE + 34 + COLD + 4 * SHUFFLES + 8, mufu=1, mio=COLD + SHUFFLES + 2, flops=60 + SUMS,
    )  # fmt: skip
    return [
        Kernel(
            "project, bounds, tiles", False,
            {
                "surfels": Cost(instructions=40, flops=40, dram=4 * (3 + 2 + 1) + 16),
                "visible": in_double(op["project"]) + in_double(op["color"]) + bounds
                + Cost(instructions=80, dram=surfel_bytes - 24 + RECORD + ROWS),
            }, launches=3,
        ),
        Kernel(
            "sort by depth", False,
            # of all surfels, since the host does not know yet how many are seen: histogram, 4 digits of 8 bits with key
            # and index read and written, tiles in that order, two prefix sums
            {"surfels": Cost(instructions=30 + 4 * 40, dram=4 + 4 * 16 + 12 + 2 * 8)},
            launches=11,
        ),
        Kernel(
            "tile lists", False,
            # entries written in the order of depth, then sorted by tile: two digits of key and item
            {
                "visible": Cost(instructions=120, l2=64, dram=16 + ROWS),
                "entries": Cost(instructions=20 + 2 * 40, dram=12 + 4 + 2 * 24),
            }, launches=8,
        ),
        Kernel(
            "blend", False,
            {
                # copied, its patches found, each of 8 warps decides
                "forward_entries": Cost(
                    instructions=20 + REACH + 8 * 10, mio=8 + 16 * 4 + 8 * 2, l2=RECORD, dram=8 + 1
                ),
                "visible": Cost(dram=RECORD),
                "forward_warps": forward_hit,
                "kept_warps": forward_kept,
                "pixels": Cost(instructions=60, dram=4 * (3 + 1 + 1 + 1 + 3) + 4 * 3),
            },
        ),
        Kernel(
            "blend backward", True,
            {
                # a row of 20 sums for each entry, no atomics
                "entries": Cost(instructions=30 + 20 * 20 + 8 * 10, mio=8 + 20 * 6, l2=RECORD, dram=8 + 1 + 80),
                "visible": Cost(dram=RECORD),
                "backward_warps": backward_hit,
                "kept_warps": backward_kept,
                "pixels": Cost(instructions=80, dram=4 * (3 + 1 + 1 + 1 + 3) + 4 * 3 + 8),
            },
        ),
        Kernel(
            "project backward", True,
            {
                "entries": Cost(instructions=25, fp64=20, dram=80),
                "visible": in_double(op["project"]) + in_double(op["project_backward"])
                + in_double(op["color_backward"]) + Cost(instructions=60, dram=surfel_bytes),
                "surfels": Cost(instructions=30, dram=16 + surfel_bytes + 8),
            }, launches=2,
        ),
    ]  # fmt: skip
