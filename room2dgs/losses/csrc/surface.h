// Normals from depth and the normal-consistency loss, one strip of rows at a time.
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

struct Pinhole {
  float fx, fy, cx, cy;
  float cam_from_world[9];  // the rotation, by rows
};

struct DepthNormalsJob {
  const float* depth;  // (height, width)
  float* normal;       // (height, width, 3), world frame
  Pinhole camera;
  int64_t height, width, strip_rows;
  float* scratch;  // depth_normals_scratch(...) floats for each worker
};

struct NormalConsistencyJob {
  const float* depth;   // (height, width)
  const float* alpha;   // (height, width)
  const float* normal;  // (height, width, 3), world frame
  float* grad_depth;    // (height, width)
  float* grad_normal;   // (height, width, 3)
  double* row_sums;     // 10 for each row: the loss, then its gradient to cam_from_world's rotation, by rows
  Pinhole camera;
  int64_t height, width, strip_rows;
  float scale;     // factor of a pixel's term in the gradients
  float* scratch;  // normal_consistency_scratch(...) floats for each worker
};

// Rows have a margin of 8 floats on both sides; the strip's depths have one of 2 rows, its slopes' gradients of 1.
static inline int64_t surface_stride(int64_t width) { return (width + 7) / 8 * 8 + 16; }
static inline int64_t depth_normals_scratch(int64_t width, int64_t strip_rows) {
  return (strip_rows + 2) * surface_stride(width);
}
static inline int64_t normal_consistency_scratch(int64_t width, int64_t strip_rows) {
  return (strip_rows + 4 + 2 * (strip_rows + 2)) * surface_stride(width);
}

}  // namespace room2dgs

#define R2_SURFACE_KERNELS(isa)                                                                        \
  namespace isa {                                                                                      \
  void depth_normals_strip(const room2dgs::DepthNormalsJob& job, int64_t strip, int worker);           \
  void normal_consistency_strip(const room2dgs::NormalConsistencyJob& job, int64_t strip, int worker); \
  }
R2_EACH_ISA(R2_SURFACE_KERNELS)
#undef R2_SURFACE_KERNELS
