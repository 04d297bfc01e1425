// One depth map into a truncated signed distance volume, one block of voxels at a time.
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

constexpr int kBlockSide = 8;
constexpr int kBlockVoxels = kBlockSide * kBlockSide * kBlockSide;

// A volume holds its blocks in rows of a table; voxels of a block lie in the order z, y, x.
struct FusionJob {
  const int32_t* block;    // (blocks, 3), the block's first voxel is at 8 * block voxels
  const int64_t* row;      // (blocks), where it lies in the table
  float* distance;         // (rows, 512), -1..1 in units of the truncation distance
  float* weight;           // (rows, 512)
  float* views;            // (rows, 512), how many depth maps have seen the voxel
  float* color;            // (rows, 512, 3)
  const float* depth;      // (height, width), 0 = invalid
  const float* normal;     // (height, width, 3), unit, in the volume's axes, towards the camera; 0 = unknown
  const float* trust;      // (height, width), what the pixel weighs
  const float* photo;      // (height, width, 3)
  int64_t height, width;
  double pixel_from_voxel[12];  // 3 x 4, from voxels to (u z, v z, z), z in metres
  double voxel_from_pixel[9];   // inverse of its left three columns
  double eye[3];                // the camera, voxels
  float voxel, truncation;      // metres
};

constexpr int kTouchStride = 2;   // pixels between those that are looked at
constexpr int kTouchSteps = 4;    // points across the truncation at each, its ends among them
constexpr int64_t kTouchHalf = int64_t{1} << 20;  // blocks on either side of the origin, at most

// Which blocks a depth map's surface is near.
struct TouchJob {
  const float* depth;   // (height, width), 0 = invalid
  const float* normal;  // (height, width, 3), as in FusionJob
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

}  // namespace room2dgs

#define R2_FUSION_KERNELS(isa)                                    \
  namespace isa {                                                 \
  void fuse_block(const room2dgs::FusionJob& job, int64_t index); \
  void touch_row(const room2dgs::TouchJob& job, int64_t row);     \
  }
R2_EACH_ISA(R2_FUSION_KERNELS)
#undef R2_FUSION_KERNELS
