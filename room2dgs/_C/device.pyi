"""
The CUDA kernels as plain C++ on the CPU: for tests, and multi-view terms.
"""

from typing import Annotated

import numpy
from numpy.typing import NDArray


cuda: bool = False

class BlockFrame:
    """One rendered view: what its backward pass needs."""

    def __init__(self) -> None: ...

    @property
    def visible(self) -> int:
        """Surfels that reach a pixel."""

    @property
    def entries(self) -> int:
        """(surfel, tile) pairs."""

    @property
    def bytes(self) -> int:
        """Memory of the device that it holds."""

    @property
    def moved(self) -> int:
        """Rows of center_px that are not 0."""

    def camera(self) -> tuple:
        """
        The last view's pose (16 numbers), K (9) and background (3), as the device read them.
        """

    def forward(self, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], cam_from_world: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], width: int, height: int, near: float, opacity_floor: float, background: Annotated[NDArray, dict(writable=False)], color: NDArray, alpha: NDArray, depth: NDArray, median: NDArray, normal: NDArray | None, distortion: NDArray | None, center_px: Annotated[NDArray, dict(writable=False)] | None = None, queue: int = 0) -> int:
        """
        Draws a view into the maps. Gives its number, which `backward` asks for, or 0 where nothing was drawn: a focal length is not above 0, or the camera not finite. cam_from_world and K are float64, all else float32. queue: torch's cuda_stream; on the CPU the seed of the order of blocks, 0 for in order.
        """

    def backward(self, view: int, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], depth: Annotated[NDArray, dict(writable=False)], g_color: Annotated[NDArray, dict(writable=False)] | None, g_alpha: Annotated[NDArray, dict(writable=False)] | None, g_depth: Annotated[NDArray, dict(writable=False)] | None, g_median: Annotated[NDArray, dict(writable=False)] | None, g_normal: Annotated[NDArray, dict(writable=False)] | None, g_distortion: Annotated[NDArray, dict(writable=False)] | None, to_centers: NDArray, to_rotations: NDArray, to_scales: NDArray, to_opacities: NDArray, to_sh: NDArray, to_center_px: NDArray, to_pose: NDArray, to_K: NDArray, to_background: NDArray | None, queue: int = 0) -> None:
        """
        The gradients of the frame's last view, which must be number `view`; alpha and depth are its maps. to_pose, to_K and to_background are float64, all else float32.
        """

class GaussianBlockFrame:
    """One rendered view: what its backward pass needs."""

    def __init__(self) -> None: ...

    @property
    def visible(self) -> int:
        """Surfels that reach a pixel."""

    @property
    def entries(self) -> int:
        """(surfel, tile) pairs."""

    @property
    def bytes(self) -> int:
        """Memory of the device that it holds."""

    @property
    def moved(self) -> int:
        """Rows of center_px that are not 0."""

    def camera(self) -> tuple:
        """
        The last view's pose (16 numbers), K (9) and background (3), as the device read them.
        """

    def forward(self, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], cam_from_world: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], width: int, height: int, near: float, opacity_floor: float, background: Annotated[NDArray, dict(writable=False)], color: NDArray, alpha: NDArray, depth: NDArray, median: NDArray, normal: NDArray | None, distortion: NDArray | None, filter_px2: float, compensated: bool, center_px: Annotated[NDArray, dict(writable=False)] | None = None, queue: int = 0) -> int:
        """As BlockFrame's, of 3D Gaussians: scales are (n, 3)."""

    def backward(self, view: int, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], depth: Annotated[NDArray, dict(writable=False)], g_color: Annotated[NDArray, dict(writable=False)] | None, g_alpha: Annotated[NDArray, dict(writable=False)] | None, g_depth: Annotated[NDArray, dict(writable=False)] | None, g_median: Annotated[NDArray, dict(writable=False)] | None, g_normal: Annotated[NDArray, dict(writable=False)] | None, g_distortion: Annotated[NDArray, dict(writable=False)] | None, to_centers: NDArray, to_rotations: NDArray, to_scales: NDArray, to_opacities: NDArray, to_sh: NDArray, to_center_px: NDArray, to_pose: NDArray, to_K: NDArray, to_background: NDArray | None, queue: int = 0) -> None:
        """
        The gradients of the frame's last view, which must be number `view`; alpha and depth are its maps. to_pose, to_K and to_background are float64, all else float32.
        """

