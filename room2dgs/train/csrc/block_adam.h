// Adam on the rows that a view has seen, as block code (block.h).
#pragma once

#include "launch.h"

namespace R2_ISA {

// Parameters, gradients and both moments are (rows, width); rows whose `seen` is 0 keep all of theirs. `step` counts
// from 1, over all rows together.
struct AdamStep {
  float *parameters, *first, *second;
  const float* gradients;
  const uint8_t* seen;  // null: all
  int64_t rows, width;
  double rate, beta1, beta2, epsilon;
  int64_t step;
};

void adam_rows(const Queue& queue, const AdamStep& step);

}  // namespace R2_ISA
