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
      const int64_t i = block.place(thread);
      if (i < job.height / kTouchStride * (job.width / kTouchStride)) touch_pixel(job, i);
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
  launch(queue, blocks_for(room2dgs::touched_pixels(job.height, job.width), TouchBlocks::kThreads), TouchBlocks{job});
}

void fuse_blocks(const Queue& queue, const FusionJob& job, int64_t blocks, int64_t rows) {
  launch(queue, blocks, FuseBlocks{job, rows});
}

}  // namespace R2_ISA
