// The losses of depth and normal priors, some rows at a time. Maps of the prior are (height, width); of the rendering every
// `step`-th row and column is compared, from the first. Normals have three floats a pixel.
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

constexpr int kPriorLevels = 4;               // strides 1, 2, 4, 8
constexpr int kPriorMoments = 7;              // number, w, w p, w x, w p p, w p x, w x x
constexpr int kPriorPairs = 2 * kPriorLevels;  // along rows and along columns, by level

// Where the compared pixels lie in the maps of the rendering.
struct Rendered {
  int64_t height, width, step;
  int64_t at(int64_t row) const { return row * step * width; }  // its first pixel
};

struct DepthPriorJob {
  Rendered rendered;
  const float *depth, *alpha;       // of the rendering
  const float *prior, *confidence;  // confidence: null for 1
  const uint8_t* valid;
  int64_t height, width, strip_rows;
  bool disparity;  // what the prior is; of the rendering its inverse is compared then
  bool align;      // to the rendering; else scale 1, shift 0
  int levels;
  float* weight;         // each pixel's, -1 where it is not compared
  float* residual;       // x, the rendered depth or its inverse; then (x - (s p + t)) / m, 0 where it is not compared
  double* row_moments;   // kPriorMoments for each row
  int64_t* row_pairs;    // kPriorPairs for each row
  double* row_values;    // one for each row
  float scale, shift, inverse_unit, mean, shares[kPriorLevels][2];  // as DepthFit has them
  float* gradient;  // of the whole rendering
  float* scratch;  // depth_prior_scratch(width) floats for each worker
};

struct NormalPriorJob {
  Rendered rendered;
  const float *normal, *alpha;      // of the rendering
  const float *prior, *confidence;  // confidence: null for 1
  const uint8_t* valid;
  int64_t height, width, strip_rows;
  int64_t* row_counts;  // compared pixels of each row
  double* row_values;   // one for each row
  float l1, cosine;     // over the number of pixels
  float* gradient;  // of the whole rendering
  float* scratch;  // normal_prior_scratch(width) floats for each worker
};

static inline int64_t depth_prior_scratch(int64_t width) { return 3 * width; }
static inline int64_t whole_lanes(int64_t width) { return (width + 7) / 8 * 8; }
static inline int64_t normal_prior_scratch(int64_t width) { return 7 * whole_lanes(width); }

}  // namespace room2dgs

// Depth: weights and moments; then, aligned, residuals and pairs; then value and gradient. Normals: numbers of pixels,
// then value and gradient.
#define R2_PRIOR_KERNELS(isa)                                                          \
  namespace isa {                                                                      \
  void depth_prior_moments(const room2dgs::DepthPriorJob& job, int64_t strip);         \
  void depth_prior_residuals(const room2dgs::DepthPriorJob& job, int64_t strip);       \
  void depth_prior_gradient(const room2dgs::DepthPriorJob& job, int64_t strip, int worker); \
  void normal_prior_count(const room2dgs::NormalPriorJob& job, int64_t strip);         \
  void normal_prior_gradient(const room2dgs::NormalPriorJob& job, int64_t strip, int worker); \
  }
R2_EACH_ISA(R2_PRIOR_KERNELS)
#undef R2_PRIOR_KERNELS
