// The arguments of fusion, for the CPU's kernel and for block code.
#pragma once

#include <cmath>

#include "../mesh/csrc/fusion.h"
#include "arrays.h"

namespace room2dgs {

// `check` is for the arrays of the volume and the view, `host` for the matrix.
inline FusionJob fusion_job(Arguments& check, Arguments& host, const Input& block, const Input& row,
                            const Output& distance, const Output& weight, const Output& views, const Output& color,
                            const Input& depth, const Input& trust, const Input& photo, const Input& pixel_from_voxel,
                            double truncation) {
  const int64_t blocks = lengths("block", block, 2)[0], rows = lengths("distance", distance, 2)[0];
  const auto size = lengths("depth", depth, 2);
  FusionJob job;
  job.block = check.input<int32_t>("block", block, {blocks, 3});
  job.row = check.input<int64_t>("row", row, {blocks});
  job.distance = check.output<float>("distance", distance, {rows, kBlockVoxels});
  job.weight = check.output<float>("weight", weight, {rows, kBlockVoxels});
  job.views = check.output<float>("views", views, {rows, kBlockVoxels});
  job.color = check.output<float>("color", color, {rows, 3 * kBlockVoxels});
  job.height = size[0], job.width = size[1];
  job.depth = check.input<float>("depth", depth, {size[0], size[1]});
  job.trust = check.input<float>("trust", trust, {size[0], size[1]});
  job.photo = check.input<float>("photo", photo, {size[0], size[1], 3});
  const double* matrix = host.input<double>("pixel_from_voxel", pixel_from_voxel, {3, 4});
  for (int k = 0; k < 12; ++k) job.pixel_from_voxel[k] = matrix[k];
  require(std::isfinite(truncation) && truncation > 0, "truncation is not above 0");
  job.truncation = static_cast<float>(truncation);
  return job;
}

}  // namespace room2dgs
