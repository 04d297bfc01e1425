// The multi-view terms as block code (multiview_maths.h), a warp a pixel, its lanes over the pixel's patch. Gradients
// are each pixel's own; what several of them have in common is left to whoever adds them to the maps.
#include "block_losses.h"
#include "block_total.h"
#include "multiview_maths.h"

namespace R2_ISA {
namespace {

constexpr int kMoments = 5, kValues = 4;

struct ComparePixels {
  static constexpr int kThreads = 256, kPixels = kThreads / kWarp;
  struct Shared {
    float moments[kPixels][kMoments], by_m[kPixels][3];
    float values[kPixels][kValues];  // w e, its pixels, w (1 - NCC), its pixels
  };
  MultiviewPixels job;
  double* parts;

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    block.warps([&](const Warp& warp) {
      const int64_t k = block.index() * kPixels + warp.index;
      float value[kValues] = {}, by_depth[2] = {};
      Triple<float> by_normal = {0, 0, 0};
      const int64_t pixel = k < job.samples ? job.pixels[k] : -1;
      if (pixel >= 0 && pixel < job.height * job.width) {
        const ViewPair view = view_pair(job.K, job.pose, job.other_K, job.other_pose);
        const int64_t column = pixel % job.width, row = pixel / job.width;
        const float x = static_cast<float>(column) + 0.5f, y = static_cast<float>(row) + 0.5f, depth = job.depth[pixel];
        const RoundTrip trip = round_trip(view, x, y, depth, job.inverse_depth, job.map_height, job.map_width, job.step);
        if (trip.weight > 0) {
          value[0] = trip.weight * trip.error, value[1] = 1;
          by_depth[0] = trip.weight * trip.moves;
          const int reach = job.patch / 2;
          const bool inner_pixel = column >= reach && column < job.width - reach && row >= reach && row < job.height - reach;
          if (job.normal && inner_pixel) {
            const Tangent plane = tangent_of(view, x, y, depth, job.normal + 3 * pixel);
            if (vmax(plane.facing, -plane.facing) >= kMinFacing)
              patch(warp, s, view, plane, column, row, depth, trip.weight, value, by_depth, by_normal);
          }
        }
      }
      warp.lanes([&](int lane) {
        if (lane < kValues) s.values[warp.index][lane] = value[lane];
        if (lane || k >= job.samples) return;
        job.to_depth[2 * k] = by_depth[0], job.to_depth[2 * k + 1] = by_depth[1];
        job.to_normal[3 * k] = by_normal.x, job.to_normal[3 * k + 1] = by_normal.y, job.to_normal[3 * k + 2] = by_normal.z;
      });
    });
    block.threads([&](int thread) {
      if (thread >= kValues) return;
      double sum = 0;
      for (int w = 0; w < kPixels; ++w) sum += s.values[w][thread];
      parts[kValues * block.index() + thread] = sum;
    });
  }

 private:
  // The lanes' pixels of a patch: f(x, y, index of the reference's pixel).
  template <class F>
  R2_KERNEL void each(int lane, int64_t column, int64_t row, const F& f) const {
    for (int p = lane; p < job.patch * job.patch; p += kWarp) {
      const int64_t i = column + p % job.patch - job.patch / 2, j = row + p / job.patch - job.patch / 2;
      f(static_cast<float>(i) + 0.5f, static_cast<float>(j) + 0.5f, j * job.width + i);
    }
  }

