"""The CUDA kernels as plain C++ on the CPU, as a backend: for tests and `make gpu-check`, far slower than "cpu"."""

from __future__ import annotations

from room2dgs import _C
from room2dgs.splat.backends.backend import Backend, View
from room2dgs.splat.backends.block_view import Build, Rasterize
from room2dgs.splat.backends.cpu import FLOATS
from room2dgs.splat.types import Rendering, Surfels

_order = 0


def set_order(seed: int) -> int:
    """In which order blocks and threads come from now on: 0 as they are numbered, else drawn; no bit may depend on it.

    Returns:
        The seed before.
    """
    global _order
    before, _order = _order, seed
    return before


BUILD = Build(_C.device, lambda _: _order)


def _render(surfels: Surfels, view: View) -> Rendering:
    *images, _ = Rasterize.apply(
        *surfels, view.cam_from_world, view.K, view.background, view.center_px,
        view.width, view.height, view.near_m, view.with_normal, view.with_distortion, BUILD,
    )  # fmt: skip
    return Rendering(*images)


BACKEND = Backend("blocks", ("cpu",), FLOATS, _render, automatic=False)