class BlockLosses:
    """
    The fused losses of training, with the buffers that one queue uses again and again.
    """

    def __init__(self) -> None: ...

    def rgb_loss(self, rendered: Annotated[NDArray, dict(writable=False)], target: Annotated[NDArray, dict(writable=False)], dssim: float, values: NDArray, gradient: NDArray | None, queue: int = 0) -> None:
        """
        Writes (L, D) = (mean |rendered - target|, mean 1 - SSIM) to values, float64, and the gradient of (1 - dssim) L + dssim D. queue: as in BlockFrame.
        """

    def depth_normals(self, depth: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], cam_from_world: Annotated[NDArray, dict(writable=False)], normal: NDArray, queue: int = 0) -> None: ...

    def normal_consistency(self, depth: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], normal: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], cam_from_world: Annotated[NDArray, dict(writable=False)], grad_depth: NDArray, grad_normal: NDArray, values: NDArray, queue: int = 0) -> None:
        """
        Writes the loss and the gradient of the rotation to values, (10,) float64.
        """

    def depth_prior(self, depth: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], prior: Annotated[NDArray, dict(writable=False)], valid: Annotated[NDArray, dict(writable=False)], confidence: Annotated[NDArray, dict(writable=False)] | None, disparity: bool, align: bool, gradient_weight: float, levels: int, gradient: NDArray, values: NDArray, queue: int = 0) -> None:
        """
        Writes the loss to values, (1,) float64, and its gradient by the depth. valid is uint8.
        """

    def normal_prior(self, normal: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], prior: Annotated[NDArray, dict(writable=False)], valid: Annotated[NDArray, dict(writable=False)], confidence: Annotated[NDArray, dict(writable=False)] | None, l1: float, cosine: float, step: int, gradient: NDArray, values: NDArray, queue: int = 0) -> None:
        """
        Writes the loss and 1 / number of its pixels to values, (2,) float64, and the loss's gradient by the normal, not yet multiplied by that. prior, valid (uint8) and confidence have every `step`-th row and column.
        """

    def multiview(self, depth: Annotated[NDArray, dict(writable=False)], normal: Annotated[NDArray, dict(writable=False)] | None, pixels: Annotated[NDArray, dict(writable=False)], grey: Annotated[NDArray, dict(writable=False)], other_grey: Annotated[NDArray, dict(writable=False)], usable: Annotated[NDArray, dict(writable=False)] | None, inverse_depth: Annotated[NDArray, dict(writable=False)], step: int, K: Annotated[NDArray, dict(writable=False)], cam_from_world: Annotated[NDArray, dict(writable=False)], other_K: Annotated[NDArray, dict(writable=False)], other_cam_from_world: Annotated[NDArray, dict(writable=False)], patch: int, to_depth: NDArray, to_normal: NDArray, values: NDArray, queue: int = 0) -> None:
        """
        Writes geometric and photometric mean and the numbers of their pixels to values, (4,) float64, and each pixel's gradients, not yet divided by these. pixels, int32, are row * width + column, or -1; usable is uint8. Without a normal there is no photometric term.
        """

class StereoPhoto:
    """A grey photo, packed for bilinear samples."""

    def __init__(self, grey: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

class PatchMatch:
    """
    PatchMatch stereo of one photo; planes are (inverse depth, d/dx, d/dy).
    """

    def __init__(self, photo: StereoPhoto, radius: int, step: int, sigma_grey: float, sigma_px: float, variance_floor: float, best: int, w_min: float, w_max: float, slope_limit: float, pixel_slope: float, seed: int) -> None: ...

    def add_view(self, photo: StereoPhoto, view_from_reference: Annotated[NDArray[numpy.float64], dict(shape=(3, 4), order='C', device='cpu', writable=False)], reference_from_view: Annotated[NDArray[numpy.float64], dict(shape=(3, 4), order='C', device='cpu', writable=False)], inverse_depth: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None) -> None: ...

    def set_planes(self, planes: Annotated[NDArray[numpy.float32], dict(shape=(3, None, None), order='C', device='cpu', writable=False)]) -> None: ...

    def set_hints(self, planes: Annotated[NDArray[numpy.float32], dict(shape=(3, None, None), order='C', device='cpu', writable=False)]) -> None: ...

    def run(self, iterations: int, perturbation: float, random_depths: int, geometric_weight: float, first_draw: int, thrifty: bool, queue: int = 0) -> None: ...

    def costs(self, geometric_weight: float, cost: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')], variance: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')], queue: int = 0) -> None: ...

    def planes(self, out: Annotated[NDArray[numpy.float32], dict(shape=(3, None, None), order='C', device='cpu')]) -> None: ...

def touched_blocks(depth: Annotated[NDArray, dict(writable=False)], normal: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], local_from_cam: Annotated[NDArray, dict(writable=False)], side: float, truncation: float, keys: NDArray, queue: int = 0) -> None:
    """
    Writes the blocks near a depth map's surface to keys, (pixels of every second row and column, 4) int64: ((x + h) 2h + y + h) 2h + z + h with h = 2^20, or -1; some more than once. K and local_from_cam, (3, 4), are float64 on the CPU. queue: as in BlockFrame.
    """

def fuse_depth(block: Annotated[NDArray, dict(writable=False)], row: Annotated[NDArray, dict(writable=False)], distance: NDArray, weight: NDArray, views: NDArray, color: NDArray, depth: Annotated[NDArray, dict(writable=False)], normal: Annotated[NDArray, dict(writable=False)], trust: Annotated[NDArray, dict(writable=False)], photo: Annotated[NDArray, dict(writable=False)], pixel_from_voxel: Annotated[NDArray, dict(writable=False)], voxel: float, truncation: float, queue: int = 0) -> None:
    """
    As the CPU's `fuse_depth`; no row may come twice, and one that is not there is passed over. pixel_from_voxel is on the CPU. queue: as in BlockFrame.
    """