  // 1 - NCC of the patch and where its plane carries it, unless the neighbour does not see it whole.
  R2_KERNEL void patch(const Warp& warp, Shared& s, const ViewPair& view, const Tangent& plane, int64_t column,
                       int64_t row, float depth, float weight, float* value, float* by_depth,
                       Triple<float>& by_normal) const {
    // grey levels from those of the middle: small numbers, so that one sweep tells both moments
    const Warped middle = warped_at(view, plane, static_cast<float>(column) + 0.5f, static_cast<float>(row) + 0.5f);
    const float grey = job.grey[row * job.width + column];
    const float other = between(job.other_grey, job.other_height, job.other_width, middle.x, middle.y).value;
    Own<Sums<float, kMoments>, kWarp> mine;
    Own<bool, kWarp> missed;
    warp.lanes([&](int lane) {
      float* sum = mine[lane].value;
      for (int m = 0; m < kMoments; ++m) sum[m] = 0;
      missed[lane] = false;
      each(lane, column, row, [&](float x, float y, int64_t i) {
        const Warped at = warped_at(view, plane, x, y);
        missed[lane] = missed[lane] || !seen_whole(at, job.other_height, job.other_width);
        if (job.usable)
          missed[lane] = missed[lane] ||
                         !(between(job.usable, job.other_height, job.other_width, at.x, at.y).value > kWholeShare);
        const float a = job.grey[i] - grey;
        const float b = between(job.other_grey, job.other_height, job.other_width, at.x, at.y).value - other;
        sum[0] += a, sum[1] += b;
        sum[2] = fma(a, a, sum[2]), sum[3] = fma(b, b, sum[3]), sum[4] = fma(a, b, sum[4]);
      });
    });
    if (warp.ballot(missed)) return;
    warp.sums(mine, s.moments[warp.index]);
    const float* sum = s.moments[warp.index];
    const float share = 1.0f / static_cast<float>(job.patch * job.patch);
    const float a_mean = sum[0] * share, b_mean = sum[1] * share;
    const float a_power = vmax(fma(-a_mean, a_mean, sum[2] * share), kMinPatchVariance);
    const float b_raw = fma(-b_mean, b_mean, sum[3] * share), b_power = vmax(b_raw, kMinPatchVariance);
    const float scale = 1.0f / vsqrt(a_power * b_power), ncc = fma(-a_mean, b_mean, sum[4] * share) * scale;
    value[2] = weight * (1.0f - ncc), value[3] = 1;
    // of 1 - NCC by the neighbour's grey level
    const float by_a = -weight * share * scale, by_b = b_raw >= kMinPatchVariance ? weight * share * ncc / b_power : 0.0f;
    Own<Sums<float, 3>, kWarp> gradient;
    warp.lanes([&](int lane) {
      float* to = gradient[lane].value;
      to[0] = to[1] = to[2] = 0;
      each(lane, column, row, [&](float x, float y, int64_t i) {
        const Warped at = warped_at(view, plane, x, y);
        const Between found = between(job.other_grey, job.other_height, job.other_width, at.x, at.y);
        const float by_grey = fma(by_a, job.grey[i] - grey - a_mean, by_b * (found.value - other - b_mean));
        const float along = by_grey * fma(found.dx, at.dx, found.dy * at.dy);
        to[0] = fma(along, at.ray.x, to[0]), to[1] = fma(along, at.ray.y, to[1]), to[2] = fma(along, at.ray.z, to[2]);
      });
    });
    warp.sums(gradient, s.by_m[warp.index]);
    const float* m = s.by_m[warp.index];
    const TangentGradient g = tangent_gradient(view, plane, depth, {m[0], m[1], m[2]});
    by_depth[1] = g.depth, by_normal = g.normal;
  }
};

// Both means, and what a pixel's gradient is divided by: the numbers of pixels, 1 at least.
struct MeansOfPixels : AddParts<double, kValues> {
  double* to;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    add(block, s);
    block.threads([&](int thread) {
      if (thread >= 2) return;
      const double count = s.sums[2 * thread + 1] > 1 ? s.sums[2 * thread + 1] : 1;
      to[thread] = s.sums[2 * thread] / count, to[2 + thread] = count;
    });
  }
};

}  // namespace

void BlockLosses::multiview(const Queue& queue, const MultiviewPixels& job, double* values) {
  const int64_t blocks = blocks_for(job.samples, ComparePixels::kPixels);
  double* sums = parts.grow(queue, kValues * blocks);
  launch(queue, blocks, ComparePixels{job, sums});
  launch(queue, 1, MeansOfPixels{{sums, blocks}, values});
}

}  // namespace R2_ISA
