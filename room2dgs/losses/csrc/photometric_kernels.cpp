// L1 and structural dissimilarity (ssim.h) with their gradient, fused: one sweep over the rows of a strip, everything in
// cache.
//
// A row is 3 width interleaved floats: a filter along x has its taps 3 floats apart, so no plane is ever taken apart.
#include "lane_sum.h"
#include "photometric.h"
#include "wide.h"  // before ssim.h, whose templates see what stands before them

#include "ssim.h"

namespace R2_ISA {
namespace {

constexpr int kRing = 12;
constexpr int kMargin = 16;
constexpr float kWindow[kTaps] = R2_SSIM_WINDOW;

R2_INLINE fw all(float x) { return Lanes<fw>::all(x); }
R2_INLINE fw load_part(const float* p, int64_t count) {
  if (count >= kWide) return load_wide(p);
  fw r = all(0.0f);
  for (int64_t k = 0; k < count; ++k) r[k] = p[k];
  return r;
}
R2_INLINE void store_part(float* p, fw x, int64_t count) {
  if (count >= kWide) return store_wide(p, x);
  for (int64_t k = 0; k < count; ++k) p[k] = x[k];
}

// Eleven taps 3 floats apart, centred on p.
R2_INLINE fw filter_row(const float* p) {
  fw sum = load_wide(p) * kWindow[kReach];
#pragma GCC unroll 5
  for (int k = 1; k <= kReach; ++k) sum = fma(load_wide(p - 3 * k) + load_wide(p + 3 * k), all(kWindow[kReach + k]), sum);
  return sum;
}

// Window means down the columns of x - 0.5, d, d^2 and (x - 0.5)^2 + (y - 0.5)^2, for two neighbouring rows at once:
// x[k], y[k] are the twelve image rows from 5 above the first to 5 below the second.
R2_INLINE void filter_columns(const float* const* x, const float* const* y, int64_t i, int64_t count,
                              float* const* out) {
  fw sum[2][4];
  for (int row = 0; row < 2; ++row)
    for (int s = 0; s < 4; ++s) sum[row][s] = all(0.0f);
#pragma GCC unroll 12
  for (int k = 0; k <= kTaps; ++k) {
    const fw a = load_part(x[k] + i, count), b = load_part(y[k] + i, count);
    const Moments<fw> at = moments_of(a, b);
    const fw value[4] = {at.x, at.d, at.dd, at.q};
#pragma GCC unroll 4
    for (int s = 0; s < 4; ++s) {
      if (k < kTaps) sum[0][s] = fma(value[s], all(kWindow[k < kTaps ? k : 0]), sum[0][s]);
      if (k > 0) sum[1][s] = fma(value[s], all(kWindow[k > 0 ? k - 1 : 0]), sum[1][s]);
    }
  }
  for (int row = 0; row < 2; ++row)
    for (int s = 0; s < 4; ++s) store_wide(out[row * 4 + s] + i, sum[row][s]);
}

struct Sums {
  LaneSum l1, dssim;
};
R2_INLINE void add(LaneSum& sum, fw x) {
  for (int k = 0; k < kWide; k += kLanes) {
    f8 eight;
    std::memcpy(&eight, reinterpret_cast<const float*>(&x) + k, sizeof eight);
    sum.add(eight);
  }
}

// 1 - SSIM at a vector of values, and the maps for its gradient.
R2_INLINE void ssim_maps(const float* const* mean, const float* x, const float* y, int64_t i, int64_t count,
                         bool counted, float* const* maps, Sums& sums) {
  const Moments<fw> m = {filter_row(mean[0] + i), filter_row(mean[1] + i), filter_row(mean[2] + i),
                         filter_row(mean[3] + i)};
  const SsimMaps<fw> r = ssim_maps_of(m);
  const iw inside = __builtin_convertvector(wide_iota(), iw) < static_cast<int32_t>(count < kWide ? count : kWide);
  if (counted) {
    const fw d = load_part(x + i, count) - load_part(y + i, count);
    add(sums.l1, vmax(d, -d)), add(sums.dssim, masked(inside, r.loss));
  }
  if (maps == nullptr) return;
  store_wide(maps[0] + i, masked(inside, r.map0));
  store_wide(maps[1] + i, masked(inside, r.map1));
  store_wide(maps[2] + i, masked(inside, r.map2));
}

// The gradient of two neighbouring rows from the twelve rows of filtered maps about them, ring[3 row + map];
// x, y, out are the two rows of the images, out[1] null where the strip has ended.
R2_INLINE void gradient_pair(const float* const* ring, const float* const* x, const float* const* y, int64_t i,
                             int64_t count, float l1_scale, float dssim_scale, float* const* out) {
  fw sum[2][3];
  for (int row = 0; row < 2; ++row)
    for (int s = 0; s < 3; ++s) sum[row][s] = all(0.0f);
#pragma GCC unroll 12
  for (int k = 0; k <= kTaps; ++k) {
    for (int s = 0; s < 3; ++s) {
      const fw value = load_wide(ring[3 * k + s] + i);
      if (k < kTaps) sum[0][s] = fma(value, all(kWindow[k < kTaps ? k : 0]), sum[0][s]);
      if (k > 0) sum[1][s] = fma(value, all(kWindow[k > 0 ? k - 1 : 0]), sum[1][s]);
    }
  }
  for (int row = 0; row < 2; ++row) {
    if (out[row] == nullptr) continue;
    const fw a = load_part(x[row] + i, count), d = a - load_part(y[row] + i, count);
    store_part(out[row] + i, rgb_gradient(a, d, sum[row][0], sum[row][1], sum[row][2], l1_scale, dssim_scale), count);
  }
}

// The margins, and what no vector of a row of so many floats reaches, hold what the window means of the zero padding are.
void fill_margins(float* row, int64_t floats, int64_t stride, float value) {
  floats = (floats + kWide - 1) / kWide * kWide;
  for (int64_t i = 0; i < kMargin; ++i) row[i] = value;
  for (int64_t i = kMargin + floats; i < stride; ++i) row[i] = value;
}

}  // namespace

void rgb_loss_strip(const room2dgs::RgbLossJob& job, int64_t strip, int worker) {
  const int64_t n = job.row_floats, stride = room2dgs::rgb_loss_stride(n), padded = stride - 2 * kMargin;
  const int64_t first = strip * job.strip_rows;
  const int64_t last = first + job.strip_rows < job.height ? first + job.strip_rows : job.height;  // exclusive
  const bool with_gradient = job.gradient != nullptr;
  const int64_t halo = with_gradient ? kReach : 0;

  float* scratch = job.scratch + worker * room2dgs::rgb_loss_scratch(n);
  float* means[8];
  for (int k = 0; k < 8; ++k) {
    fill_margins(scratch, n, stride, kPadding[k % 4]);
    means[k] = scratch + kMargin;
    scratch += stride;
  }
  float* maps[3];
  for (int k = 0; k < 3; ++k) {
    fill_margins(scratch, n, stride, 0.0f);
    maps[k] = scratch + kMargin;
    scratch += stride;
  }
  const auto ring_row = [&](int64_t step, int s) { return scratch + ((step % kRing) * 3 + s) * stride; };
  const auto row_of = [&](const float* image, int64_t row) {
    return row >= 0 && row < job.height ? image + row * n : job.zeros;
  };

  // Row `first - halo + step` of the maps enters the ring at `step`.
  const int64_t steps = last - first + 2 * halo;
  for (int64_t step = 0; step < steps; step += 2) {
    const int64_t row0 = first - halo + step;
    const float *x[kTaps + 1], *y[kTaps + 1];
    for (int k = 0; k <= kTaps; ++k) {
      x[k] = row_of(job.rendered, row0 - kReach + k);
      y[k] = row_of(job.target, row0 - kReach + k);
    }
    if (row0 + 1 >= 0 && row0 < job.height) {
      int64_t i = 0;
      for (; i + kWide <= n; i += kWide) filter_columns(x, y, i, kWide, means);
      if (i < n) filter_columns(x, y, i, n - i, means);
    }
    for (int k = 0; k < 2; ++k) {
      const int64_t row = row0 + k;
      if (row < 0 || row >= job.height) {
        if (with_gradient)
          for (int s = 0; s < 3; ++s) std::memset(ring_row(step + k, s), 0, sizeof(float) * padded);
        continue;
      }
      const bool counted = row >= first && row < last;
      if (!with_gradient && !counted) continue;
      Sums sums;
      float* const* out = with_gradient ? maps : nullptr;
      int64_t i = 0;
      for (; i + kWide <= n; i += kWide)
        ssim_maps(means + 4 * k, x[kReach + k], y[kReach + k], i, kWide, counted, out, sums);
      if (i < n) ssim_maps(means + 4 * k, x[kReach + k], y[kReach + k], i, n - i, counted, out, sums);
      if (counted) {
        job.row_l1[row] = sums.l1.total();
        job.row_dssim[row] = sums.dssim.total();
      }
      if (with_gradient)
        for (int s = 0; s < 3; ++s) {
          float* to = ring_row(step + k, s);
          for (int64_t j = 0; j < padded; j += kWide) store_wide(to + j, filter_row(maps[s] + j));
        }
    }
    // The ring now holds the twelve rows of maps about the two rows of the image five steps back.
    const int64_t done = row0 - kReach;
    if (!with_gradient || done < first) continue;
    const float* ring[(kTaps + 1) * 3];
    for (int k = 0; k <= kTaps; ++k)
      for (int s = 0; s < 3; ++s) ring[3 * k + s] = ring_row(step + 2 + k, s);
    const float *rendered[2], *target[2];
    float* out[2];
    for (int k = 0; k < 2; ++k) {
      rendered[k] = row_of(job.rendered, done + k);
      target[k] = row_of(job.target, done + k);
      out[k] = done + k < last ? job.gradient + (done + k) * n : nullptr;
    }
    int64_t i = 0;
    for (; i + kWide <= n; i += kWide)
      gradient_pair(ring, rendered, target, i, kWide, job.l1_scale, job.dssim_scale, out);
    if (i < n) gradient_pair(ring, rendered, target, i, n - i, job.l1_scale, job.dssim_scale, out);
  }
}

}  // namespace R2_ISA
