// The normal prior's loss as block code, a thread a pixel of the prior (normal_prior_maths.h). Value and gradient are
// sums yet: what they are divided by is known at the end alone.
#include "block_losses.h"
#include "normal_prior_maths.h"

namespace R2_ISA {
namespace {

struct NormalPrior {
  static constexpr int kThreads = 256, kNumbers = 2;
  struct Shared {
    double parts[kThreads / kWarp][kNumbers], sums[kNumbers];
  };
  NormalMaps maps;
  float l1, cosine;
  float* gradient;
  double* parts;  // of each block the cost and the number of pixels

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    Own<Sums<double, kNumbers>, kThreads> mine;
    block.threads([&](int thread) {
      double* sum = mine[thread].value;
      sum[0] = 0, sum[1] = 0;
      const int64_t i = block.place(thread);
      if (i >= maps.height * maps.width) return;
      const int64_t at = i / maps.width * maps.step * maps.rendered_width + i % maps.width * maps.step;
      float* to = gradient + 3 * at;
      to[0] = to[1] = to[2] = 0;
      if (!maps.valid[i] || !(maps.alpha[at] >= kNormalMinAlpha)) return;
      const float *n = maps.normal + 3 * at, *p = maps.prior + 3 * i;
      const NormalLoss<float> loss = normal_loss<float>({n[0], n[1], n[2]}, {p[0], p[1], p[2]},
                                                        maps.confidence ? maps.confidence[i] : 1.0f, l1, cosine);
      sum[0] = loss.value, sum[1] = 1;
      to[0] = loss.gradient.x, to[1] = loss.gradient.y, to[2] = loss.gradient.z;
    });
    block.sums(mine, s.parts, s.sums);
    block.threads([&](int thread) {
      if (thread < kNumbers) parts[kNumbers * block.index() + thread] = s.sums[thread];
    });
  }
};

// The mean, and what makes means of gradients: 1 / number of pixels.
struct MeanOfNormals : AddParts<double, NormalPrior::kNumbers> {
  double* to;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    add(block, s);
    block.threads([&](int thread) {
      if (thread > 0) return;
      to[1] = 1.0 / (s.sums[1] > 1.0 ? s.sums[1] : 1.0);
      to[0] = s.sums[0] * to[1];
    });
  }
};

}  // namespace

void BlockLosses::normal_prior(const Queue& queue, const NormalMaps& maps, float l1, float cosine, float* gradient,
                               double* values) {
  const int64_t blocks = blocks_for(maps.height * maps.width, NormalPrior::kThreads);
  double* sums = parts.grow(queue, NormalPrior::kNumbers * blocks);
  if (maps.step > 1)
    fill_bytes(queue, gradient, 0, 3 * sizeof(float) * static_cast<size_t>(maps.rendered_height * maps.rendered_width));
  launch(queue, blocks, NormalPrior{maps, l1, cosine, gradient, sums});
  launch(queue, 1, MeanOfNormals{{sums, blocks}, values});
}

}  // namespace R2_ISA
