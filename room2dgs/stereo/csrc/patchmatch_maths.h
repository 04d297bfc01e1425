// The maths of PatchMatch stereo (patchmatch.h), for eight pixels of a colour at once or for one: `F` is eight lanes or
// a float, `StereoLanes<F>` what it needs beyond scalar.h (eight: simd.h, included before this file).
#pragma once

#include "patchmatch.h"
#include "scalar.h"

// A plane's cost is asked for a dozen times a pixel: a call.
#ifdef __CUDACC__
#define R2_STEREO_CALL __host__ __device__ __noinline__
#else
#define R2_STEREO_CALL __attribute__((noinline))
#endif

namespace R2_ISA {

using room2dgs::kStereoMargin;
using room2dgs::kStereoMaxReprojectionPx;
using room2dgs::kStereoMaxSamples;
using room2dgs::kStereoReach;
using room2dgs::kStereoWorst;
using room2dgs::StereoJob;
using room2dgs::StereoSweep;

constexpr float kNearest = 1e-4f;          // of a homogeneous coordinate that is divided by
constexpr float kLeastArea = 0.15f;        // of a reference pixel as the view sees it, and the largest: beyond, a
constexpr float kLargestArea = 6.0f;       // patch of pixels is not comparable
constexpr float kEdge = 2.0f;              // a window's centre keeps this far from the view's border, pixels
constexpr float kWindowReach = 18.0f;      // and its corners stay within the replicated margin

template <class F>
struct StereoLanes;
template <>
struct StereoLanes<float> {
  using Integers = int32_t;
  using Bits = uint32_t;
  static constexpr int count = 1;
  static R2_HD float number(int32_t x) { return static_cast<float>(x); }
  static R2_HD int32_t truncated(float x) { return static_cast<int32_t>(x); }
  static R2_HD int32_t integers(uint32_t x) { return static_cast<int32_t>(x); }
  static R2_HD uint32_t bits(int32_t x) { return static_cast<uint32_t>(x); }
  static R2_HD int32_t raw(float x) {
    int32_t r;
    memcpy(&r, &x, 4);
    return r;
  }
  static R2_HD float float_of(int32_t x) {
    float r;
    memcpy(&r, &x, 4);
    return r;
  }
  static R2_HD int32_t whole(int32_t x) { return x; }
  static R2_HD int32_t only(bool mask, int32_t x) { return mask ? x : 0; }
  static R2_HD int32_t choose(bool mask, int32_t yes, int32_t no) { return mask ? yes : no; }
  static R2_HD int32_t bit(int32_t k) { return static_cast<int32_t>(1u << k); }
  static R2_HD bool any(bool mask) { return mask; }
  static R2_HD float absolute(float x) { return x < 0.0f ? -x : x; }
  static R2_HD float columns(int64_t first) { return static_cast<float>(first); }
  static R2_HD float bytes(const uint8_t* p) { return static_cast<float>(*p); }
  static R2_HD float load(const float* p) { return *p; }
  static R2_HD int32_t whole_at(const int32_t* p) { return *p; }
  template <class T>
  static R2_HD void store(T* p, T x) {
    *p = x;
  }
  static R2_HD float lane(float x, int) { return x; }
  template <class T>
  static R2_HD T gather(const T* p, int32_t index) {
    return p[index];
  }
  static R2_HD float of_view(const StereoJob& job, int field, int32_t view) {
    return job.table[field * room2dgs::kStereoMaxViews + view];
  }
  static R2_HD int32_t logical_shift(int32_t x, int by) { return static_cast<int32_t>(static_cast<uint32_t>(x) >> by); }
  static R2_HD int32_t product_of_halves(int32_t a, int32_t b) {
    return static_cast<int16_t>(a) * static_cast<int16_t>(b) + (a >> 16) * (b >> 16);
  }
  static R2_HD int32_t halves(int32_t low, int32_t high) { return (low & 0xffff) | (high & ~0xffff); }
  static R2_HD int32_t along_row(int32_t position) {
    const int32_t half = (position & 0xffff) >> 1;
    return (half << 16) | (0x7fff - half);
  }
};

template <class F>
R2_HD F all(float x) {
  return Lanes<F>::all(x);
}

// Random numbers that depend on what is drawn alone, so that no order of the pixels changes them.
template <class F, class L = StereoLanes<F>>
R2_HD F uniform(typename L::Bits key, uint32_t draw) {
  typename L::Bits x = key + draw * 0x9e3779b9u;
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return L::number(L::integers(x >> 8)) * (1.0f / 16777216.0f);
}
template <class F, class L = StereoLanes<F>>
R2_HD F symmetric(typename L::Bits key, uint32_t draw) { return uniform<F>(key, draw) * 2.0f - 1.0f; }

// Pixels of a row and colour, as many as there are lanes, and their windows of the reference photo.
template <class F>
struct Window {
  F x, y;
  Mask<F> inside;                // lanes beyond the row's end hold copies
  F weight[kStereoMaxSamples];   // bilateral, adding up to 1
  F centred[kStereoMaxSamples];  // weight times (grey - mean)
  F middle, variance;
};

template <class F, class L = StereoLanes<F>>
R2_HD void window_at(const StereoJob& job, int64_t row, int first_x, int64_t index, Window<F>& q) {
  const int64_t x0 = 2 * index + first_x, stride = job.width + 2 * kStereoMargin;
  q.x = L::columns(x0);
  q.y = all<F>(static_cast<float>(row));
  q.inside = q.x < all<F>(static_cast<float>(job.width));
  const uint8_t* middle = job.grey + (row + kStereoMargin) * stride + x0 + kStereoMargin;
  q.middle = L::bytes(middle);
  F sum = all<F>(0.0f), first = sum, second = sum;
  for (int k = 0; k < job.samples; ++k) {
    const F d = L::bytes(middle + job.dy[k] * stride + job.dx[k]) - q.middle;
    const F weight = exp2_from(fma(d * d, all<F>(job.grey_scale), all<F>(job.spatial[k])));
    q.weight[k] = weight;
    q.centred[k] = d;
    sum = sum + weight;
    first = fma(weight, d, first);
    second = fma(weight * d, d, second);
  }
  const F scale = 1.0f / sum, mean = first * scale;
  q.variance = vmax(fma(second, scale, -mean * mean), all<F>(0.0f));
  for (int k = 0; k < job.samples; ++k) {
    q.weight[k] = q.weight[k] * scale;
    q.centred[k] = (q.centred[k] - mean) * q.weight[k];
  }
}

// Where views see planes, and how their image changes along the reference photo.
template <class F>
struct Sight {
  F u, v, ux, uy, vx, vy;
};

constexpr float kOne = 65536.0f;    // fixed point of positions in a photo
constexpr float kWhole = 32767.0f;  // and of the weights along a row

// 1 - NCC of the windows and their images, each lane in its own view. Side: of the windows, samples; 0: not known here.
template <class F, int Side, class L = StereoLanes<F>>
R2_HD F dissimilarity(const StereoJob& job, const Window<F>& q, const Sight<F>& at, typename L::Integers view) {
  const float reach = static_cast<float>(job.reach), margin = static_cast<float>(kStereoMargin);
  const float step = static_cast<float>(job.step) * kOne;
  typename L::Integers line_u = L::truncated((at.u - (at.ux + at.uy) * reach + margin) * kOne);
  typename L::Integers line_v = L::truncated((at.v - (at.vx + at.vy) * reach + margin) * kOne);
  const typename L::Integers ux = L::truncated(at.ux * step), uy = L::truncated(at.uy * step);
  const typename L::Integers vx = L::truncated(at.vx * step), vy = L::truncated(at.vy * step);
  const typename L::Integers strides = L::raw(L::of_view(job, room2dgs::kStereoStrides, view));
  const typename L::Integers offset = L::raw(L::of_view(job, room2dgs::kStereoOffset, view));
  const F middle = q.middle * kWhole;
  F first = all<F>(0.0f), second = first, product = first;
  const F *weight = q.weight, *centred = q.centred;
  const int side = Side > 0 ? Side : job.side;
  for (int y = 0; y < side; ++y, line_u += uy, line_v += vy) {
    typename L::Integers u = line_u, v = line_v;
#ifdef __CUDACC__
#pragma unroll
#else
#pragma GCC unroll 5
#endif
    for (int x = 0; x < side; ++x, u += ux, v += vx) {
      const typename L::Integers quad = L::integers(
          L::gather(job.quads, L::product_of_halves(L::halves(L::logical_shift(u, 16), v), strides) + offset));
      const typename L::Integers along = L::along_row(u);
      const F upper = L::number(L::product_of_halves(quad & 0x00ff00ff, along));
      const F lower = L::number(L::product_of_halves(L::logical_shift(quad, 8) & 0x00ff00ff, along));
      const F grey = fma(L::number(v & 0xffff), (lower - upper) * (1.0f / kOne), upper) - middle;
      const F weighted = *weight * grey;
      first = first + weighted;
      second = fma(weighted, grey, second);
      product = fma(*centred, grey, product);
      ++weight, ++centred;
    }
  }
  const F variance = vmax(second - first * first, all<F>(0.0f)) * (1.0f / (kWhole * kWhole));
  const F ncc = product * (1.0f / kWhole) / vsqrt((q.variance + job.variance_floor) * (variance + job.variance_floor));
  return vmin(vmax(1.0f - ncc, all<F>(0.0f)), all<F>(kStereoWorst));
}

// Forward-backward reprojection error in reference pixels, at most kStereoMaxReprojectionPx.
template <class F, class L = StereoLanes<F>>
R2_HD F round_trip(const StereoJob& job, const Window<F>& q, F u, F v, typename L::Integers view, Mask<F> seen) {
  const auto back = [&](int k) { return L::of_view(job, room2dgs::kStereoBack + k, view); };
  const F column = L::number(L::truncated(u + 0.5f)), line = L::number(L::truncated(v + 0.5f));
  const typename L::Integers pixel = L::truncated(fma(line, L::of_view(job, room2dgs::kStereoWidth, view), column));
  const typename L::Integers first = L::raw(L::of_view(job, room2dgs::kStereoDepth, view));
  const F w = L::gather(job.inverse_depth, L::only(seen, pixel + first));
  // the plane's own pixel with the view's depth at the nearest one: the sub-pixel part is kept
  const F p = fma(u, back(0), fma(v, back(1), fma(w, back(3), back(2))));
  const F r = fma(u, back(4), fma(v, back(5), fma(w, back(7), back(6))));
  const F z = vmax(fma(u, back(8), fma(v, back(9), fma(w, back(11), back(10)))), all<F>(kNearest));
  const F inverse = 1.0f / z, ex = p * inverse - q.x, ey = r * inverse - q.y;
  const F error = vmin(vsqrt(fma(ex, ex, ey * ey)), all<F>(kStereoMaxReprojectionPx));
  return select(w > 0.0f, error, all<F>(kStereoMaxReprojectionPx));
}

template <class F>
struct Plane {
  F w, gx, gy;
};

// Where each lane's view sees the plane, and which lanes' views see it whole.
template <class F, class L = StereoLanes<F>>
R2_HD Mask<F> seen_by(const StereoJob& job, const Window<F>& q, const Plane<F>& plane, typename L::Integers view, Sight<F>& at) {
  const auto there = [&](int k) { return L::of_view(job, room2dgs::kStereoThere + k, view); };
  const F M2 = there(2), M6 = there(6), M10 = there(10), t0 = there(3), t1 = there(7), t2 = there(11);
  const F M0 = there(0), M1 = there(1), M4 = there(4), M5 = there(5), M8 = there(8), M9 = there(9);
  const F p = fma(q.x, M0, fma(q.y, M1, fma(plane.w, t0, M2)));
  const F r = fma(q.x, M4, fma(q.y, M5, fma(plane.w, t1, M6)));
  const F z = fma(q.x, M8, fma(q.y, M9, fma(plane.w, t2, M10)));
  const F inverse = 1.0f / vmax(z, all<F>(kNearest)), u = p * inverse, v = r * inverse;
  const F zx = fma(plane.gx, t2, M8), zy = fma(plane.gy, t2, M9);
  const F ux = (fma(plane.gx, t0, M0) - u * zx) * inverse, uy = (fma(plane.gy, t0, M1) - u * zy) * inverse;
  const F vx = (fma(plane.gx, t1, M4) - v * zx) * inverse, vy = (fma(plane.gy, t1, M5) - v * zy) * inverse;
  const F area = ux * vy - uy * vx, reach = all<F>(static_cast<float>(job.reach));
  Mask<F> seen = (z > kNearest) & (area > kLeastArea) & (area < kLargestArea);
  seen &= (u >= kEdge) & (u <= L::of_view(job, room2dgs::kStereoWidth, view) - (1.0f + kEdge));
  seen &= (v >= kEdge) & (v <= L::of_view(job, room2dgs::kStereoHeight, view) - (1.0f + kEdge));
  seen &= ((L::absolute(ux) + L::absolute(uy)) * reach < kWindowReach) & ((L::absolute(vx) + L::absolute(vy)) * reach < kWindowReach);
  at = {u, v, ux, uy, vx, vy};
  return seen;
}

// A view's number in the last bits of its cost, which is not negative: they sort together.
constexpr int32_t kViewBits = room2dgs::kStereoMaxViews - 1;

template <class F>
struct Judged {
  F cost;
  typename StereoLanes<F>::Integers views;  // a bit for each view that the cost is the mean over
};

// Mean cost of a plane over the `best` views that like it most, of those whose bits are set in `asked`; of them no lane
// has more than `most`. Where no pixel's cost can become less than `limit` any more, some cost that is not less.
template <class F, class L = StereoLanes<F>>
R2_STEREO_CALL Judged<F> cost_of(const StereoJob& job, const Window<F>& q, const Plane<F>& plane,
                                  typename L::Integers asked, int most, F limit) {
  F least[room2dgs::kStereoMaxBest];
  const bool geometric = job.geometric_weight > 0.0f;
  const float worst = kStereoWorst + (geometric ? job.geometric_weight * kStereoMaxReprojectionPx : 0.0f);
  const float share = 1.0f / static_cast<float>(job.best);
  for (int k = 0; k < job.best; ++k) least[k] = all<F>(worst);
  asked = L::only(q.inside, asked);
  for (int to_come = most; to_come > 0; --to_come) {
    if (to_come < job.best) {  // at best the rest costs nothing
      F sum = least[0];
      for (int k = 1; k < job.best - to_come; ++k) sum = sum + least[k];
      if (!L::any(sum * share < limit)) return {sum * share, L::whole(0)};
    }
    const typename L::Integers bit = asked & L::integers(0u - L::bits(asked));
    const Mask<F> there = bit != 0;
    asked &= ~bit;
    // the number of a bit is the exponent of its float; the last one's is negative
    const typename L::Integers view = L::only(there, (L::logical_shift(L::raw(L::number(bit)), 23) & 255) - 127);
    Sight<F> at;
    const Mask<F> seen = there & seen_by<F>(job, q, plane, view, at);
    if (!L::any(seen)) continue;
    // lanes that do not see it look at a harmless place
    at = {masked(seen, at.u), masked(seen, at.v), masked(seen, at.ux), masked(seen, at.uy), masked(seen, at.vx),
          masked(seen, at.vy)};
    F cost = job.side == 5 ? dissimilarity<F, 5>(job, q, at, view) : dissimilarity<F, 0>(job, q, at, view);
    if (geometric && job.inverse_depth)
      cost = fma(round_trip<F>(job, q, at.u, at.v, view, seen), all<F>(job.geometric_weight), cost);
    cost = select(seen, L::float_of((L::raw(cost) & ~kViewBits) | view), all<F>(worst));
    for (int k = 0; k < job.best; ++k) {
      const F low = vmin(least[k], cost);
      cost = vmax(least[k], cost);
      least[k] = low;
    }
  }
  F sum = all<F>(0.0f);
  typename L::Integers views = L::whole(0);
  for (int k = 0; k < job.best; ++k) {
    const typename L::Integers label = L::raw(least[k]), bit = L::bit(label & kViewBits);
    views |= L::only(least[k] < all<F>(worst), bit);
    sum = sum + L::float_of(label & ~kViewBits);
  }
  return {sum * share, views};
}

template <class F, class L = StereoLanes<F>>
R2_HD Plane<F> limited(const StereoJob& job, Plane<F> plane) {
  plane.w = vmin(vmax(plane.w, all<F>(job.w_min)), all<F>(job.w_max));
  const F limit = plane.w * job.slope_limit;
  plane.gx = vmin(vmax(plane.gx, -limit), limit);
  plane.gy = vmin(vmax(plane.gy, -limit), limit);
  return plane;
}

template <class F, class L = StereoLanes<F>>
R2_HD typename L::Integers all_views(const StereoJob& job) {
  return L::whole(static_cast<int32_t>(~0u >> (32 - job.view_count)));
}

struct Arm {
  int dx[4], dy[4];
};

template <class F, class L = StereoLanes<F>>
R2_HD typename L::Bits pixel_keys(const StereoJob& job, const Window<F>& q) {
  const typename L::Integers pixel = L::truncated(q.y) * static_cast<int32_t>(job.width) + L::truncated(q.x);
  return (L::bits(pixel) + 1u) * 0x85ebca6bu ^ job.seed;
}

// The planes as they are get their costs; w <= 0 draws one at random first. `i` counts pixels of the colour in the row.
template <class F, class L = StereoLanes<F>>
R2_HD void stereo_start(const StereoJob& job, int colour, int64_t row, int64_t i) {
  Window<F> q;
  const int first_x = static_cast<int>((row + colour) & 1);
  window_at<F>(job, row, first_x, i, q);
  const int64_t at = room2dgs::stereo_at(job.width, job.height, colour, row, i);
  Plane<F> plane = {L::load(job.w + at), L::load(job.gx + at), L::load(job.gy + at)};
  const typename L::Bits keys = pixel_keys<F>(job, q);
  const Mask<F> none = plane.w <= 0.0f;
  const F w = fma(uniform<F>(keys, 1), all<F>(job.w_max - job.w_min), all<F>(job.w_min));
  plane = {select(none, w, plane.w), select(none, w * symmetric<F>(keys, 2) * job.pixel_slope, plane.gx),
           select(none, w * symmetric<F>(keys, 3) * job.pixel_slope, plane.gy)};
  plane = limited<F>(job, plane);
  L::store(job.w + at, plane.w), L::store(job.gx + at, plane.gx), L::store(job.gy + at, plane.gy);
  // what lies beyond the row's end is in the border: nobody takes it up
  const Judged<F> found = cost_of<F>(job, q, plane, all_views<F>(job), job.view_count, all<F>(1e9f));
  L::store(job.cost + at, select(q.inside, found.cost, all<F>(1e9f)));
  L::store(job.judges + at, L::only(q.inside, found.views));
}

// One pixel's neighbours' planes, its hint and random changes, each taken if it costs less.
template <class F, class L = StereoLanes<F>>
R2_HD void stereo_sweep(const StereoJob& job, const StereoSweep& sweep, int64_t row, int64_t i) {
  // Four near arms and four far ones; of each, the neighbour with the least cost lends its plane. dx + dy is odd.
  constexpr int kNearArms = 4, kAllArms = 8;
  static constexpr Arm kArms[kAllArms] = {
      {{0, -1, 1, 0}, {-1, -2, -2, -3}},  {{0, -1, 1, 0}, {1, 2, 2, 3}},
      {{-1, -2, -2, -3}, {0, -1, 1, 0}},  {{1, 2, 2, 3}, {0, -1, 1, 0}},
      {{0, 0, 0, 0}, {-5, -9, -15, -23}}, {{0, 0, 0, 0}, {5, 9, 15, 23}},
      {{-5, -9, -15, -23}, {0, 0, 0, 0}}, {{5, 9, 15, 23}, {0, 0, 0, 0}},
  };
  Window<F> q;
  const int first_x = static_cast<int>((row + sweep.colour) & 1), other = 1 - sweep.colour;
  window_at<F>(job, row, first_x, i, q);
  const int64_t at = room2dgs::stereo_at(job.width, job.height, sweep.colour, row, i);
  Plane<F> best = {L::load(job.w + at), L::load(job.gx + at), L::load(job.gy + at)};
  F cost = L::load(job.cost + at);
  typename L::Integers judges = L::whole_at(job.judges + at);
  const auto attempt = [&](Plane<F> plane, typename L::Integers asked, int most) {
    plane = limited<F>(job, plane);
    const Judged<F> judged = cost_of<F>(job, q, plane, asked, most, cost);
    const F found = judged.cost;
    const Mask<F> better = (found < cost) & q.inside;
    judges = L::choose(better, judged.views, judges);
    best = {select(better, plane.w, best.w), select(better, plane.gx, best.gx), select(better, plane.gy, best.gy)};
    cost = select(better, found, cost);
  };
  // Of a plane that a neighbour lends those views are asked that like it where it comes from.
  const typename L::Integers everyone = all_views<F>(job);
  const bool few = sweep.judges_only;
  const int some = few ? job.best : job.view_count;
  for (int n = 0; n < (sweep.near_only ? kNearArms : kAllArms); ++n) {
    const Arm& arm = kArms[n];
    F least = all<F>(1e9f);
    Plane<F> lent = best;
    typename L::Integers lenders = L::whole(0);
    for (int k = 0; k < 4; ++k) {
      const int dx = arm.dx[k], dy = arm.dy[k];
      const int64_t line = row + dy, x = 2 * i + first_x + dx;
      const int64_t there = room2dgs::stereo_at(job.width, job.height, other, line, 0) +
                            (x - ((line + other) & 1)) / 2;
      const F theirs = L::load(job.cost + there);
      const Mask<F> less = theirs < least;
      least = select(less, theirs, least);
      const F gx = L::load(job.gx + there), gy = L::load(job.gy + there);
      const F w = L::load(job.w + there) - gx * static_cast<float>(dx) - gy * static_cast<float>(dy);
      lent = {select(less, w, lent.w), select(less, gx, lent.gx), select(less, gy, lent.gy)};
      lenders = L::choose(less, L::whole_at(job.judges + there), lenders);
    }
    attempt(lent, few ? lenders : everyone, some);
  }
  if (job.hint_w) {
    const F w = L::load(job.hint_w + at);
    if (L::any((w > 0.0f) & q.inside))
      attempt({select(w > 0.0f, w, best.w), L::load(job.hint_gx + at), L::load(job.hint_gy + at)}, everyone, job.view_count);
  }
  const typename L::Bits keys = pixel_keys<F>(job, q) ^ (sweep.draw * 0xc2b2ae35u);
  const float size = sweep.perturbation;
  F slope = best.w * job.pixel_slope * size;
  attempt({fma(best.w * (0.1f * size), symmetric<F>(keys, 1), best.w), best.gx, best.gy}, few ? judges : everyone, some);
  attempt({best.w, fma(slope, symmetric<F>(keys, 2), best.gx), fma(slope, symmetric<F>(keys, 3), best.gy)}, few ? judges : everyone, some);
  slope = slope * 0.3f;
  attempt({fma(best.w * (0.02f * size), symmetric<F>(keys, 4), best.w), fma(slope, symmetric<F>(keys, 5), best.gx),
           fma(slope, symmetric<F>(keys, 6), best.gy)}, few ? judges : everyone, some);
  if (sweep.random_depth) {
    const F w = fma(uniform<F>(keys, 7), all<F>(job.w_max - job.w_min), all<F>(job.w_min)), ratio = w / best.w;
    attempt({w, best.gx * ratio, best.gy * ratio}, everyone, job.view_count);
  }
  L::store(job.w + at, best.w), L::store(job.gx + at, best.gx), L::store(job.gy + at, best.gy), L::store(job.cost + at, cost);
  L::store(job.judges + at, judges);
}

// Photometric cost of the planes, and variance of the windows, into (height, width) maps.
template <class F, class L = StereoLanes<F>>
R2_HD void stereo_cost(const StereoJob& job, int colour, int64_t row, int64_t i, float* cost, float* variance) {
  Window<F> q;
  const int first_x = static_cast<int>((row + colour) & 1);
  window_at<F>(job, row, first_x, i, q);
  const int64_t at = room2dgs::stereo_at(job.width, job.height, colour, row, i);
  const Plane<F> plane = {L::load(job.w + at), L::load(job.gx + at), L::load(job.gy + at)};
  const F found = cost_of<F>(job, q, plane, all_views<F>(job), job.view_count, all<F>(1e9f)).cost;
  for (int k = 0; k < L::count; ++k) {
    const int64_t x = 2 * (i + k) + first_x;
    if (x < job.width)
      cost[row * job.width + x] = L::lane(found, k), variance[row * job.width + x] = L::lane(q.variance, k);
  }
}

}  // namespace R2_ISA
