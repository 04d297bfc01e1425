#include "fusion_maths.h"

namespace R2_ISA {

void fuse_block(const FusionJob& job, int64_t index) {
  const int64_t first = job.row[index] * kBlockVoxels;
  for (int inner = 0; inner < kBlockVoxels; ++inner) fuse_voxel(job, job.block + 3 * index, inner, first + inner);
}

}  // namespace R2_ISA
