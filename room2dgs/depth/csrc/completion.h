// Completed depth: the reweighted least squares of depth/completion/solve.py, four images at a time, one in each lane.
// Each system is solved directly (LDL^T by fronts, dissection.h) in float64: regions without any anchor hang on ties and
// on a weight of 1e-7, which is too little for float32 and slow for iterations.
#pragma once

#include <cstdint>

#include "dissection.h"
#include "isa.h"

namespace room2dgs {

constexpr int kCompletionLanes = 4;

struct CompletionJob {
  int64_t images;
  const Dissection* order;
  const double *distance, *anchor, *prior;  // (images, height, width)
  const double* right;                      // (images, height, width - 1)
  const double* down;                       // (images, height - 1, width)
  const double *step_right, *step_down;     // by how much the ties want neighbours to differ, likewise
  int64_t reweightings;
  double least, anchor_width, tie_width;
  double* result;  // (images, height, width)
};

constexpr int64_t kCompletionPanel = 16;  // pixels that are eliminated before the rest of a front hears of them

// Vectors of scratch that a worker needs.
inline int64_t completion_scratch(const Dissection& order) {
  return 12 * order.height * order.width + order.kept + order.stack + (order.widest + 1) * kCompletionPanel;
}

}  // namespace room2dgs

#define R2_COMPLETION_KERNELS(isa)                                                                              \
  namespace isa {                                                                                               \
  /* Four images from `first` on; scratch of four numbers a vector, aligned to 32 bytes. */                      \
  void complete_images(const room2dgs::CompletionJob& job, int64_t first, double* scratch);                     \
  }
R2_EACH_ISA(R2_COMPLETION_KERNELS)
#undef R2_COMPLETION_KERNELS
