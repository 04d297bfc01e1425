"""Numbers that the reference and the compiled kernels must share.

surfel.h, gaussian.h, pixel.h and gaussian_pixel.h have the same ones, frame_arguments.h the floor, which is the least
that a caller may give.
"""

from __future__ import annotations

OPACITY_FLOOR = 1.0 / 255.0  # fainter hits are skipped, unless a caller says otherwise
MIN_COVERED_ALPHA = 0.5  # of a rendering: a pixel covered less has no depth or normal worth using
ALPHA_MAX = 0.99  # opaque hits are clamped; no gradient through the clamp
TRANSMITTANCE_MIN = 1e-4  # a pixel is finished once less light than this passes
FILTER_INVERSE_VARIANCE = 2.0  # screen-space low-pass filter of 2DGS, sigma = sqrt(2)/2 px
DEN_MIN = 1e-6  # a ray this close to the plane's horizon has no hit
EDGE_ON = 1e-3  # |cos| between normal and view ray below which a disc is edge-on
QUATERNION_MIN = 1e-30  # a smaller quaternion has no direction that float32 could pass a gradient to: no disc
DISTORTION_NEAR_M, DISTORTION_FAR_M = 0.2, 100.0  # 2DGS's depth map for the distortion loss
SH_DEGREE_OF = {1: 0, 4: 1, 9: 2, 16: 3}  # coefficients -> degree
GAUSSIAN_FILTER_PX2 = 0.3  # variance of a pixel's filter of 3D Gaussians (3DGS)
MIP_FILTER_PX2 = 0.1  # the same of Mip-Splatting, which makes up for it by the opacity
GAUSSIAN_DEN_MIN = 0.125  # a Gaussian's depth along a ray is at most its centre's over this
BEYOND_VIEW = 0.3  # of half the view: further out a Gaussian's linear map is taken at the view's edge (3DGS)
