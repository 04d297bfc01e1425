// What a voxel takes from a depth map, and which blocks of voxels a pixel touches; for the CPU's kernel and block code.
#pragma once

#include <cmath>

#include "fusion.h"
#include "scalar.h"

namespace R2_ISA {

using room2dgs::FusionJob;
using room2dgs::kBlockSide;
using room2dgs::kBlockVoxels;

// Curless and Levoy 1996: the weighted mean of truncated distances along the view's axis. `inner` is the voxel's number
// in its block, `voxel` its place in the table.
R2_HD void fuse_voxel(const FusionJob& job, const int32_t* block, int inner, int64_t voxel) {
  const double* m = job.pixel_from_voxel;
  const double at[3] = {8.0 * block[0] + inner % kBlockSide, 8.0 * block[1] + inner / kBlockSide % kBlockSide,
                        8.0 * block[2] + inner / (kBlockSide * kBlockSide)};
  const double near = m[8] * at[0] + m[9] * at[1] + m[10] * at[2] + m[11];
  if (!(near > 0)) return;
  const double u = (m[0] * at[0] + m[1] * at[1] + m[2] * at[2] + m[3]) / near;
  const double v = (m[4] * at[0] + m[5] * at[1] + m[6] * at[2] + m[7]) / near;
  if (!(u >= 0 && v >= 0 && u < static_cast<double>(job.width) && v < static_cast<double>(job.height))) return;
  const int64_t pixel = static_cast<int64_t>(v) * job.width + static_cast<int64_t>(u);
  const float depth = job.depth[pixel], trust = job.trust[pixel];
  const float distance = (depth - static_cast<float>(near)) / job.truncation;
  if (!(depth > 0 && trust > 0 && distance >= -1)) return;
  const float before = job.weight[voxel], share = trust / (before + trust);
  job.distance[voxel] += share * ((distance < 1 ? distance : 1) - job.distance[voxel]);
  for (int k = 0; k < 3; ++k)
    job.color[3 * voxel + k] += share * (job.photo[3 * pixel + k] - job.color[3 * voxel + k]);
  job.weight[voxel] = before + trust;
  job.views[voxel] += 1;
}

}  // namespace R2_ISA
