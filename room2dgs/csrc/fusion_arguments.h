// The arguments of fusion, for the CPU's kernel and for block code.
#pragma once

#include <cmath>

#include "../mesh/csrc/fusion.h"
#include "arrays.h"

namespace room2dgs {

// The inverse of the left three columns of a (3, 4) matrix; returns their determinant.
inline double inverse(const double* m, double* result) {
  const auto minor = [m](int i, int j) {  // of the rows and columns that come after i and j in turn
    const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
    return m[4 * a + c] * m[4 * b + d] - m[4 * a + d] * m[4 * b + c];
  };
  const double determinant = m[0] * minor(0, 0) + m[1] * minor(0, 1) + m[2] * minor(0, 2);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) result[3 * i + j] = minor(j, i) / determinant;
  return determinant;
}

// `check` is for the arrays of the volume and the view, `host` for the matrix.
inline FusionJob fusion_job(Arguments& check, Arguments& host, const Input& block, const Input& row,
                            const Output& distance, const Output& weight, const Output& views, const Output& color,
                            const Input& depth, const Input& normal, const Input& trust, const Input& photo,
                            const Input& pixel_from_voxel, double voxel, double truncation) {
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
  job.normal = check.input<float>("normal", normal, {size[0], size[1], 3});
  job.trust = check.input<float>("trust", trust, {size[0], size[1]});
  job.photo = check.input<float>("photo", photo, {size[0], size[1], 3});
  const double* matrix = host.input<double>("pixel_from_voxel", pixel_from_voxel, {3, 4});
  for (int k = 0; k < 12; ++k) job.pixel_from_voxel[k] = matrix[k];
  const double determinant = inverse(matrix, job.voxel_from_pixel);
  require(std::isfinite(determinant) && determinant != 0, "pixel_from_voxel has no inverse");
  for (int k = 0; k < 3; ++k) {
    const double* back = job.voxel_from_pixel + 3 * k;
    job.eye[k] = -(back[0] * matrix[3] + back[1] * matrix[7] + back[2] * matrix[11]);
  }
  require(std::isfinite(voxel) && voxel > 0 && std::isfinite(truncation) && truncation > 0,
          "voxel or truncation is not above 0");
  job.voxel = static_cast<float>(voxel), job.truncation = static_cast<float>(truncation);
  return job;
}

inline TouchJob touch_job(Arguments& check, Arguments& host, const Input& depth, const Input& normal, const Input& K,
                          const Input& local_from_cam, double side, double truncation, const Output& keys) {
  const auto size = lengths("depth", depth, 2);
  TouchJob job{};
  job.height = size[0], job.width = size[1];
  job.depth = check.input<float>("depth", depth, {size[0], size[1]});
  job.normal = check.input<float>("normal", normal, {size[0], size[1], 3});
  job.keys = check.output<int64_t>("keys", keys, {touched_pixels(size[0], size[1]), kTouchSteps});
  const double *k = host.input<double>("K", K, {3, 3}), *pose = host.input<double>("local_from_cam", local_from_cam, {3, 4});
  job.fx = static_cast<float>(k[0]), job.fy = static_cast<float>(k[4]);
  job.cx = static_cast<float>(k[2]), job.cy = static_cast<float>(k[5]);
  for (int i = 0; i < 12; ++i) job.local_from_cam[i] = static_cast<float>(pose[i]);
  require(std::isfinite(side) && side > 0 && std::isfinite(truncation) && truncation > 0,
          "side or truncation is not above 0");
  job.side = static_cast<float>(side), job.truncation = static_cast<float>(truncation);
  return job;
}

}  // namespace room2dgs
