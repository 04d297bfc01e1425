"""Compiled kernels of room2dgs; use the Python functions that wrap them."""

from typing import Annotated

import numpy
from numpy.typing import NDArray

from room2dgs._C import bench as bench, device as device


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

    def forward(self, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], cam_from_world: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], width: int, height: int, near: float, opacity_floor: float, background: Annotated[NDArray, dict(writable=False)], color: NDArray, alpha: NDArray, depth: NDArray, median: NDArray, normal: NDArray | None, distortion: NDArray | None) -> int:
        """
        Draws a view into the maps. Gives its number, which `backward` asks for. cam_from_world and K are float64, all else float32.
        """

    def backward(self, view: int, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], depth: Annotated[NDArray, dict(writable=False)], g_color: Annotated[NDArray, dict(writable=False)] | None, g_alpha: Annotated[NDArray, dict(writable=False)] | None, g_depth: Annotated[NDArray, dict(writable=False)] | None, g_median: Annotated[NDArray, dict(writable=False)] | None, g_normal: Annotated[NDArray, dict(writable=False)] | None, g_distortion: Annotated[NDArray, dict(writable=False)] | None, to_centers: NDArray, to_rotations: NDArray, to_scales: NDArray, to_opacities: NDArray, to_sh: NDArray, to_center_px: NDArray, to_pose: NDArray, to_K: NDArray, to_background: NDArray | None) -> None:
        """
        The gradients of the frame's last view, which must be number `view`; alpha and depth are its maps. to_pose, to_K and to_background are float64, all else float32.
        """

class GaussianFrame:
    """One rendered view: what its backward pass needs."""

    def __init__(self) -> None: ...

    @property
    def visible(self) -> int:
        """Surfels that reach a pixel."""

    @property
    def entries(self) -> int:
        """(surfel, tile) pairs."""

    def forward(self, centers: Annotated[NDArray, dict(writable=False)], rotations: Annotated[NDArray, dict(writable=False)], scales: Annotated[NDArray, dict(writable=False)], opacities: Annotated[NDArray, dict(writable=False)], sh: Annotated[NDArray, dict(writable=False)], cam_from_world: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], width: int, height: int, near: float, opacity_floor: float, background: Annotated[NDArray, dict(writable=False)], color: NDArray, alpha: NDArray, depth: NDArray, median: NDArray, normal: NDArray | None, distortion: NDArray | None, filter_px2: float, compensated: bool) -> int:
        """As RasterFrame's, of 3D Gaussians: scales are (n, 3)."""

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

def depth_prior(depth: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], prior: Annotated[NDArray, dict(writable=False)], valid: Annotated[NDArray, dict(writable=False)], confidence: Annotated[NDArray, dict(writable=False)] | None, disparity: bool, align: bool, gradient_weight: float, levels: int, step: int, gradient: NDArray) -> float:
    """
    Returns the loss and writes its gradient by the depth. Compared are every `step`-th row and column of depth and alpha, which are all that the other maps have. valid is uint8.
    """

