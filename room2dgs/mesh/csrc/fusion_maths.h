// What a voxel takes from a depth map, and which blocks of voxels a pixel touches; for the CPU's kernel and block code.
#pragma once

#include <cmath>

#include "fusion.h"
#include "scalar.h"

namespace R2_ISA {

using room2dgs::FusionJob;
using room2dgs::kBlockSide;
using room2dgs::kBlockVoxels;
using room2dgs::kTouchHalf;
using room2dgs::kTouchSteps;
using room2dgs::kTouchStride;
using room2dgs::TouchJob;

// Metres in front of the surface that a pixel sees: from the plane through the pixel's point, or along the view's axis
// where nobody knows its normal. NaN where the pixel says nothing of the place.
R2_HD double in_front(const FusionJob& job, const double* at, int64_t pixel, double depth, double near) {
  const float* n = job.normal + 3 * pixel;
  const double* back = job.voxel_from_pixel;
  const double u = static_cast<double>(pixel % job.width) + 0.5, v = static_cast<double>(pixel / job.width) + 0.5;
  double before_eye = 0, towards = 0;  // along the normal: the voxel from the camera, the camera from depth 1
  for (int k = 0; k < 3; ++k) {
    before_eye += static_cast<double>(n[k]) * (at[k] - job.eye[k]);
    towards -= static_cast<double>(n[k]) * (back[3 * k] * u + back[3 * k + 1] * v + back[3 * k + 2]);
  }
  if (!(towards > 0)) return depth - near;
  // a slanted surface reaches further back along the axis, but what is there is often hidden by another one
  return near - depth > static_cast<double>(job.truncation)
             ? static_cast<double>(NAN)
             : (before_eye + depth * towards) * static_cast<double>(job.voxel);
}

// Curless and Levoy 1996: the weighted mean of truncated distances. `inner` is the voxel's number in its block, `voxel`
// its place in the table.
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
  if (!(depth > 0 && trust > 0)) return;
  const float distance = static_cast<float>(in_front(job, at, pixel, depth, near)) / job.truncation;
  if (!(distance >= -1)) return;
  const float before = job.weight[voxel], share = trust / (before + trust);
  job.distance[voxel] += share * ((distance < 1 ? distance : 1) - job.distance[voxel]);
  for (int k = 0; k < 3; ++k)
    job.color[3 * voxel + k] += share * (job.photo[3 * pixel + k] - job.color[3 * voxel + k]);
  job.weight[voxel] = before + trust;
  job.views[voxel] += 1;
}

// The blocks that lie across the surface at the i-th pixel that is looked at, into its keys.
R2_HD void touch_pixel(const TouchJob& job, int64_t i) {
  const int64_t columns = job.width / kTouchStride;
  const int64_t y = i / columns * kTouchStride, x = i % columns * kTouchStride, pixel = y * job.width + x;
  const float depth = job.depth[pixel];
  const float* n = job.normal + 3 * pixel;
  const float* m = job.local_from_cam;
  const float right = (static_cast<float>(x) + 0.5f - job.cx) / job.fx;
  const float down = (static_cast<float>(y) + 0.5f - job.cy) / job.fy;
  float ray[3], towards = 0;
  for (int k = 0; k < 3; ++k) {
    ray[k] = right * m[4 * k] + down * m[4 * k + 1] + m[4 * k + 2];
    towards -= n[k] * ray[k];
  }
  int64_t last = -1;
  for (int s = 0; s < kTouchSteps; ++s) {
    const float away = job.truncation * (2.0f * static_cast<float>(s) / (kTouchSteps - 1) - 1);
    bool inside = depth > 0 && depth < 1e30f;
    int64_t key = 0;
    for (int k = 0; k < 3; ++k) {
      const float along = towards > 0 ? n[k] : ray[k];
      const float cell = ::floorf((m[4 * k + 3] + depth * ray[k] + away * along) / job.side);
      inside = inside && cell >= -static_cast<float>(kTouchHalf) && cell < static_cast<float>(kTouchHalf);
      key = key * (2 * kTouchHalf) + (inside ? static_cast<int64_t>(cell) + kTouchHalf : 0);
    }
    job.keys[i * kTouchSteps + s] = inside && key != last ? key : -1;
    last = inside ? key : last;
  }
}

}  // namespace R2_ISA
