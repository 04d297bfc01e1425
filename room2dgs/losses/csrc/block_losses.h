// The fused losses of training as block code (block.h): L1 with D-SSIM, normals from depth with their consistency, the
// depth and the normal prior's, the multi-view terms. Values and gradients stay on the device, and so do cameras: K is
// (3, 3) without skew, a pose (4, 4) cam_from_world. The arithmetic of a pixel is in ssim.h, surface_maths.h, depth_prior_maths.h,
// normal_prior_maths.h and multiview_maths.h.
#pragma once

#include "depth_prior_maths.h"
#include "launch.h"
#include "surface.h"

namespace R2_ISA {

// What the multi-view terms compare.
struct MultiviewPixels {
  const float *depth, *normal;  // (height, width), and (height, width, 3) or null: no photometric term
  int64_t height, width;
  const int32_t* pixels;        // (samples): row * width + column, or -1 for none
  int64_t samples;
  const float *grey, *other_grey;  // photos, (height, width) and (other_height, other_width)
  const uint8_t* usable;           // likewise, or null: all
  int64_t other_height, other_width;
  const float* inverse_depth;      // of every `step`-th row and column of the neighbour, (map_height, map_width)
  int64_t map_height, map_width;
  float step;
  const float *K, *pose, *other_K, *other_pose;
  int patch;
  float *to_depth, *to_normal;  // (samples, 2) of the geometric and of the photometric term, and (samples, 3) of that
};

// What the normal prior's term compares: of the rendering every `step`-th row and column, from the first.
struct NormalMaps {
  const float *normal, *alpha;  // (rendered_height, rendered_width, 3) and (rendered_height, rendered_width)
  int64_t rendered_height, rendered_width, step;
  const float *prior, *confidence;  // (height, width, 3), and (height, width) or null for 1
  const uint8_t* valid;             // likewise
  int64_t height, width;
};

// Buffers that are used again for the next view.
struct BlockLosses {
  DeviceBuffer<float> maps;
  DeviceBuffer<double> parts;
  DeviceBuffer<DepthFit> fit;

  // values: mean |rendered - target| and mean 1 - SSIM, (2,). gradient, of (1 - dssim) L1 + dssim D-SSIM, may be null.
  void rgb_loss(const Queue& queue, const float* rendered, const float* target, int64_t height, int64_t width,
                double dssim, float* gradient, double* values);
  // values: the mean loss, then the gradient of cam_from_world's rotation by rows, (10,).
  void normal_consistency(const Queue& queue, const float* depth, const float* alpha, const float* normal,
                          const float* K, const float* pose, int64_t height, int64_t width, float* grad_depth,
                          float* grad_normal, double* values);
  void depth_normals(const Queue& queue, const float* depth, const float* K, const float* pose, int64_t height,
                     int64_t width, float* normal);
  // values: the loss, (1,). The prior is aligned to the rendering first, if `align`.
  void depth_prior(const Queue& queue, const DepthMaps& maps, bool align, double gradient_weight, int levels,
                   float* gradient, double* values);
  // values: the mean loss, then 1 / number of pixels, by which the gradient is yet to be multiplied, (2,).
  void normal_prior(const Queue& queue, const NormalMaps& maps, float l1, float cosine, float* gradient,
                    double* values);
  // values: geometric and photometric mean, then the numbers of pixels that to_depth and to_normal are yet to be divided
  // by, (4,).
  void multiview(const Queue& queue, const MultiviewPixels& job, double* values);
};

}  // namespace R2_ISA