def normal_prior(normal: Annotated[NDArray, dict(writable=False)], alpha: Annotated[NDArray, dict(writable=False)], prior: Annotated[NDArray, dict(writable=False)], valid: Annotated[NDArray, dict(writable=False)], confidence: Annotated[NDArray, dict(writable=False)] | None, l1: float, cosine: float, step: int, gradient: NDArray) -> float:
    """
    Returns the loss and writes its gradient by the normal; maps as in depth_prior.
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

def agree(own: Annotated[NDArray, dict(writable=False)], theirs: Annotated[NDArray, dict(writable=False)], there: Annotated[NDArray, dict(writable=False)], back: Annotated[NDArray, dict(writable=False)], max_px: float, max_relative: float, count: NDArray, through: NDArray, hidden: NDArray, total: NDArray, squares: NDArray) -> None:
    """
    Adds what one neighbour says of a view's inverse depths; see stereo/agreement.py.
    """

def joint_gradient(depth: Annotated[NDArray, dict(writable=False)], depth_confidence: Annotated[NDArray, dict(writable=False)], normal: Annotated[NDArray, dict(writable=False)], normal_confidence: Annotated[NDArray, dict(writable=False)], region: Annotated[NDArray, dict(writable=False)], region_normal: Annotated[NDArray, dict(writable=False)], view_table: Annotated[NDArray, dict(writable=False)], pair_views: Annotated[NDArray, dict(writable=False)], pair_table: Annotated[NDArray, dict(writable=False)], point_place: Annotated[NDArray, dict(writable=False)], point_off: Annotated[NDArray, dict(writable=False)], axes: Annotated[NDArray, dict(writable=False)] | None, grid: Annotated[NDArray, dict(writable=False)], stiffness: Annotated[NDArray, dict(writable=False)], draws: Annotated[NDArray, dict(writable=False)], weights: Annotated[NDArray, dict(writable=False)], widths: Annotated[NDArray, dict(writable=False)], step: int, smoothness: float, magnitude: float, gradient: NDArray) -> float:
    """
    The energy of the joint depth optimisation at these draws; its gradient is written.
    """

def adam(values: NDArray, gradient: Annotated[NDArray, dict(writable=False)], first: NDArray, second: NDArray, rate: float, step: int) -> None:
    """One step of Adam; `first` and `second` are its moments."""

def complete(distance: Annotated[NDArray, dict(writable=False)], anchor: Annotated[NDArray, dict(writable=False)], prior: Annotated[NDArray, dict(writable=False)], right: Annotated[NDArray, dict(writable=False)], down: Annotated[NDArray, dict(writable=False)], step_right: Annotated[NDArray, dict(writable=False)], step_down: Annotated[NDArray, dict(writable=False)], reweightings: int, least: float, anchor_width: float, tie_width: float, result: NDArray) -> None:
    """
    Reweighted least squares of images (n, h, w) between anchors; see priors/completion/solve.py.
    """

def depth_of_other_views(depth: Annotated[NDArray, dict(writable=False)], sure: Annotated[NDArray, dict(writable=False)], size: Annotated[NDArray, dict(writable=False)], near: Annotated[NDArray, dict(writable=False)], warp: Annotated[NDArray, dict(writable=False)], least: float, same: float, result: NDArray, trust: NDArray) -> None:
    """
    Depth of each view that its neighbours' makes, and the trust in it; see priors/completion/other_views.py.
    """

def count_rays(corner: Annotated[NDArray, dict(writable=False)], side: float, centres: Annotated[NDArray, dict(writable=False)], first: Annotated[NDArray, dict(writable=False)], ends: Annotated[NDArray, dict(writable=False)], from_m: float, up_to: float, through: NDArray, ended: NDArray) -> None:
    """
    Adds how many views look through each cell, and end in it; see priors/completion/free_space.py.
    """

def seen_through(corner: Annotated[NDArray, dict(writable=False)], side: float, through: Annotated[NDArray, dict(writable=False)], ended: Annotated[NDArray, dict(writable=False)], xyz: Annotated[NDArray, dict(writable=False)], doubt: float, share: NDArray) -> None:
    """
    Share of the views' word that there is nothing at points; see priors/completion/free_space.py.
    """

def touched_blocks(depth: Annotated[NDArray, dict(writable=False)], normal: Annotated[NDArray, dict(writable=False)], K: Annotated[NDArray, dict(writable=False)], local_from_cam: Annotated[NDArray, dict(writable=False)], side: float, truncation: float, keys: NDArray) -> None:
    """
    Writes the blocks near a depth map's surface to keys, (pixels of every second row and column, 4) int64: ((x + h) 2h + y + h) 2h + z + h with h = 2^20, or -1; some more than once.
    """

def fuse_depth(block: Annotated[NDArray, dict(writable=False)], row: Annotated[NDArray, dict(writable=False)], distance: NDArray, weight: NDArray, views: NDArray, color: NDArray, depth: Annotated[NDArray, dict(writable=False)], normal: Annotated[NDArray, dict(writable=False)], trust: Annotated[NDArray, dict(writable=False)], photo: Annotated[NDArray, dict(writable=False)], pixel_from_voxel: Annotated[NDArray, dict(writable=False)], voxel: float, truncation: float) -> None:
    """Takes one depth map into the blocks of a signed distance volume."""

def regularise(data: Annotated[NDArray, dict(writable=False)], weight: Annotated[NDArray, dict(writable=False)], neighbour: Annotated[NDArray, dict(writable=False)], value: NDArray, ahead: NDArray, dual: NDArray, side: int, share: float, soft: float, steps: int) -> None:
    """
    Steps of the primal-dual method of regularise.h on value, ahead and dual, which it changes.
    """

def draw_faces(vertices: Annotated[NDArray, dict(writable=False)], faces: Annotated[NDArray, dict(writable=False)], fx: float, fy: float, cx: float, cy: float, near: float, depth: NDArray, face: NDArray) -> None:
    """
    Writes the depth (h, w) and the index of the nearest face, 0 and -1 where there is none; vertices (v, 3) are float32 in the camera's frame, faces (f, 3) int32.
    """

def look_up(points: Annotated[NDArray, dict(writable=False)], normals: Annotated[NDArray, dict(writable=False)], spacing: Annotated[NDArray, dict(writable=False)], depth: Annotated[NDArray, dict(writable=False)], photo: Annotated[NDArray, dict(writable=False)], soft: Annotated[NDArray, dict(writable=False)], usable: Annotated[NDArray, dict(writable=False)] | None, fx: float, fy: float, cx: float, cy: float, cam_from_world: Annotated[NDArray, dict(writable=False)], gain: Annotated[NDArray, dict(writable=False)], sharpness: float, softness: float, quality: NDArray, sharp: NDArray, low: NDArray) -> None:
    """
    Takes one photo into the best views (n, 5) of points: quality, falling, and levels of photo and blurred photo.
    """

def blend_views(quality: Annotated[NDArray, dict(writable=False)], sharp: Annotated[NDArray, dict(writable=False)], low: Annotated[NDArray, dict(writable=False)], color: NDArray, best: NDArray) -> None:
    """
    Writes the colours (n, 3) 0..255 that the best views of `look_up` give, and the quality of the best, 0 = none.
    """

def pack_normals(normals: Annotated[NDArray, dict(writable=False)], codes: NDArray) -> None:
    """Writes the codes (2, pixels), int16, of normals (3, pixels), float32."""

def unpack_normals(codes: Annotated[NDArray, dict(writable=False)], normals: NDArray) -> None:
    """The way back: unit normals, or 0."""
