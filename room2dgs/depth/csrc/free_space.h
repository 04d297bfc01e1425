// Cells of a box that rays of many views pass through, and those that they end in
// (tests/oracles/free_space.py has it in numpy, to the same counts).
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

struct Cells {
  double corner[3], side;  // metres
  int64_t shape[3];
};

struct RaysJob {
  Cells cells;
  int64_t views;
  const int64_t* first;  // (views + 1) first end of each view
  const double *centre, *ends;  // (views, 3) and (ends, 3) metres
  double from, up_to;           // metres from the centre, and share of the way to an end
  int32_t *through, *ended;     // one of each cell; views add up
};

struct SeenThroughJob {
  Cells cells;
  const int32_t *through, *ended;
  const double* xyz;  // (points, 3) metres
  double doubt;
  double* share;  // (points)
};

}  // namespace room2dgs

#define R2_FREE_SPACE_KERNELS(isa)                                                     \
  namespace isa {                                                                      \
  /* `marks`: a byte for each cell, 0 before and afterwards. */                        \
  void count_rays(const room2dgs::RaysJob& job, int64_t view, uint8_t* marks);         \
  void seen_through(const room2dgs::SeenThroughJob& job, int64_t first, int64_t last); \
  }
R2_EACH_ISA(R2_FREE_SPACE_KERNELS)
#undef R2_FREE_SPACE_KERNELS
