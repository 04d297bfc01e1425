// Fusion of depth maps: the blocks that a view touches, a thread a pixel; its depth into them, a thread a voxel.
#include "block_fusion.h"

#include <cmath>

#include "fusion_maths.h"

namespace R2_ISA {
namespace {

struct TouchBlocks {
  static constexpr int kThreads = 256;
  struct Shared {};
  TouchJob job;

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    block.threads([&](int thread) {
      const int64_t i = block.place(thread), columns = job.width / kTouchStride;
      if (i >= columns * (job.height / kTouchStride)) return;
      const int64_t y = i / columns * kTouchStride, x = i % columns * kTouchStride;
      const float depth = job.depth[y * job.width + x];
      const bool valid = depth > 0 && depth < 1e30f;
      const float* m = job.local_from_cam;
      const float across = (static_cast<float>(x) - job.cx) / job.fx, down = (static_cast<float>(y) - job.cy) / job.fy;
      float direction[3];
      for (int k = 0; k < 3; ++k)
        direction[k] = across * m[4 * k] + down * m[4 * k + 1] + m[4 * k + 2] + m[4 * k + 3] - m[4 * k + 3];
      const float nearest = depth - job.truncation > 0 ? depth - job.truncation : 0.0f;
      const float step = (depth + job.truncation - nearest) / (kTouchSteps - 1);
      float t = nearest;
      int64_t last = -1;
      for (int s = 0; s < kTouchSteps; ++s, t += step) {
        int64_t key = 0;
        bool inside = valid;
        for (int k = 0; k < 3; ++k) {
          const float cell = ::floorf((m[4 * k + 3] + t * direction[k]) / job.side);
          inside = inside && cell >= -static_cast<float>(kTouchHalf) && cell < static_cast<float>(kTouchHalf);
          key = key * (2 * kTouchHalf) + (inside ? static_cast<int64_t>(cell) + kTouchHalf : 0);
        }
        job.keys[i * kTouchSteps + s] = inside && key != last ? key : -1;
        last = inside ? key : last;
      }
    });
  }
};

struct FuseBlocks {
  static constexpr int kThreads = kBlockVoxels;
  struct Shared {};
  FusionJob job;
  int64_t rows;

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    const int64_t row = job.row[block.index()];
    if (row < 0 || row >= rows) return;
    const int32_t* at = job.block + 3 * block.index();
    block.threads([&](int thread) { fuse_voxel(job, at, thread, row * kBlockVoxels + thread); });
  }
};

}  // namespace

void touch_blocks(const Queue& queue, const TouchJob& job) {
  launch(queue, blocks_for(touched_pixels(job.height, job.width), TouchBlocks::kThreads), TouchBlocks{job});
}

void fuse_blocks(const Queue& queue, const FusionJob& job, int64_t blocks, int64_t rows) {
  launch(queue, blocks, FuseBlocks{job, rows});
}

}  // namespace R2_ISA
