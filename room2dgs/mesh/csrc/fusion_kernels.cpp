#include "fusion_maths.h"

namespace R2_ISA {

void fuse_block(const FusionJob& job, int64_t index) {
  const int64_t first = job.row[index] * kBlockVoxels;
  for (int inner = 0; inner < kBlockVoxels; ++inner) fuse_voxel(job, job.block + 3 * index, inner, first + inner);
}

void touch_row(const TouchJob& job, int64_t row) {
  const int64_t columns = job.width / kTouchStride;
  for (int64_t i = row * columns; i < (row + 1) * columns; ++i) touch_pixel(job, i);
}

}  // namespace R2_ISA
