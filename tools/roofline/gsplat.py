"""gsplat's 2DGS kernels' work, counted by hand in its sources (1.5: Projection2DGSFused, IntersectTile,
RasterizeToPixels2DGSFwd and Bwd), built as it builds them, with fast division and exponential. Four channels: colour
and depth, which is how it draws a depth.
"""

from __future__ import annotations

from room2dgs.tools.roofline.cost import Cost, Kernel

CHANNELS = 4
# two planes through the ray, their cross product, two divisions, both weights, exponential, comparisons, loop; and 12
# floats of shared memory one by one, since its vectors of three are not aligned to more
HIT = Cost(instructions=37 + 12, mufu=3, mio=12, flops=46)
# colour, depth, normal, transmittance, median; colours and normals come from global memory, mostly the first cache
FORWARD_KEPT = Cost(instructions=20 + CHANNELS + 3, mio=CHANNELS + 3 + 1, flops=22)
SUMS = CHANNELS + 3 + 2 + 9 + 1
# five shuffles and additions for each sum, whether or not its lanes have anything; then one lane's atomics
BACKWARD_KEPT = Cost(
    instructions=91 + 7 + 2 * 5 * SUMS + 2 * SUMS + 6, mufu=3, mio=7 + 5 * SUMS + SUMS + 4, flops=130 + 5 * SUMS,
    l2=128, atomics=SUMS,
)  # fmt: skip
SURFEL = 8 + 4 + 36  # bytes of a projected surfel that a hit needs: place, opacity, transform
SHADE = 4 * CHANNELS + 12
SECTORS = 32 + 32 + 64  # what these cost in sectors of 32 bytes, each array by itself


def kernels(terms: int = 1) -> list[Kernel]:
    """Forward and backward of the same outputs as `ours.kernels`."""
    return [
        Kernel(
            "project, bounds, tiles", False,
            {
                # also the colours' kernel, a copy that puts the depth behind them, and two passes over the boxes
                "surfels": Cost(instructions=60, flops=60, dram=12 + 8 + 2 * 20 + 8),
                "visible": Cost(instructions=260 + 20 * terms, flops=300, mufu=6, dram=28 + 68 + 12 * terms + 12 + 44),
            }, launches=8,
        ),
        Kernel(
            "tile lists", False,
            # 64-bit keys (32 of depth, 11 to 13 of tile) with 32-bit values: six digits
            {"entries": Cost(instructions=20 + 6 * 45, dram=12 + 8 + 6 * 24 + 8)}, launches=16,
        ),
        Kernel(
            "blend", False,
            {
                "forward_entries": Cost(instructions=30, mio=12, l2=SECTORS, dram=4),
                "visible": Cost(dram=SURFEL + SHADE),
                "forward_warps": HIT,
                "kept_warps": FORWARD_KEPT,
                "pixels": Cost(instructions=60, dram=4 * (CHANNELS + 1 + 3 + 1 + 1) + 8),
            },
        ),
        Kernel(
            "blend backward", True,
            {
                "entries": Cost(instructions=50, mio=20, l2=SECTORS + 64, dram=4),
                "visible": Cost(dram=SURFEL + SHADE + 4 * SUMS),
                "surfels": Cost(dram=4 * (SUMS + 4)),  # cleared first
                "backward_warps": HIT + Cost(instructions=3),
                "kept_warps": BACKWARD_KEPT,
                "pixels": Cost(instructions=60, dram=4 * 2 * (CHANNELS + 1 + 3 + 1) + 8),
            }, launches=8,
        ),
        Kernel(
            "project backward", True,
            {
                "surfels": Cost(instructions=20, dram=4 + 4 * (3 + 4 + 3 + 3 * terms)),
                "visible": Cost(
                    instructions=420 + 30 * terms, flops=450, mufu=6, dram=40 + 36 + 4 * 15 + 36 + 12 * terms
                ),
            }, launches=10,
        ),
    ]  # fmt: skip
