// Fusion of depth maps as block code (block.h).
#pragma once

#include "fusion.h"
#include "launch.h"

namespace R2_ISA {

constexpr int kTouchStride = 4;   // pixels between those whose rays are followed
constexpr int kTouchSteps = 4;    // points on each ray within the truncation, its ends among them
constexpr int64_t kTouchHalf = int64_t{1} << 20;  // blocks on either side of the origin, at most

// Which blocks a depth map's surface is near, as open3d's VoxelBlockGrid has it.
struct TouchJob {
  const float* depth;  // (height, width), 0 = invalid
  int64_t height, width;
  float fx, fy, cx, cy;
  float local_from_cam[12];  // 3 x 4
  float side, truncation;    // of a block, and on either side of the surface; metres
  // (rows of pixels, columns, kTouchSteps): ((x + half) * 2 half + y + half) * 2 half + z + half, or -1; with repeats
  int64_t* keys;
};

inline int64_t touched_pixels(int64_t height, int64_t width) {
  return (height / kTouchStride) * (width / kTouchStride);
}

void touch_blocks(const Queue& queue, const TouchJob& job);

// Takes a depth map into `blocks` blocks, whose rows all differ; a row outside of 0..rows is passed over.
void fuse_blocks(const Queue& queue, const room2dgs::FusionJob& job, int64_t blocks, int64_t rows);

}  // namespace R2_ISA
