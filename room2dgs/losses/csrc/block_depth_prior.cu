// The depth prior's loss as block code, a thread a pixel (depth_prior_maths.h): sums that align the prior, then value
// and gradient, gathered from a pixel's neighbours at all strides. The host sees none of the sums.
#include "block_losses.h"
#include "block_total.h"

namespace R2_ISA {
namespace {

constexpr int kThreadsOfPixels = 256;

struct DepthMoments {
  static constexpr int kThreads = kThreadsOfPixels;
  struct Shared {
    double parts[kThreads / kWarp][kDepthSums], sums[kDepthSums];
  };
  DepthMaps maps;
  int levels;
  double* parts;

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    Own<Sums<double, kDepthSums>, kThreads> mine;
    block.threads([&](int thread) {
      double* sum = mine[thread].value;
      for (int k = 0; k < kDepthSums; ++k) sum[k] = 0;
      const int64_t i = block.place(thread);
      if (i >= maps.height * maps.width) return;
      const DepthPixel p = depth_pixel(maps, i);
      if (!p.compared) return;
      const double w = p.weight, wp = w * p.prior, wx = w * p.rendered;
      sum[0] = 1, sum[1] = w, sum[2] = wp, sum[3] = wx;
      sum[4] = wp * p.prior, sum[5] = wp * p.rendered, sum[6] = wx * p.rendered;
      const int64_t row = i / maps.width, column = i % maps.width;
#ifdef __CUDACC__
#pragma unroll
#endif
      for (int level = 0; level < kDepthLevels; ++level) {
        const int64_t stride = int64_t(1) << level;
        if (level >= levels || row % stride || column % stride) continue;
        sum[7 + 2 * level] = column + stride < maps.width && depth_pixel(maps, i + stride).compared;
        sum[8 + 2 * level] = row + stride < maps.height && depth_pixel(maps, i + stride * maps.width).compared;
      }
    });
    block.sums(mine, s.parts, s.sums);
    block.threads([&](int thread) {
      if (thread < kDepthSums) parts[kDepthSums * block.index() + thread] = s.sums[thread];
    });
  }
};

struct FitDepth : AddParts<double, kDepthSums> {
  bool align;
  double gradient_weight;
  int levels;
  DepthFit* fit;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    add(block, s);
    block.threads([&](int thread) {
      if (thread == 0) *fit = depth_fit(s.sums, align, gradient_weight, levels);
    });
  }
};

struct DepthGradient {
  static constexpr int kThreads = kThreadsOfPixels;
  struct Shared {
    double parts[kThreads / kWarp][1], sums[1];
  };
  DepthMaps maps;
  const DepthFit* from;
  float* gradient;
  double* parts;

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    Own<Sums<double, 1>, kThreads> mine;
    block.threads([&](int thread) {
      mine[thread].value[0] = 0;
      const int64_t i = block.place(thread);
      if (i >= maps.height * maps.width) return;
      const DepthAlignment fit = from->alignment;
      const DepthPixel p = depth_pixel(maps, i);
      gradient[i] = 0;
      if (!p.compared || fit.mean == 0.0f) return;
      const float r = depth_residual(p, fit), weighted = p.weight * r;
      double value = static_cast<double>(weighted * r) * fit.mean;
      float g = 2.0f * fit.mean * weighted;
      const int64_t row = i / maps.width, column = i % maps.width;
      for (int level = 0; level < kDepthLevels; ++level) {
        const int64_t stride = int64_t(1) << level;
        if (row % stride || column % stride) break;
#ifdef __CUDACC__
#pragma unroll 1
#endif
        for (int along = 0; along < 2; ++along) {
          const float share = from->shares[level][along];
          const int64_t place = along ? row : column, length = along ? maps.height : maps.width;
          const int64_t step = along ? stride * maps.width : stride;
          if (share == 0.0f) continue;
          if (place + stride < length) {
            const DepthPair next = depth_pair(p, depth_pixel(maps, i + step), fit);
            value += static_cast<double>(share) * vmax(next.difference, -next.difference);
            g -= next.difference > 0.0f ? next.trust * share : next.difference < 0.0f ? -next.trust * share : 0.0f;
          }
          if (place >= stride) {
            const DepthPair before = depth_pair(depth_pixel(maps, i - step), p, fit);
            g += before.difference > 0.0f ? before.trust * share : before.difference < 0.0f ? -before.trust * share : 0.0f;
          }
        }
      }
      mine[thread].value[0] = value;
      gradient[i] = g * fit.inverse_unit * (maps.disparity ? -p.rendered * p.rendered : 1.0f);
    });
    block.sums(mine, s.parts, s.sums);
    block.threads([&](int thread) {
      if (thread == 0) parts[block.index()] = s.sums[0];
    });
  }
};

}  // namespace

void BlockLosses::depth_prior(const Queue& queue, const DepthMaps& maps, bool align, double gradient_weight, int levels,
                              float* gradient, double* values) {
  const int64_t blocks = blocks_for(maps.height * maps.width, kThreadsOfPixels);
  double* sums = parts.grow(queue, kDepthSums * blocks);
  DepthFit* aligned = fit.grow(queue, 1);
  launch(queue, blocks, DepthMoments{maps, levels, sums});
  launch(queue, 1, FitDepth{{sums, blocks}, align, gradient_weight, levels, aligned});
  launch(queue, blocks, DepthGradient{maps, aligned, gradient, sums});
  launch(queue, 1, TotalOfBlocks<1>{{sums, blocks}, 1.0, 1, values});
}

}  // namespace R2_ISA
