// Where a neighbour's depth is consistent with a view's (tests/oracles/geometric_consistency.py has it in numpy).
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

struct AgreementJob {
  int64_t height, width;
  const float* own;  // inverse depths, 0 = unknown
  int64_t rows, columns;
  const float* theirs;
  float there[12], back[12];  // warps of stereo/patchmatch.py: to the neighbour, and from it
  float max_px, max_relative;
  // of each pixel, added to: neighbours that agree, look through it and do not see it; what those that agree say, and
  // its square
  uint8_t *count, *through, *hidden;
  float *total, *squares;
};

}  // namespace room2dgs

#define R2_AGREEMENT_KERNELS(isa)                                  \
  namespace isa {                                                  \
  void agree_row(const room2dgs::AgreementJob& job, int64_t row); \
  }
R2_EACH_ISA(R2_AGREEMENT_KERNELS)
#undef R2_AGREEMENT_KERNELS
