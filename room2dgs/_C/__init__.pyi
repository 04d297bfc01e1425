"""Compiled kernels of room2dgs; use the Python functions that wrap them."""

from typing import Annotated

from numpy.typing import NDArray

from room2dgs._C import bench as bench


def isa() -> str:
    """Instruction set of the kernels in use."""

def set_threads(count: int) -> int:
    """Asks for so many threads and gives the number in use."""

def threads() -> int:
    """Threads in use, the caller's own included."""

class RasterFrame:
    """One rendered view: what its backward pass needs."""

    def __init__(self) -> None: ...

    @property
    def visible(self) -> int:
        """Surfels that reach a pixel."""

    @property
    def entries(self) -> int:
        """(surfel, tile) pairs."""

    def forward(self, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], cam_from_world: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], width: int, height: int, near: float, background: Annotated[NDArray, dict(writable=False)], color: NDArray, alpha: NDArray, depth: NDArray, median: NDArray, normal: NDArray | None, distortion: NDArray | None) -> int:
        """
        Draws a view into the maps. Gives its number, which `backward` asks for. cam_from_world and K are float64, all else float32.
        """

    def backward(self, view: int, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], depth: Annotated[NDArray, dict(writable=False)], g_color: Annotated[NDArray, dict(writable=False)] | None, g_alpha: Annotated[NDArray, dict(writable=False)] | None, g_depth: Annotated[NDArray, dict(writable=False)] | None, g_median: Annotated[NDArray, dict(writable=False)] | None, g_normal: Annotated[NDArray, dict(writable=False)] | None, g_distortion: Annotated[NDArray, dict(writable=False)] | None, to_centers: NDArray, to_rotations: NDArray, to_scales: NDArray, to_opacities: NDArray, to_sh: NDArray, to_center_px: NDArray, to_pose: NDArray, to_K: NDArray, to_background: NDArray | None) -> None:
        """
        The gradients of the frame's last view, which must be number `view`; alpha and depth are its maps. to_pose, to_K and to_background are float64, all else float32.
        """

def rgb_loss(rendered: Annotated[NDArray, dict(writable=False)], target: Annotated[NDArray, dict(writable=False)], dssim: float, gradient: NDArray | None = None) -> tuple:
    """
    Returns (L, D) = (mean |rendered - target|, mean 1 - SSIM); writes the gradient of (1 - dssim) L + dssim D.
    """

def depth_normals(depth: Annotated[NDArray, dict(writable=False)], fx: float, fy: float, cx: float, cy: float, cam_from_world: Annotated[NDArray, dict(writable=False)], normal: NDArray) -> None: ...

def normal_consistency(depth: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], normal: Annotated[NDArray, dict(writable=False)], fx: float, fy: float, cx: float, cy: float, cam_from_world: Annotated[NDArray, dict(writable=False)], grad_depth: NDArray, grad_normal: NDArray, grad_rotation: NDArray) -> float: ...
