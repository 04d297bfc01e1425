// See patchmatch.h. A vector holds eight pixels of one colour of the checkerboard.
#include "patchmatch.h"
#include "simd.h"

namespace R2_ISA {
namespace {

using room2dgs::kStereoMargin;
using room2dgs::kStereoMaxReprojectionPx;
using room2dgs::kStereoMaxSamples;
using room2dgs::kStereoReach;
using room2dgs::kStereoWorst;
using room2dgs::StereoJob;
using room2dgs::StereoSweep;
using room2dgs::StereoView;

constexpr float kNearest = 1e-4f;          // of a homogeneous coordinate that is divided by
constexpr float kLeastArea = 0.15f;        // of a reference pixel as the view sees it, and the largest: beyond, a
constexpr float kLargestArea = 6.0f;       // patch of pixels is not comparable
constexpr float kEdge = 2.0f;              // a window's centre keeps this far from the view's border, pixels
constexpr float kWindowReach = 18.0f;      // and its corners stay within the replicated margin

R2_INLINE f8 to_float(i8 x) { return __builtin_convertvector(x, f8); }
R2_INLINE i8 truncated(f8 x) { return __builtin_convertvector(x, i8); }
R2_INLINE f8 vabs(f8 x) { return as_float(as_int(x) & splat_i(0x7fffffff)); }
typedef uint32_t u8 __attribute__((vector_size(32)));

R2_INLINE u8 gather(const uint32_t* p, i8 index) {
#if defined(__AVX2__)
  return reinterpret_cast<u8>(
      _mm256_i32gather_epi32(reinterpret_cast<const int*>(p), reinterpret_cast<__m256i>(index), 4));
#else
  u8 r;
  for (int k = 0; k < kLanes; ++k) r[k] = p[index[k]];
  return r;
#endif
}
R2_INLINE f8 gather(const float* p, i8 index) {
#if defined(__AVX2__)
  return _mm256_i32gather_ps(p, reinterpret_cast<__m256i>(index), 4);
#else
  f8 r;
  for (int k = 0; k < kLanes; ++k) r[k] = p[index[k]];
  return r;
#endif
}

// Random numbers that depend on what is drawn alone, so that no order of the pixels changes them.
R2_INLINE f8 uniform(u8 key, uint32_t draw) {
  u8 x = key + draw * 0x9e3779b9u;
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return __builtin_convertvector(reinterpret_cast<i8>(x >> 8), f8) * (1.0f / 16777216.0f);
}
R2_INLINE f8 symmetric(u8 key, uint32_t draw) { return uniform(key, draw) * 2.0f - 1.0f; }

struct Plane {
  f8 w, gx, gy;
};

// Eight pixels of a row and colour, and their windows of the reference photo.
struct Window {
  f8 x, y;
  i8 inside;                          // lanes beyond the row's end hold copies
  f8 weight[kStereoMaxSamples];       // bilateral, adding up to 1
  f8 centred[kStereoMaxSamples];      // weight times (grey - mean)
  f8 middle, variance;
};

R2_INLINE f8 every_second_byte(const uint8_t* p) {
  typedef uint16_t s8 __attribute__((vector_size(16)));
  s8 pairs;
  std::memcpy(&pairs, p, 16);
  return to_float(__builtin_convertvector(pairs & 255, i8));
}

R2_INLINE void window_at(const StereoJob& job, int64_t row, int first_x, int64_t index, Window& q) {
  const int64_t x0 = 2 * index + first_x, stride = job.width + 2 * kStereoMargin;
  q.x = iota() * 2.0f + static_cast<float>(x0);
  q.y = splat(static_cast<float>(row));
  q.inside = q.x < splat(static_cast<float>(job.width));
  const uint8_t* middle = job.grey + (row + kStereoMargin) * stride + x0 + kStereoMargin;
  q.middle = every_second_byte(middle);
  f8 sum = splat(0.0f), first = sum, second = sum;
  for (int k = 0; k < job.samples; ++k) {
    const f8 d = every_second_byte(middle + job.dy[k] * stride + job.dx[k]) - q.middle;
    const f8 weight = exp2_from(fma(d * d, splat(job.grey_scale), splat(job.spatial[k])));
    q.weight[k] = weight;
    q.centred[k] = d;
    sum = sum + weight;
    first = fma(weight, d, first);
    second = fma(weight * d, d, second);
  }
  const f8 scale = 1.0f / sum, mean = first * scale;
  q.variance = vmax(fma(second, scale, -mean * mean), splat(0.0f));
  for (int k = 0; k < job.samples; ++k) {
    q.weight[k] = q.weight[k] * scale;
    q.centred[k] = (q.centred[k] - mean) * q.weight[k];
  }
}

// 1 - NCC of the window and its image in the view, at (u, v) with the warp's derivatives.
R2_INLINE f8 dissimilarity(const StereoJob& job, const Window& q, const StereoView& view, f8 u, f8 v, f8 ux, f8 uy,
                           f8 vx, f8 vy) {
  const float stride = static_cast<float>(view.width + 2 * kStereoMargin);
  u = u + static_cast<float>(kStereoMargin);
  v = v + static_cast<float>(kStereoMargin);
  f8 first = splat(0.0f), second = first, product = first;
  for (int k = 0; k < job.samples; ++k) {
    const float dx = job.dx[k], dy = job.dy[k];
    const f8 a = fma(ux, splat(dx), fma(uy, splat(dy), u)), b = fma(vx, splat(dx), fma(vy, splat(dy), v));
    const f8 left = to_float(truncated(a)), top = to_float(truncated(b));
    const f8 s = a - left, t = b - top;
    // exact in float: a photo has fewer than 2^24 pixels
    const u8 quad = gather(view.quads, truncated(fma(top, splat(stride), left)));
    const f8 i00 = to_float(reinterpret_cast<i8>(quad & 255u)), i10 = to_float(reinterpret_cast<i8>((quad >> 8) & 255u));
    const f8 i01 = to_float(reinterpret_cast<i8>((quad >> 16) & 255u)), i11 = to_float(reinterpret_cast<i8>(quad >> 24));
    const f8 upper = fma(s, i10 - i00, i00), lower = fma(s, i11 - i01, i01);
    const f8 grey = fma(t, lower - upper, upper) - q.middle;
    const f8 weighted = q.weight[k] * grey;
    first = first + weighted;
    second = fma(weighted, grey, second);
    product = fma(q.centred[k], grey, product);
  }
  const f8 variance = vmax(second - first * first, splat(0.0f));
  const f8 ncc = product / vsqrt((q.variance + job.variance_floor) * (variance + job.variance_floor));
  return vmin(vmax(1.0f - ncc, splat(0.0f)), splat(kStereoWorst));
}

// Forward-backward reprojection error in reference pixels, at most kStereoMaxReprojectionPx.
R2_INLINE f8 round_trip(const Window& q, const StereoView& view, f8 u, f8 v, i8 seen) {
  const f8 column = to_float(truncated(u + 0.5f)), line = to_float(truncated(v + 0.5f));
  const i8 index = seen & truncated(fma(line, splat(static_cast<float>(view.width)), column));
  const f8 w = gather(view.inverse_depth, index);
  const float *B = view.back_M, *t = view.back_t;
  // the plane's own pixel with the view's depth at the nearest one: the sub-pixel part is kept
  const f8 p = fma(u, splat(B[0]), fma(v, splat(B[1]), fma(w, splat(t[0]), splat(B[2]))));
  const f8 r = fma(u, splat(B[3]), fma(v, splat(B[4]), fma(w, splat(t[1]), splat(B[5]))));
  const f8 z = vmax(fma(u, splat(B[6]), fma(v, splat(B[7]), fma(w, splat(t[2]), splat(B[8])))), splat(kNearest));
  const f8 ex = p / z - q.x, ey = r / z - q.y;
  const f8 error = vmin(vsqrt(fma(ex, ex, ey * ey)), splat(kStereoMaxReprojectionPx));
  return select(w > 0.0f, error, splat(kStereoMaxReprojectionPx));
}

// Mean cost of a plane over the `best` views that like it most.
R2_INLINE f8 cost_of(const StereoJob& job, const Window& q, const Plane& plane) {
  f8 least[room2dgs::kStereoMaxBest];
  const bool geometric = job.geometric_weight > 0.0f;
  const float worst = kStereoWorst + (geometric ? job.geometric_weight * kStereoMaxReprojectionPx : 0.0f);
  for (int k = 0; k < job.best; ++k) least[k] = splat(worst);
  for (int n = 0; n < job.view_count; ++n) {
    const StereoView& view = job.views[n];
    const float *M = view.M, *t = view.t;
    const f8 p = fma(q.x, splat(M[0]), fma(q.y, splat(M[1]), fma(plane.w, splat(t[0]), splat(M[2]))));
    const f8 r = fma(q.x, splat(M[3]), fma(q.y, splat(M[4]), fma(plane.w, splat(t[1]), splat(M[5]))));
    const f8 z = fma(q.x, splat(M[6]), fma(q.y, splat(M[7]), fma(plane.w, splat(t[2]), splat(M[8]))));
    const f8 inverse = 1.0f / vmax(z, splat(kNearest)), u = p * inverse, v = r * inverse;
    const f8 zx = fma(plane.gx, splat(t[2]), splat(M[6])), zy = fma(plane.gy, splat(t[2]), splat(M[7]));
    const f8 ux = (fma(plane.gx, splat(t[0]), splat(M[0])) - u * zx) * inverse;
    const f8 uy = (fma(plane.gy, splat(t[0]), splat(M[1])) - u * zy) * inverse;
    const f8 vx = (fma(plane.gx, splat(t[1]), splat(M[3])) - v * zx) * inverse;
    const f8 vy = (fma(plane.gy, splat(t[1]), splat(M[4])) - v * zy) * inverse;
    const f8 area = ux * vy - uy * vx, reach = splat(static_cast<float>(job.dx[job.samples - 1]));
    i8 seen = q.inside & (z > kNearest) & (area > kLeastArea) & (area < kLargestArea);
    seen &= (u >= kEdge) & (u <= static_cast<float>(view.width - 1) - kEdge);
    seen &= (v >= kEdge) & (v <= static_cast<float>(view.height - 1) - kEdge);
    seen &= ((vabs(ux) + vabs(uy)) * reach < kWindowReach) & ((vabs(vx) + vabs(vy)) * reach < kWindowReach);
    if (!any(seen)) continue;
    // lanes that do not see it look at a harmless place
    f8 cost = dissimilarity(job, q, view, masked(seen, u), masked(seen, v), masked(seen, ux), masked(seen, uy),
                            masked(seen, vx), masked(seen, vy));
    if (geometric && view.inverse_depth)
      cost = fma(round_trip(q, view, masked(seen, u), masked(seen, v), seen), splat(job.geometric_weight), cost);
    cost = select(seen, cost, splat(worst));
    for (int k = 0; k < job.best; ++k) {
      const f8 low = vmin(least[k], cost);
      cost = vmax(least[k], cost);
      least[k] = low;
    }
  }
  f8 sum = least[0];
  for (int k = 1; k < job.best; ++k) sum = sum + least[k];
  return sum * (1.0f / static_cast<float>(job.best));
}

R2_INLINE Plane limited(const StereoJob& job, Plane plane) {
  plane.w = vmin(vmax(plane.w, splat(job.w_min)), splat(job.w_max));
  const f8 limit = plane.w * job.slope_limit;
  plane.gx = vmin(vmax(plane.gx, -limit), limit);
  plane.gy = vmin(vmax(plane.gy, -limit), limit);
  return plane;
}

struct Arm {
  int dx[4], dy[4];
};
// Four near arms and four far ones; of each, the neighbour with the least cost lends its plane. dx + dy is odd.
constexpr Arm kArms[8] = {
    {{0, -1, 1, 0}, {-1, -2, -2, -3}},  {{0, -1, 1, 0}, {1, 2, 2, 3}},
    {{-1, -2, -2, -3}, {0, -1, 1, 0}},  {{1, 2, 2, 3}, {0, -1, 1, 0}},
    {{0, 0, 0, 0}, {-5, -9, -15, -23}}, {{0, 0, 0, 0}, {5, 9, 15, 23}},
    {{-5, -9, -15, -23}, {0, 0, 0, 0}}, {{5, 9, 15, 23}, {0, 0, 0, 0}},
};

R2_INLINE u8 pixel_keys(const StereoJob& job, const Window& q) {
  const i8 pixel = truncated(q.y) * static_cast<int32_t>(job.width) + truncated(q.x);
  return (reinterpret_cast<u8>(pixel) + 1u) * 0x85ebca6bu ^ job.seed;
}

}  // namespace

void stereo_start_row(const StereoJob& job, int64_t row) {
  Window q;
  for (int colour = 0; colour < 2; ++colour) {
    const int first_x = static_cast<int>((row + colour) & 1);
    for (int64_t i = 0; 2 * i + first_x < job.width; i += kLanes) {
      window_at(job, row, first_x, i, q);
      const int64_t at = room2dgs::stereo_at(job.width, job.height, colour, row, i);
      Plane plane = {load(job.w + at), load(job.gx + at), load(job.gy + at)};
      const u8 keys = pixel_keys(job, q);
      const i8 none = plane.w <= 0.0f;
      const f8 w = fma(uniform(keys, 1), splat(job.w_max - job.w_min), splat(job.w_min));
      plane = {select(none, w, plane.w), select(none, w * symmetric(keys, 2) * job.pixel_slope, plane.gx),
               select(none, w * symmetric(keys, 3) * job.pixel_slope, plane.gy)};
      plane = limited(job, plane);
      // what lies beyond the row's end is in the border: nobody takes it up
      const f8 cost = select(q.inside, cost_of(job, q, plane), splat(1e9f));
      store(job.w + at, plane.w), store(job.gx + at, plane.gx), store(job.gy + at, plane.gy);
      store(job.cost + at, cost);
    }
  }
}

void stereo_sweep_row(const StereoJob& job, const StereoSweep& sweep, int64_t row) {
  Window q;
  const int first_x = static_cast<int>((row + sweep.colour) & 1), other = 1 - sweep.colour;
  for (int64_t i = 0; 2 * i + first_x < job.width; i += kLanes) {
    window_at(job, row, first_x, i, q);
    const int64_t at = room2dgs::stereo_at(job.width, job.height, sweep.colour, row, i);
    Plane best = {load(job.w + at), load(job.gx + at), load(job.gy + at)};
    f8 cost = load(job.cost + at);
    const auto attempt = [&](Plane plane) {
      plane = limited(job, plane);
      const f8 found = cost_of(job, q, plane);
      const i8 better = (found < cost) & q.inside;
      best = {select(better, plane.w, best.w), select(better, plane.gx, best.gx), select(better, plane.gy, best.gy)};
      cost = select(better, found, cost);
    };
    for (const Arm& arm : kArms) {
      f8 least = splat(1e9f);
      Plane lent = best;
      for (int k = 0; k < 4; ++k) {
        const int dx = arm.dx[k], dy = arm.dy[k];
        const int64_t line = row + dy, x = 2 * i + first_x + dx;
        const int64_t there = room2dgs::stereo_at(job.width, job.height, other, line, 0) +
                              (x - ((line + other) & 1)) / 2;
        const f8 theirs = load(job.cost + there);
        const i8 less = theirs < least;
        least = select(less, theirs, least);
        const f8 gx = load(job.gx + there), gy = load(job.gy + there);
        const f8 w = load(job.w + there) - gx * static_cast<float>(dx) - gy * static_cast<float>(dy);
        lent = {select(less, w, lent.w), select(less, gx, lent.gx), select(less, gy, lent.gy)};
      }
      attempt(lent);
    }
    if (job.hint_w) {
      const f8 w = load(job.hint_w + at);
      if (any((w > 0.0f) & q.inside))
        attempt({select(w > 0.0f, w, best.w), load(job.hint_gx + at), load(job.hint_gy + at)});
    }
    const u8 keys = pixel_keys(job, q) ^ (sweep.draw * 0xc2b2ae35u);
    const float size = sweep.perturbation;
    f8 slope = best.w * job.pixel_slope * size;
    attempt({fma(best.w * (0.1f * size), symmetric(keys, 1), best.w), best.gx, best.gy});
    attempt({best.w, fma(slope, symmetric(keys, 2), best.gx), fma(slope, symmetric(keys, 3), best.gy)});
    slope = slope * 0.3f;
    attempt({fma(best.w * (0.02f * size), symmetric(keys, 4), best.w), fma(slope, symmetric(keys, 5), best.gx),
             fma(slope, symmetric(keys, 6), best.gy)});
    if (sweep.random_depth) {
      const f8 w = fma(uniform(keys, 7), splat(job.w_max - job.w_min), splat(job.w_min)), ratio = w / best.w;
      attempt({w, best.gx * ratio, best.gy * ratio});
    }
    store(job.w + at, best.w), store(job.gx + at, best.gx), store(job.gy + at, best.gy), store(job.cost + at, cost);
  }
}

void stereo_cost_row(const StereoJob& job, int64_t row, float* cost, float* variance) {
  Window q;
  for (int colour = 0; colour < 2; ++colour) {
    const int first_x = static_cast<int>((row + colour) & 1);
    for (int64_t i = 0; 2 * i + first_x < job.width; i += kLanes) {
      window_at(job, row, first_x, i, q);
      const int64_t at = room2dgs::stereo_at(job.width, job.height, colour, row, i);
      const f8 found = cost_of(job, q, {load(job.w + at), load(job.gx + at), load(job.gy + at)});
      for (int k = 0; k < kLanes; ++k) {
        const int64_t x = 2 * (i + k) + first_x;
        if (x < job.width) cost[row * job.width + x] = found[k], variance[row * job.width + x] = q.variance[k];
      }
    }
  }
}

}  // namespace R2_ISA
