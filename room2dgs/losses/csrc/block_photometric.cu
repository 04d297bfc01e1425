// L1 and structural dissimilarity with their gradient (ssim.h), a block a patch of 16 x 16 pixels: the maps first, whose
// window sums are the gradient, then these sums. Filters run in the order of the CPU's kernels.
#include "block_losses.h"
#include "block_total.h"
#include "ssim.h"

namespace R2_ISA {
namespace {

constexpr int kPatch = 16, kSide = kPatch + 2 * kReach, kPatchPixels = kPatch * kPatch;

// A patch and its frame of five pixels; images are (height, width, 3).
struct PatchOf {
  int64_t height, width;
  int64_t x, y;  // of its first pixel
  R2_KERNEL PatchOf(int64_t h, int64_t w, int64_t index)
      : height(h), width(w), x(index % ((w + kPatch - 1) / kPatch) * kPatch), y(index / ((w + kPatch - 1) / kPatch) * kPatch) {}
  R2_KERNEL bool inside(int row, int column) const {
    return y + row >= 0 && y + row < height && x + column >= 0 && x + column < width;
  }
  R2_KERNEL int64_t at(int row, int column, int channel) const { return ((y + row) * width + x + column) * 3 + channel; }
};

// Eleven taps centred on p.
R2_HD float along_row(const float* p) {
  const float window[kTaps] = R2_SSIM_WINDOW;
  float sum = p[0] * window[kReach];
#ifdef __CUDACC__
#pragma unroll
#endif
  for (int k = 1; k <= kReach; ++k) sum = fma(p[-k] + p[k], window[kReach + k], sum);
  return sum;
}

struct SsimOfPatches {
  static constexpr int kThreads = kPatchPixels;
  struct Shared {
    float x[kSide][kSide], y[kSide][kSide];
    float mean[4][kPatch][kSide];  // down the columns
    float parts[kThreads / kWarp][2], sums[2];
  };
  const float *rendered, *target;
  int64_t height, width;
  float* maps;    // three images; null where no gradient is wanted
  double* parts;  // two of each block: |x - y| and 1 - SSIM

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    const PatchOf patch(height, width, block.index());
    const int64_t values = height * width * 3;
    Own<Sums<float, 2>, kThreads> mine;
    block.threads([&](int thread) { mine[thread].value[0] = mine[thread].value[1] = 0; });
    for (int c = 0; c < 3; ++c) {
      block.threads([&](int thread) {
        for (int k = thread; k < kSide * kSide; k += kThreads) {
          const int row = k / kSide - kReach, column = k % kSide - kReach;
          const bool inside = patch.inside(row, column);
          const int64_t i = inside ? patch.at(row, column, c) : 0;
          s.x[row + kReach][column + kReach] = inside ? rendered[i] : 0.0f;
          s.y[row + kReach][column + kReach] = inside ? target[i] : 0.0f;
        }
      });
      block.threads([&](int thread) {
        const float window[kTaps] = R2_SSIM_WINDOW;
        for (int k = thread; k < kPatch * kSide; k += kThreads) {
          const int row = k / kSide, column = k % kSide;
          Moments<float> sum = {0, 0, 0, 0};
          if (patch.x + column - kReach >= 0 && patch.x + column - kReach < width) {
#ifdef __CUDACC__
#pragma unroll
#endif
            for (int t = 0; t < kTaps; ++t) {
              const Moments<float> at = moments_of(s.x[row + t][column], s.y[row + t][column]);
              sum = {fma(at.x, window[t], sum.x), fma(at.d, window[t], sum.d), fma(at.dd, window[t], sum.dd),
                     fma(at.q, window[t], sum.q)};
            }
          } else {
            sum = {-0.5f, 0.0f, 0.0f, 0.5f};  // kPadding
          }
          s.mean[0][row][column] = sum.x, s.mean[1][row][column] = sum.d;
          s.mean[2][row][column] = sum.dd, s.mean[3][row][column] = sum.q;
        }
      });
      block.threads([&](int thread) {
        const int row = thread / kPatch, column = thread % kPatch, k = column + kReach;
        if (!patch.inside(row, column)) return;
        const SsimMaps<float> r = ssim_maps_of<float>({along_row(s.mean[0][row] + k), along_row(s.mean[1][row] + k),
                                                       along_row(s.mean[2][row] + k), along_row(s.mean[3][row] + k)});
        const float d = s.x[row + kReach][k] - s.y[row + kReach][k];
        mine[thread].value[0] += vmax(d, -d);
        mine[thread].value[1] += r.loss;
        if (!maps) return;
        const int64_t i = patch.at(row, column, c);
        maps[i] = r.map0, maps[values + i] = r.map1, maps[2 * values + i] = r.map2;
      });
    }
    block.sums(mine, s.parts, s.sums);
    block.threads([&](int thread) {
      if (thread < 2) parts[2 * block.index() + thread] = s.sums[thread];
    });
  }
};

struct SsimGradient {
  static constexpr int kThreads = kPatchPixels;
  struct Shared {
    float maps[3][kSide][kSide];
    float rows[3][kSide][kPatch];  // filtered along them
  };
  const float *rendered, *target, *maps;
  int64_t height, width;
  float l1_scale, dssim_scale;
  float* gradient;

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    const PatchOf patch(height, width, block.index());
    const int64_t values = height * width * 3;
    for (int c = 0; c < 3; ++c) {
      block.threads([&](int thread) {
        for (int k = thread; k < kSide * kSide; k += kThreads) {
          const int row = k / kSide - kReach, column = k % kSide - kReach;
          const bool inside = patch.inside(row, column);
          const int64_t i = inside ? patch.at(row, column, c) : 0;
          for (int m = 0; m < 3; ++m) s.maps[m][row + kReach][column + kReach] = inside ? maps[m * values + i] : 0.0f;
        }
      });
      block.threads([&](int thread) {
        for (int k = thread; k < 3 * kSide * kPatch; k += kThreads) {
          const int m = k / (kSide * kPatch), row = k / kPatch % kSide, column = k % kPatch;
          s.rows[m][row][column] = along_row(s.maps[m][row] + column + kReach);
        }
      });
      block.threads([&](int thread) {
        const float window[kTaps] = R2_SSIM_WINDOW;
        const int row = thread / kPatch, column = thread % kPatch;
        if (!patch.inside(row, column)) return;
        float sum[3] = {0, 0, 0};
#ifdef __CUDACC__
#pragma unroll
#endif
        for (int t = 0; t < kTaps; ++t)
          for (int m = 0; m < 3; ++m) sum[m] = fma(s.rows[m][row + t][column], window[t], sum[m]);
        const int64_t i = patch.at(row, column, c);
        gradient[i] = rgb_gradient(rendered[i], rendered[i] - target[i], sum[0], sum[1], sum[2], l1_scale, dssim_scale);
      });
    }
  }
};

}  // namespace

void BlockLosses::rgb_loss(const Queue& queue, const float* rendered, const float* target, int64_t height,
                           int64_t width, double dssim, float* gradient, double* values) {
  const int64_t blocks = blocks_for(height, kPatch) * blocks_for(width, kPatch), count = height * width * 3;
  double* sums = parts.grow(queue, 2 * blocks);
  float* three = gradient ? maps.grow(queue, 3 * count) : nullptr;
  launch(queue, blocks, SsimOfPatches{rendered, target, height, width, three, sums});
  launch(queue, 1, TotalOfBlocks<2>{{sums, blocks}, 1.0 / static_cast<double>(count), 2, values});
  if (!gradient) return;
  launch(queue, blocks, SsimGradient{rendered, target, three, height, width,
                                     static_cast<float>((1.0 - dssim) / static_cast<double>(count)),
                                     static_cast<float>(dssim / static_cast<double>(count)), gradient});
}

}  // namespace R2_ISA
