#include <cmath>

#include "fusion.h"

namespace R2_ISA {

using room2dgs::FusionJob;
using room2dgs::kBlockSide;

// Curless and Levoy 1996: the weighted mean of truncated distances along the view's axis.
void fuse_block(const FusionJob& job, int64_t index) {
  const int32_t* block = job.block + 3 * index;
  const int64_t first = job.row[index] * room2dgs::kBlockVoxels;
  const double* m = job.pixel_from_voxel;
  int64_t voxel = first;
  for (int z = 0; z < kBlockSide; ++z)
    for (int y = 0; y < kBlockSide; ++y)
      for (int x = 0; x < kBlockSide; ++x, ++voxel) {
        const double at[3] = {8.0 * block[0] + x, 8.0 * block[1] + y, 8.0 * block[2] + z};
        const double near = m[8] * at[0] + m[9] * at[1] + m[10] * at[2] + m[11];
        if (!(near > 0)) continue;
        const double u = (m[0] * at[0] + m[1] * at[1] + m[2] * at[2] + m[3]) / near;
        const double v = (m[4] * at[0] + m[5] * at[1] + m[6] * at[2] + m[7]) / near;
        if (!(u >= 0 && v >= 0 && u < job.width && v < job.height)) continue;
        const int64_t pixel = static_cast<int64_t>(v) * job.width + static_cast<int64_t>(u);
        const float depth = job.depth[pixel], trust = job.trust[pixel];
        const float distance = (depth - static_cast<float>(near)) / job.truncation;
        if (!(depth > 0 && trust > 0 && distance >= -1)) continue;
        const float before = job.weight[voxel], share = trust / (before + trust);
        job.distance[voxel] += share * ((distance < 1 ? distance : 1) - job.distance[voxel]);
        for (int k = 0; k < 3; ++k)
          job.color[3 * voxel + k] += share * (job.photo[3 * pixel + k] - job.color[3 * voxel + k]);
        job.weight[voxel] = before + trust;
        job.views[voxel] += 1;
      }
}

}  // namespace R2_ISA
