"""The CUDA kernels as plain C++ on the CPU, as a backend: for tests and `make gpu-check`, far slower than "cpu"."""

from __future__ import annotations

from room2dgs.block_code import BUILDS, PLAIN
from room2dgs.splat.backends.backend import Backend, View
from room2dgs.splat.backends.block_view import Rasterize
from room2dgs.splat.backends.cpu import FLOATS
from room2dgs.splat.types import Rendering, Surfels


def _render(surfels: Surfels, view: View) -> Rendering:
    *images, _ = Rasterize.apply(
        *surfels, view.cam_from_world, view.K, view.background, view.center_px,
        view.width, view.height, view.near_m, view.opacity_floor, view.with_normal, view.with_distortion,
        BUILDS.get(surfels.centers.device.type, PLAIN),
    )  # fmt: skip
    return Rendering(*images)


BACKEND = Backend("blocks", ("cpu",), FLOATS, _render, automatic=False)
