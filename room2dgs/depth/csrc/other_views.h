// Depth of each view as others see it: what is sure in its neighbours is projected into it, each neighbour has one vote
// a pixel, and those near the votes' median are averaged (tests/oracles/other_views.py has it in numpy).
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

struct OtherViewsJob {
  int64_t views, neighbours;
  const int64_t* size;   // (views, 2) height and width
  const int64_t* first;  // (views) first pixel of each view
  const float *depth, *sure;  // all pixels, view after view; depth 0 = unknown
  const int64_t* near;        // (views, neighbours) other views; -1 = none
  const double* warp;         // (views, neighbours, 3, 4) from the neighbour's pixels, centres at integers, to the view's
  double least, same;
  float *result, *trust;  // all pixels
};

struct Vote {
  double depth, weight;
};

// Scratch of a worker; the widest view's pixels.
struct OtherViewsScratch {
  Vote* votes;         // (pixels, neighbours)
  int32_t* count;      // (pixels) votes
  double *sum, *sums;  // (pixels) of one neighbour: weights, and weighted depths
  int32_t* met;        // (pixels) how many of its pixels
};

}  // namespace room2dgs

#define R2_OTHER_VIEWS_KERNELS(isa)                                                                               \
  namespace isa {                                                                                                 \
  void depth_of_other_views(const room2dgs::OtherViewsJob& job, int64_t view, const room2dgs::OtherViewsScratch&); \
  }
R2_EACH_ISA(R2_OTHER_VIEWS_KERNELS)
#undef R2_OTHER_VIEWS_KERNELS
