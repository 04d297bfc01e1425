"""What `room2dgs bench raster` measures by."""

from typing import Annotated

from numpy.typing import NDArray

import room2dgs._C


def time_stages(frame: room2dgs._C.RasterFrame, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], color: NDArray, alpha: NDArray, depth: NDArray, median: NDArray, normal: NDArray) -> dict:
    """
    Renders the last view again and gives the seconds of each stage of the forward pass.
    """

def bare_loop(frame: room2dgs._C.RasterFrame, color: NDArray, alpha: NDArray, depth: NDArray, median: NDArray, normal: NDArray, g_color: Annotated[NDArray, dict(writable=False)] | None, every: int, repeats: int) -> tuple:
    """
    Seconds and (pixel, surfel) pairs of every n-th tile, each run over and over with its data in the cache.
    """

def count_pairs(frame: room2dgs._C.RasterFrame, color: NDArray, alpha: NDArray, depth: NDArray, median: NDArray, normal: NDArray) -> int:
    """(pixel, surfel) pairs that the last view evaluates."""

def tile_work(frame: room2dgs._C.RasterFrame, every: int, work: NDArray) -> None:
    """
    Rows of the last view's tiles: surfels listed, walked until the tile is dark, and blended; of warps of 16 x 2 pixels the sums of these walked and blended; the depth at which the tile is dark; of every n-th tile (else -1) the (pixel, surfel) pairs that are blended, those of warps of 16 x 2, and of warps of 8 x 4 the pairs that reach it until it is dark, those until its last that is blended, and those blended.
    """

def operations(terms: int) -> dict:
    """
    Operations of the rasterizer's maths by function, counted in its source; `terms` SH coefficients.
    """
