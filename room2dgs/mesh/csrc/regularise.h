// Huber-regularised signed distances on sparse blocks of voxels, by a primal-dual method.
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

constexpr int kMostSide = 8;

// Minimises sum of weight / 2 (value - data)^2 + share h(|gradient|), h Huber's norm: quadratic below `soft`, its slope 1
// above. Blocks that are not there bound the domain: nothing pulls across.
struct RegulariseJob {
  const float* data;         // (blocks, side^3), in the order z, y, x
  const float* weight;       // likewise, 0 = nothing is known
  const int32_t* neighbour;  // (blocks, 6) blocks at -x, -y, -z, +x, +y, +z, or -1
  float* value;              // (blocks, side^3)
  float* ahead;              // likewise, the extrapolated value
  float* dual;               // (blocks, 3, side^3)
  int side;                  // 1, 2, 4 or 8
  float share, soft;
};

constexpr float kRegulariseStep = 0.28f;  // of both, its square times 12, the operator's norm, is below 1

}  // namespace room2dgs

#define R2_REGULARISE_KERNELS(isa)                                        \
  namespace isa {                                                         \
  void regularise_dual(const room2dgs::RegulariseJob& job, int64_t block);   \
  void regularise_primal(const room2dgs::RegulariseJob& job, int64_t block); \
  }
R2_EACH_ISA(R2_REGULARISE_KERNELS)
#undef R2_REGULARISE_KERNELS
