// The fused losses of training as block code (block.h): L1 with D-SSIM, normals from depth with their consistency.
// Values and gradients stay on the device; the arithmetic of a pixel is that of the CPU's kernels (ssim.h,
// surface_maths.h).
#pragma once

#include "launch.h"
#include "surface.h"

namespace R2_ISA {

// Buffers that are used again for the next view.
struct BlockLosses {
  DeviceBuffer<float> maps;
  DeviceBuffer<double> parts;

  // values: mean |rendered - target| and mean 1 - SSIM, (2,). gradient, of (1 - dssim) L1 + dssim D-SSIM, may be null.
  void rgb_loss(const Queue& queue, const float* rendered, const float* target, int64_t height, int64_t width,
                double dssim, float* gradient, double* values);
  // values: the mean loss, then the gradient of cam_from_world's rotation by rows, (10,).
  void normal_consistency(const Queue& queue, const float* depth, const float* alpha, const float* normal,
                          const room2dgs::Pinhole& camera, int64_t height, int64_t width, float* grad_depth,
                          float* grad_normal, double* values);
  void depth_normals(const Queue& queue, const float* depth, const room2dgs::Pinhole& camera, int64_t height,
                     int64_t width, float* normal);
};

}  // namespace R2_ISA
