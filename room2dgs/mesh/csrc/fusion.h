// One depth map into a truncated signed distance volume, one block of voxels at a time.
#pragma once

#include <cstdint>

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
  const float* trust;      // (height, width), what the pixel weighs
  const float* photo;      // (height, width, 3)
  int64_t height, width;
  double pixel_from_voxel[12];  // 3 x 4, from voxels to (u z, v z, z), z in metres
  float truncation;        // metres
};

}  // namespace room2dgs

namespace isa_baseline {
void fuse_block(const room2dgs::FusionJob& job, int64_t index);
}
namespace isa_avx2 {
void fuse_block(const room2dgs::FusionJob& job, int64_t index);
}
