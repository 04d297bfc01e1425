// Normals from depth and their consistency with the rendered ones (surface_maths.h), a block a patch of 16 x 16 pixels.
// A depth's gradient comes from the pixels beside it: those of the patch's frame are computed again, nothing is added to
// what another block writes.
#include "block_losses.h"
#include "block_total.h"
#include "surface_maths.h"

namespace R2_ISA {
namespace {

using room2dgs::Pinhole;

constexpr int kPatch = 16, kPatchPixels = kPatch * kPatch;

R2_HD int64_t patches_along(int64_t pixels) { return (pixels + kPatch - 1) / kPatch; }

R2_HD Pinhole pinhole_of(const float* K, const float* pose) {
  Pinhole camera = {K[0], K[4], K[2], K[5], {}};
  for (int k = 0; k < 9; ++k) camera.cam_from_world[k] = pose[4 * (k / 3) + k % 3];
  return camera;
}

// What is not a positive finite number is no depth.
R2_HD float depth_or_none(float d) { return d > 0.0f && d <= 3.402823466e38f ? d : 0.0f; }

// Pixel (row, column) of depths in rows of `stride`, with its four neighbours there too.
R2_HD SurfaceNormal<float> normal_at(const float* d, int stride, int64_t x, int64_t y, const Pinhole& camera) {
  return surface_normal_of<float>(d[0], d[1], d[-1], d[stride], d[-stride], static_cast<float>(x) + 0.5f - camera.cx,
                                  static_cast<float>(y) + 0.5f - camera.cy, camera);
}

// Depths of a patch and of `frame` pixels about it, 0 outside of the image.
template <int frame, int kThreads>
R2_HD void load_depths(int thread, const float* depth, int64_t height, int64_t width, int64_t x, int64_t y,
                       float (&to)[kPatch + 2 * frame][kPatch + 2 * frame]) {
  constexpr int kSide = kPatch + 2 * frame;
  for (int k = thread; k < kSide * kSide; k += kThreads) {
    const int64_t row = y + k / kSide - frame, column = x + k % kSide - frame;
    const bool inside = row >= 0 && row < height && column >= 0 && column < width;
    to[k / kSide][k % kSide] = inside ? depth_or_none(depth[row * width + column]) : 0.0f;
  }
}

struct DepthNormals {
  static constexpr int kThreads = kPatchPixels;
  struct Shared {
    float depth[kPatch + 2][kPatch + 2];
  };
  const float *depth, *K, *pose;
  int64_t height, width;
  float* normal;

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    const int64_t x = block.index() % patches_along(width) * kPatch, y = block.index() / patches_along(width) * kPatch;
    const Pinhole camera = pinhole_of(K, pose);
    block.threads([&](int thread) { load_depths<1, kThreads>(thread, depth, height, width, x, y, s.depth); });
    block.threads([&](int thread) {
      const int row = thread / kPatch, column = thread % kPatch;
      if (y + row >= height || x + column >= width) return;
      const SurfaceNormal<float> n = normal_at(&s.depth[row + 1][column + 1], kPatch + 2, x + column, y + row, camera);
      const Triple<float> world = to_world(camera.cam_from_world, n.n);
      float* to = normal + 3 * ((y + row) * width + x + column);
      to[0] = masked(n.valid, world.x), to[1] = masked(n.valid, world.y), to[2] = masked(n.valid, world.z);
    });
  }
};

struct NormalConsistency {
  static constexpr int kThreads = kPatchPixels, kRing = kPatch + 2, kNumbers = 10;
  struct Shared {
    float depth[kPatch + 4][kPatch + 4];
    float gp[kRing][kRing], gq[kRing][kRing];
    float parts[kThreads / kWarp][kNumbers], sums[kNumbers];
  };
  const float *depth, *alpha, *normal, *K, *pose;
  int64_t height, width;
  float scale;  // factor of a pixel's term in the gradients
  float *grad_depth, *grad_normal;
  double* parts;  // of each block the loss, then the gradient of the rotation

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    const int64_t x = block.index() % patches_along(width) * kPatch, y = block.index() / patches_along(width) * kPatch;
    const Pinhole camera = pinhole_of(K, pose);
    Own<Sums<float, kNumbers>, kThreads> mine;
    block.threads([&](int thread) {
      for (int k = 0; k < kNumbers; ++k) mine[thread].value[k] = 0;
      load_depths<2, kThreads>(thread, depth, height, width, x, y, s.depth);
    });
    block.threads([&](int thread) {
      for (int k = thread; k < kRing * kRing; k += kThreads) {
        const int row = k / kRing - 1, column = k % kRing - 1;
        s.gp[row + 1][column + 1] = s.gq[row + 1][column + 1] = 0;
        if (y + row < 0 || y + row >= height || x + column < 0 || x + column >= width) continue;
        const int64_t i = (y + row) * width + x + column;
        const Triple<float> world = {normal[3 * i], normal[3 * i + 1], normal[3 * i + 2]};
        const SurfaceNormal<float> n =
            normal_at(&s.depth[row + 2][column + 2], kPatch + 4, x + column, y + row, camera);
        const Consistency<float> c =
            consistency_of(n, to_camera(camera.cam_from_world, world), alpha[i], camera, scale);
        s.gp[row + 1][column + 1] = c.gp, s.gq[row + 1][column + 1] = c.gq;
        if (row < 0 || row >= kPatch || column < 0 || column >= kPatch) continue;
        const Triple<float> to = to_world(camera.cam_from_world, c.towards);
        grad_normal[3 * i] = to.x, grad_normal[3 * i + 1] = to.y, grad_normal[3 * i + 2] = to.z;
        const float t[3] = {c.towards.x, c.towards.y, c.towards.z}, w[3] = {world.x, world.y, world.z};
        float* sum = mine[thread].value;
        sum[0] += c.loss;
        for (int m = 0; m < 9; ++m) sum[1 + m] = fma(t[m / 3], w[m % 3], sum[1 + m]);
      }
    });
    block.threads([&](int thread) {
      const int row = thread / kPatch, column = thread % kPatch;
      if (y + row >= height || x + column >= width) return;
      const int r = row + 2, c = column + 2;
      grad_depth[(y + row) * width + x + column] = depth_gradient_of(
          s.depth[r][c - 2], s.gp[row + 1][column], s.depth[r][c + 2], s.gp[row + 1][column + 2],
          s.depth[r - 2][c], s.gq[row][column + 1], s.depth[r + 2][c], s.gq[row + 2][column + 1]);
    });
    block.sums(mine, s.parts, s.sums);
    block.threads([&](int thread) {
      if (thread < kNumbers) parts[kNumbers * block.index() + thread] = s.sums[thread];
    });
  }
};

}  // namespace

void BlockLosses::depth_normals(const Queue& queue, const float* depth, const float* K, const float* pose,
                                int64_t height, int64_t width, float* normal) {
  launch(queue, patches_along(height) * patches_along(width), DepthNormals{depth, K, pose, height, width, normal});
}

void BlockLosses::normal_consistency(const Queue& queue, const float* depth, const float* alpha, const float* normal,
                                     const float* K, const float* pose, int64_t height, int64_t width,
                                     float* grad_depth, float* grad_normal, double* values) {
  constexpr int kNumbers = NormalConsistency::kNumbers;
  const int64_t blocks = patches_along(height) * patches_along(width);
  const double mean = 1.0 / (static_cast<double>(height) * static_cast<double>(width));
  double* sums = parts.grow(queue, kNumbers * blocks);
  launch(queue, blocks, NormalConsistency{depth, alpha, normal, K, pose, height, width, static_cast<float>(mean),
                                          grad_depth, grad_normal, sums});
  // the rotation's gradient has its factor already
  launch(queue, 1, TotalOfBlocks<kNumbers>{{sums, blocks}, mean, 1, values});
}

}  // namespace R2_ISA
