// L1 and structural dissimilarity with their gradient, fused: one sweep over the rows of a strip, everything in cache.
//
// With x rendered, y target, d = x - y and m(.) the Gaussian window, SSIM is written with the moments of d:
//
//     SSIM = l c,   l = 1 - m(d)^2 / B1,   c = 1 - var(d) / B2,
//     B1 = m(x)^2 + m(y)^2 + C1,           B2 = var(x) + var(y) + C2,
//
// the same number as the usual (2 mx my + C1)(2 cov + C2) / (B1 B2), but without its float32 cancellation where the
// images agree: 1 - SSIM and its gradient are then sums of small terms instead of differences of large ones.
// Colours are taken about 0.5, which leaves variances as they are and makes their squares four times smaller; the
// zero padding of the images is then -0.5.
//
// A row is 3 width interleaved floats: a filter along x has its taps 3 floats apart, so no plane is ever taken apart.
#include "lane_sum.h"
#include "photometric.h"
#include "simd.h"

namespace R2_ISA {
namespace {

constexpr int kTaps = 11, kReach = 5, kRing = 12;
constexpr int kMargin = 16;
constexpr float kC1 = 0.01f * 0.01f, kC2 = 0.03f * 0.03f;
// exp(-k^2 / (2 1.5^2)), normalised; the floats add up to 1 within 3e-9.
constexpr float kWindow[kTaps] = {0.0010283801f, 0.007598758f, 0.036000773f, 0.10936069f, 0.21300554f, 0.26601171f,
                                  0.21300554f,   0.10936069f,  0.036000773f, 0.007598758f, 0.0010283801f};

R2_INLINE f8 load_part(const float* p, int64_t count) {
  if (count >= kLanes) return load(p);
  f8 r = splat(0.0f);
  for (int64_t k = 0; k < count; ++k) r[k] = p[k];
  return r;
}
R2_INLINE void store_part(float* p, f8 x, int64_t count) {
  if (count >= kLanes) return store(p, x);
  for (int64_t k = 0; k < count; ++k) p[k] = x[k];
}

// Eleven taps 3 floats apart, centred on p.
R2_INLINE f8 filter_row(const float* p) {
  f8 sum = load(p) * kWindow[kReach];
#pragma GCC unroll 5
  for (int k = 1; k <= kReach; ++k) sum = fma(load(p - 3 * k) + load(p + 3 * k), splat(kWindow[kReach + k]), sum);
  return sum;
}

// Window means down the columns of x - 0.5, d, d^2 and (x - 0.5)^2 + (y - 0.5)^2, for two neighbouring rows at once:
// x[k], y[k] are the twelve image rows from 5 above the first to 5 below the second.
R2_INLINE void filter_columns(const float* const* x, const float* const* y, int64_t i, int64_t count,
                              float* const* out) {
  f8 sum[2][4];
  for (int row = 0; row < 2; ++row)
    for (int s = 0; s < 4; ++s) sum[row][s] = splat(0.0f);
#pragma GCC unroll 12
  for (int k = 0; k <= kTaps; ++k) {
    const f8 a = load_part(x[k] + i, count), b = load_part(y[k] + i, count);
    const f8 d = a - b, xc = a - 0.5f, yc = b - 0.5f;
    const f8 value[4] = {xc, d, d * d, fma(yc, yc, xc * xc)};
#pragma GCC unroll 4
    for (int s = 0; s < 4; ++s) {
      if (k < kTaps) sum[0][s] = fma(value[s], splat(kWindow[k < kTaps ? k : 0]), sum[0][s]);
      if (k > 0) sum[1][s] = fma(value[s], splat(kWindow[k > 0 ? k - 1 : 0]), sum[1][s]);
    }
  }
  for (int row = 0; row < 2; ++row)
    for (int s = 0; s < 4; ++s) store(out[row * 4 + s] + i, sum[row][s]);
}

struct Sums {
  LaneSum l1, dssim;
};

// 1 - SSIM at eight values, and the maps whose window sums give its gradient:
// d SSIM / d x = 2 (G * map0 + d (G * map1) + (x - 0.5) (G * map2)).
R2_INLINE void ssim_maps(const float* const* mean, const float* x, const float* y, int64_t i, int64_t count,
                         bool counted, float* const* maps, Sums& sums) {
  const f8 mx = filter_row(mean[0] + i), md = filter_row(mean[1] + i);
  const f8 mdd = filter_row(mean[2] + i), mq = filter_row(mean[3] + i);
  const f8 my = mx - md, full_x = mx + 0.5f, full_y = my + 0.5f;
  const f8 b1 = fma(full_x, full_x, fma(full_y, full_y, splat(kC1)));
  const f8 b2 = mq - fma(mx, mx, my * my) + kC2;
  const f8 inverse = 1.0f / (b1 * b2), i1 = inverse * b2, i2 = inverse * b1;
  const f8 a = md * md * i1, b = (mdd - md * md) * i2;
  const f8 l = 1.0f - a, c = 1.0f - b;
  const i8 inside = __builtin_convertvector(iota(), i8) < static_cast<int32_t>(count < kLanes ? count : kLanes);
  if (counted) {
    const f8 d = load_part(x + i, count) - load_part(y + i, count);
    sums.l1.add(vmax(d, -d));
    sums.dssim.add(masked(inside, a + b - a * b));
  }
  if (maps == nullptr) return;
  const f8 map1 = -l * i2, map2 = l * b * i2;
  const f8 map0 = c * i1 * (a * full_x - md) - md * map1 - mx * map2;
  store(maps[0] + i, masked(inside, map0));
  store(maps[1] + i, masked(inside, map1));
  store(maps[2] + i, masked(inside, map2));
}

// The gradient of two neighbouring rows from the twelve rows of filtered maps about them, ring[3 row + map];
// x, y, out are the two rows of the images, out[1] null where the strip has ended.
R2_INLINE void gradient_pair(const float* const* ring, const float* const* x, const float* const* y, int64_t i,
                             int64_t count, float l1_scale, float dssim_scale, float* const* out) {
  f8 sum[2][3];
  for (int row = 0; row < 2; ++row)
    for (int s = 0; s < 3; ++s) sum[row][s] = splat(0.0f);
#pragma GCC unroll 12
  for (int k = 0; k <= kTaps; ++k) {
    for (int s = 0; s < 3; ++s) {
      const f8 value = load(ring[3 * k + s] + i);
      if (k < kTaps) sum[0][s] = fma(value, splat(kWindow[k < kTaps ? k : 0]), sum[0][s]);
      if (k > 0) sum[1][s] = fma(value, splat(kWindow[k > 0 ? k - 1 : 0]), sum[1][s]);
    }
  }
  for (int row = 0; row < 2; ++row) {
    if (out[row] == nullptr) continue;
    const f8 a = load_part(x[row] + i, count), d = a - load_part(y[row] + i, count);
    const f8 slope = fma(d, sum[row][1], fma(a - 0.5f, sum[row][2], sum[row][0]));
    const f8 sign = masked(d > 0.0f, splat(l1_scale)) - masked(d < 0.0f, splat(l1_scale));
    store_part(out[row] + i, fma(slope, splat(-2.0f * dssim_scale), sign), count);
  }
}

// The margins hold what the window means of the zero padding are.
void fill_margins(float* row, int64_t floats, int64_t stride, float value) {
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
    const float padding[4] = {-0.5f, 0.0f, 0.0f, 0.5f};
    fill_margins(scratch, padded, stride, padding[k % 4]);
    means[k] = scratch + kMargin;
    scratch += stride;
  }
  float* maps[3];
  for (int k = 0; k < 3; ++k) {
    fill_margins(scratch, padded, stride, 0.0f);
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
      for (; i + kLanes <= n; i += kLanes) filter_columns(x, y, i, kLanes, means);
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
      for (; i + kLanes <= n; i += kLanes)
        ssim_maps(means + 4 * k, x[kReach + k], y[kReach + k], i, kLanes, counted, out, sums);
      if (i < n) ssim_maps(means + 4 * k, x[kReach + k], y[kReach + k], i, n - i, counted, out, sums);
      if (counted) {
        job.row_l1[row] = sums.l1.total();
        job.row_dssim[row] = sums.dssim.total();
      }
      if (with_gradient)
        for (int s = 0; s < 3; ++s) {
          float* to = ring_row(step + k, s);
          for (int64_t j = 0; j < padded; j += kLanes) store(to + j, filter_row(maps[s] + j));
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
    for (; i + kLanes <= n; i += kLanes)
      gradient_pair(ring, rendered, target, i, kLanes, job.l1_scale, job.dssim_scale, out);
    if (i < n) gradient_pair(ring, rendered, target, i, n - i, job.l1_scale, job.dssim_scale, out);
  }
}

}  // namespace R2_ISA
