// Chambolle and Pock 2011, algorithm 1, with the Huber norm of their section 6.2.3. Each block writes to itself alone.
#include "regularise.h"

#include <cmath>

namespace R2_ISA {

using room2dgs::kMostSide;
using room2dgs::kRegulariseStep;
using room2dgs::RegulariseJob;

namespace {

template <int S>
void dual_step(const RegulariseJob& job, int64_t block) {
  constexpr int kCount = S * S * S;
  const float* own = job.ahead + block * kCount;
  const int32_t* around = job.neighbour + 6 * block;
  const float* next[3];
  for (int k = 0; k < 3; ++k) next[k] = around[3 + k] < 0 ? nullptr : job.ahead + around[3 + k] * int64_t{kCount};
  float* p = job.dual + block * 3 * kCount;
  const float shrink = 1 / (1 + kRegulariseStep * job.soft / job.share);
  for (int z = 0; z < S; ++z)
    for (int y = 0; y < S; ++y) {
      const int at = (z * S + y) * S;
      float gradient[3][S];
      for (int x = 0; x + 1 < S; ++x) gradient[0][x] = own[at + x + 1] - own[at + x];
      gradient[0][S - 1] = next[0] ? next[0][at] - own[at + S - 1] : 0;
      const float* below = y + 1 < S ? own + at + S : next[1] ? next[1] + z * S * S : nullptr;
      const float* behind = z + 1 < S ? own + at + S * S : next[2] ? next[2] + y * S : nullptr;
      for (int x = 0; x < S; ++x) gradient[1][x] = below ? below[x] - own[at + x] : 0;
      for (int x = 0; x < S; ++x) gradient[2][x] = behind ? behind[x] - own[at + x] : 0;
      for (int x = 0; x < S; ++x) {
        float moved[3], squares = 0;
        for (int k = 0; k < 3; ++k) {
          moved[k] = (p[k * kCount + at + x] + kRegulariseStep * gradient[k][x]) * shrink;
          squares += moved[k] * moved[k];
        }
        const float length = std::sqrt(squares);
        const float scale = length > job.share ? job.share / length : 1;
        for (int k = 0; k < 3; ++k) p[k * kCount + at + x] = moved[k] * scale;
      }
    }
}

template <int S>
void primal_step(const RegulariseJob& job, int64_t block) {
  constexpr int kCount = S * S * S;
  const int32_t* around = job.neighbour + 6 * block;
  const float *p[3], *before[3];
  for (int k = 0; k < 3; ++k) {
    p[k] = job.dual + (block * 3 + k) * kCount;
    before[k] = around[k] < 0 ? nullptr : job.dual + (around[k] * int64_t{3} + k) * kCount;
  }
  const float *data = job.data + block * kCount, *weight = job.weight + block * kCount;
  float *value = job.value + block * kCount, *ahead = job.ahead + block * kCount;
  for (int z = 0; z < S; ++z)
    for (int y = 0; y < S; ++y) {
      const int at = (z * S + y) * S;
      float divergence[S];
      divergence[0] = p[0][at] - (before[0] ? before[0][at + S - 1] : 0);
      for (int x = 1; x < S; ++x) divergence[x] = p[0][at + x] - p[0][at + x - 1];
      const float* above = y > 0 ? p[1] + at - S : before[1] ? before[1] + (z * S + S - 1) * S : nullptr;
      const float* front = z > 0 ? p[2] + at - S * S : before[2] ? before[2] + ((S - 1) * S + y) * S : nullptr;
      for (int x = 0; x < S; ++x) divergence[x] += p[1][at + x] - (above ? above[x] : 0);
      for (int x = 0; x < S; ++x) divergence[x] += p[2][at + x] - (front ? front[x] : 0);
      for (int x = 0; x < S; ++x) {
        const float pull = kRegulariseStep * weight[at + x], old = value[at + x];
        const float found = (old + kRegulariseStep * divergence[x] + pull * data[at + x]) / (1 + pull);
        value[at + x] = found;
        ahead[at + x] = 2 * found - old;
      }
    }
}

}  // namespace

void regularise_dual(const RegulariseJob& job, int64_t block) {
  static_assert(kMostSide == 8, "");
  switch (job.side) {
    case 1: return dual_step<1>(job, block);
    case 2: return dual_step<2>(job, block);
    case 4: return dual_step<4>(job, block);
    default: return dual_step<8>(job, block);
  }
}

void regularise_primal(const RegulariseJob& job, int64_t block) {
  switch (job.side) {
    case 1: return primal_step<1>(job, block);
    case 2: return primal_step<2>(job, block);
    case 4: return primal_step<4>(job, block);
    default: return primal_step<8>(job, block);
  }
}

}  // namespace R2_ISA
