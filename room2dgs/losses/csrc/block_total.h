// The last step of a loss: what each block left, added up.
#pragma once

#include "launch.h"

namespace R2_ISA {

// to[k] = the sum over the blocks of their k-th number, that of the first `scaled` ones times `scale`
template <int n>
struct TotalOfBlocks : AddParts<double, n> {
  using Parts = AddParts<double, n>;
  double scale;
  int scaled;
  double* to;
  R2_KERNEL void operator()(const Block<Parts::kThreads>& block, typename Parts::Shared& s) const {
    Parts::add(block, s);
    block.threads([&](int thread) {
      if (thread < n) to[thread] = s.sums[thread] * (thread < scaled ? scale : 1.0);
    });
  }
};

}  // namespace R2_ISA
