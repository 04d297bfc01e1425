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


constexpr float kNearest = 1e-4f;          // of a homogeneous coordinate that is divided by
constexpr float kLeastArea = 0.15f;        // of a reference pixel as the view sees it, and the largest: beyond, a
constexpr float kLargestArea = 6.0f;       // patch of pixels is not comparable
constexpr float kEdge = 2.0f;              // a window's centre keeps this far from the view's border, pixels
constexpr float kWindowReach = 18.0f;      // and its corners stay within the replicated margin

R2_INLINE f8 to_float(i8 x) { return __builtin_convertvector(x, f8); }
R2_INLINE i8 truncated(f8 x) { return __builtin_convertvector(x, i8); }
R2_INLINE f8 vabs(f8 x) { return as_float(as_int(x) & splat_i(0x7fffffff)); }
typedef uint32_t u8 __attribute__((vector_size(32)));

// Eight loads in place of one `vpgatherdd`: that is microcode on many processors, and nothing runs beside it.
R2_INLINE u8 gather(const uint32_t* p, i8 index) {
#if defined(__AVX2__)
  const __m256i i = reinterpret_cast<__m256i>(index);
  const __m128i low = _mm256_castsi256_si128(i), high = _mm256_extracti128_si256(i, 1);
  const auto two = [&](uint64_t pair) {
    return _mm_unpacklo_epi32(_mm_cvtsi32_si128(static_cast<int>(p[static_cast<uint32_t>(pair)])),
                              _mm_cvtsi32_si128(static_cast<int>(p[pair >> 32])));
  };
  const __m128i a = _mm_unpacklo_epi64(two(_mm_cvtsi128_si64(low)), two(_mm_extract_epi64(low, 1)));
  const __m128i b = _mm_unpacklo_epi64(two(_mm_cvtsi128_si64(high)), two(_mm_extract_epi64(high, 1)));
  return reinterpret_cast<u8>(_mm256_set_m128i(b, a));
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

// Sums of the products of the two 16-bit numbers in each lane.
R2_INLINE i8 product_of_halves(i8 a, i8 b) {
#if defined(__AVX2__)
  return reinterpret_cast<i8>(_mm256_madd_epi16(reinterpret_cast<__m256i>(a), reinterpret_cast<__m256i>(b)));
#else
  return ((a << 16) >> 16) * ((b << 16) >> 16) + (a >> 16) * (b >> 16);
#endif
}
// The low 16 bits of `low` below the high 16 bits of `high`.
R2_INLINE i8 halves(i8 low, i8 high) {
#if defined(__AVX2__)
  return reinterpret_cast<i8>(
      _mm256_blend_epi16(reinterpret_cast<__m256i>(low), reinterpret_cast<__m256i>(high), 0xaa));
#else
  return (low & 0xffff) | (high & ~0xffff);
#endif
}
R2_INLINE i8 logical_shift(i8 x, int by) { return reinterpret_cast<i8>(reinterpret_cast<u8>(x) >> by); }

// The weights of a pixel and its right neighbour by the low 16 bits of a position, adding up to kWhole.
R2_INLINE i8 along_row(i8 position) {
#if defined(__AVX2__)
  const __m256i low = _mm256_set1_epi32(0x01000100) + _mm256_setr_epi64x(0x0404040400000000, 0x0c0c0c0c08080808,
                                                                         0x0404040400000000, 0x0c0c0c0c08080808);
  const __m256i twice = _mm256_srli_epi16(_mm256_shuffle_epi8(reinterpret_cast<__m256i>(position), low), 1);
  return reinterpret_cast<i8>(twice) ^ 0x7fff;
#else
  const i8 half = (position & 0xffff) >> 1;
  return (half << 16) | (0x7fff - half);
#endif
}

// Of each lane's own view.
R2_INLINE f8 of_view(const StereoJob& job, int field, i8 view) {
  const float* table = job.table + field * room2dgs::kStereoMaxViews;
#if defined(__AVX2__)
  if (job.view_count <= kLanes) return _mm256_permutevar8x32_ps(load(table), reinterpret_cast<__m256i>(view));
#endif
  return gather(table, view);
}

// Where views see planes, and how their image changes along the reference photo.
struct Sight {
  f8 u, v, ux, uy, vx, vy;
};

constexpr float kOne = 65536.0f;    // fixed point of positions in a photo
constexpr float kWhole = 32767.0f;  // and of the weights along a row

// 1 - NCC of the windows and their images, each lane in its own view. Side: of the windows, samples; 0: not known here.
template <int Side>
R2_INLINE f8 dissimilarity(const StereoJob& job, const Window& q, const Sight& at, i8 view) {
  const float reach = static_cast<float>(job.reach), margin = static_cast<float>(kStereoMargin);
  const float step = static_cast<float>(job.step) * kOne;
  i8 line_u = truncated((at.u - (at.ux + at.uy) * reach + margin) * kOne);
  i8 line_v = truncated((at.v - (at.vx + at.vy) * reach + margin) * kOne);
  const i8 ux = truncated(at.ux * step), uy = truncated(at.uy * step);
  const i8 vx = truncated(at.vx * step), vy = truncated(at.vy * step);
  const i8 strides = as_int(of_view(job, room2dgs::kStereoStrides, view));
  const i8 offset = as_int(of_view(job, room2dgs::kStereoOffset, view));
  const f8 middle = q.middle * kWhole;
  f8 first = splat(0.0f), second = first, product = first;
  const f8 *weight = q.weight, *centred = q.centred;
  const int side = Side > 0 ? Side : job.side;
  for (int y = 0; y < side; ++y, line_u += uy, line_v += vy) {
    i8 u = line_u, v = line_v;
#pragma GCC unroll 5
    for (int x = 0; x < side; ++x, u += ux, v += vx) {
      const i8 quad = reinterpret_cast<i8>(
          gather(job.quads, product_of_halves(halves(logical_shift(u, 16), v), strides) + offset));
      const i8 along = along_row(u);
      const f8 upper = to_float(product_of_halves(quad & 0x00ff00ff, along));
      const f8 lower = to_float(product_of_halves(logical_shift(quad, 8) & 0x00ff00ff, along));
      const f8 grey = fma(to_float(v & 0xffff), (lower - upper) * (1.0f / kOne), upper) - middle;
      const f8 weighted = *weight * grey;
      first = first + weighted;
      second = fma(weighted, grey, second);
      product = fma(*centred, grey, product);
      ++weight, ++centred;
    }
  }
  const f8 variance = vmax(second - first * first, splat(0.0f)) * (1.0f / (kWhole * kWhole));
  const f8 ncc = product * (1.0f / kWhole) / vsqrt((q.variance + job.variance_floor) * (variance + job.variance_floor));
  return vmin(vmax(1.0f - ncc, splat(0.0f)), splat(kStereoWorst));
}

// Forward-backward reprojection error in reference pixels, at most kStereoMaxReprojectionPx.
R2_INLINE f8 round_trip(const StereoJob& job, const Window& q, f8 u, f8 v, i8 view, i8 seen) {
  const auto back = [&](int k) { return of_view(job, room2dgs::kStereoBack + k, view); };
  const f8 column = to_float(truncated(u + 0.5f)), line = to_float(truncated(v + 0.5f));
  const i8 pixel = truncated(fma(line, of_view(job, room2dgs::kStereoWidth, view), column));
  const i8 first = as_int(of_view(job, room2dgs::kStereoDepth, view));
  const f8 w = gather(job.inverse_depth, seen & (pixel + first));
  // the plane's own pixel with the view's depth at the nearest one: the sub-pixel part is kept
  const f8 p = fma(u, back(0), fma(v, back(1), fma(w, back(3), back(2))));
  const f8 r = fma(u, back(4), fma(v, back(5), fma(w, back(7), back(6))));
  const f8 z = vmax(fma(u, back(8), fma(v, back(9), fma(w, back(11), back(10)))), splat(kNearest));
  const f8 inverse = 1.0f / z, ex = p * inverse - q.x, ey = r * inverse - q.y;
  const f8 error = vmin(vsqrt(fma(ex, ex, ey * ey)), splat(kStereoMaxReprojectionPx));
  return select(w > 0.0f, error, splat(kStereoMaxReprojectionPx));
}

struct Plane {
  f8 w, gx, gy;
};

// Where each lane's view sees the plane, and which lanes' views see it whole.
R2_INLINE i8 seen_by(const StereoJob& job, const Window& q, const Plane& plane, i8 view, Sight& at) {
  const auto there = [&](int k) { return of_view(job, room2dgs::kStereoThere + k, view); };
  const f8 M2 = there(2), M6 = there(6), M10 = there(10), t0 = there(3), t1 = there(7), t2 = there(11);
  const f8 M0 = there(0), M1 = there(1), M4 = there(4), M5 = there(5), M8 = there(8), M9 = there(9);
  const f8 p = fma(q.x, M0, fma(q.y, M1, fma(plane.w, t0, M2)));
  const f8 r = fma(q.x, M4, fma(q.y, M5, fma(plane.w, t1, M6)));
  const f8 z = fma(q.x, M8, fma(q.y, M9, fma(plane.w, t2, M10)));
  const f8 inverse = 1.0f / vmax(z, splat(kNearest)), u = p * inverse, v = r * inverse;
  const f8 zx = fma(plane.gx, t2, M8), zy = fma(plane.gy, t2, M9);
  const f8 ux = (fma(plane.gx, t0, M0) - u * zx) * inverse, uy = (fma(plane.gy, t0, M1) - u * zy) * inverse;
  const f8 vx = (fma(plane.gx, t1, M4) - v * zx) * inverse, vy = (fma(plane.gy, t1, M5) - v * zy) * inverse;
  const f8 area = ux * vy - uy * vx, reach = splat(static_cast<float>(job.reach));
  i8 seen = (z > kNearest) & (area > kLeastArea) & (area < kLargestArea);
  seen &= (u >= kEdge) & (u <= of_view(job, room2dgs::kStereoWidth, view) - (1.0f + kEdge));
  seen &= (v >= kEdge) & (v <= of_view(job, room2dgs::kStereoHeight, view) - (1.0f + kEdge));
  seen &= ((vabs(ux) + vabs(uy)) * reach < kWindowReach) & ((vabs(vx) + vabs(vy)) * reach < kWindowReach);
  at = {u, v, ux, uy, vx, vy};
  return seen;
}

// A view's number in the last bits of its cost, which is not negative: they sort together.
constexpr int32_t kViewBits = room2dgs::kStereoMaxViews - 1;

struct Judged {
  f8 cost;
  i8 views;  // a bit for each view that the cost is the mean over
};

// Mean cost of a plane over the `best` views that like it most, of those whose bits are set in `asked`; of them no lane
// has more than `most`. Where no pixel's cost can become less than `limit` any more, some cost that is not less.
__attribute__((noinline)) Judged cost_of(const StereoJob& job, const Window& q, const Plane& plane, i8 asked, int most,
                                         f8 limit) {
  f8 least[room2dgs::kStereoMaxBest];
  const bool geometric = job.geometric_weight > 0.0f;
  const float worst = kStereoWorst + (geometric ? job.geometric_weight * kStereoMaxReprojectionPx : 0.0f);
  const float share = 1.0f / static_cast<float>(job.best);
  for (int k = 0; k < job.best; ++k) least[k] = splat(worst);
  asked &= q.inside;
  for (int to_come = most; to_come > 0; --to_come) {
    if (to_come < job.best) {  // at best the rest costs nothing
      f8 sum = least[0];
      for (int k = 1; k < job.best - to_come; ++k) sum = sum + least[k];
      if (!any(sum * share < limit)) return {sum * share, splat_i(0)};
    }
    const i8 bit = asked & reinterpret_cast<i8>(0u - reinterpret_cast<u8>(asked)), there = bit != 0;
    asked &= ~bit;
    // the number of a bit is the exponent of its float; the last one's is negative
    const i8 view = there & ((logical_shift(as_int(to_float(bit)), 23) & 255) - 127);
    Sight at;
    const i8 seen = there & seen_by(job, q, plane, view, at);
    if (!any(seen)) continue;
    // lanes that do not see it look at a harmless place
    at = {masked(seen, at.u), masked(seen, at.v), masked(seen, at.ux), masked(seen, at.uy), masked(seen, at.vx),
          masked(seen, at.vy)};
    f8 cost = job.side == 5 ? dissimilarity<5>(job, q, at, view) : dissimilarity<0>(job, q, at, view);
    if (geometric && job.inverse_depth)
      cost = fma(round_trip(job, q, at.u, at.v, view, seen), splat(job.geometric_weight), cost);
    cost = select(seen, as_float((as_int(cost) & ~kViewBits) | view), splat(worst));
    for (int k = 0; k < job.best; ++k) {
      const f8 low = vmin(least[k], cost);
      cost = vmax(least[k], cost);
      least[k] = low;
    }
  }
  f8 sum = splat(0.0f);
  i8 views = splat_i(0);
  for (int k = 0; k < job.best; ++k) {
    const i8 label = as_int(least[k]), bit = splat_i(1) << (label & kViewBits);
    views |= (least[k] < splat(worst)) & bit;
    sum = sum + as_float(label & ~kViewBits);
  }
  return {sum * share, views};
}

R2_INLINE Plane limited(const StereoJob& job, Plane plane) {
  plane.w = vmin(vmax(plane.w, splat(job.w_min)), splat(job.w_max));
  const f8 limit = plane.w * job.slope_limit;
  plane.gx = vmin(vmax(plane.gx, -limit), limit);
  plane.gy = vmin(vmax(plane.gy, -limit), limit);
  return plane;
}

R2_INLINE i8 all_views(const StereoJob& job) { return splat_i(static_cast<int32_t>(~0u >> (32 - job.view_count))); }
R2_INLINE i8 load(const int32_t* p) { i8 r; std::memcpy(&r, p, 32); return r; }
R2_INLINE void store(int32_t* p, i8 x) { std::memcpy(p, &x, 32); }

struct Arm {
  int dx[4], dy[4];
};
// Four near arms and four far ones; of each, the neighbour with the least cost lends its plane. dx + dy is odd.
constexpr int kNearArms = 4, kAllArms = 8;
constexpr Arm kArms[kAllArms] = {
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
      const Judged found = cost_of(job, q, plane, all_views(job), job.view_count, splat(1e9f));
      store(job.w + at, plane.w), store(job.gx + at, plane.gx), store(job.gy + at, plane.gy);
      store(job.cost + at, select(q.inside, found.cost, splat(1e9f)));
      store(job.judges + at, found.views & q.inside);
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
    i8 judges = load(job.judges + at);
    const auto attempt = [&](Plane plane, i8 asked, int most) {
      plane = limited(job, plane);
      const Judged judged = cost_of(job, q, plane, asked, most, cost);
      const f8 found = judged.cost;
      const i8 better = (found < cost) & q.inside;
      judges = select(better, judged.views, judges);
      best = {select(better, plane.w, best.w), select(better, plane.gx, best.gx), select(better, plane.gy, best.gy)};
      cost = select(better, found, cost);
    };
    // Of a plane that a neighbour lends those views are asked that like it where it comes from.
    const i8 everyone = all_views(job);
    const bool few = sweep.judges_only;
    const int some = few ? job.best : job.view_count;
    for (int n = 0; n < (sweep.near_only ? kNearArms : kAllArms); ++n) {
      const Arm& arm = kArms[n];
      f8 least = splat(1e9f);
      Plane lent = best;
      i8 lenders = splat_i(0);
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
        lenders = select(less, load(job.judges + there), lenders);
      }
      attempt(lent, few ? lenders : everyone, some);
    }
    if (job.hint_w) {
      const f8 w = load(job.hint_w + at);
      if (any((w > 0.0f) & q.inside))
        attempt({select(w > 0.0f, w, best.w), load(job.hint_gx + at), load(job.hint_gy + at)}, everyone, job.view_count);
    }
    const u8 keys = pixel_keys(job, q) ^ (sweep.draw * 0xc2b2ae35u);
    const float size = sweep.perturbation;
    f8 slope = best.w * job.pixel_slope * size;
    attempt({fma(best.w * (0.1f * size), symmetric(keys, 1), best.w), best.gx, best.gy}, few ? judges : everyone, some);
    attempt({best.w, fma(slope, symmetric(keys, 2), best.gx), fma(slope, symmetric(keys, 3), best.gy)}, few ? judges : everyone, some);
    slope = slope * 0.3f;
    attempt({fma(best.w * (0.02f * size), symmetric(keys, 4), best.w), fma(slope, symmetric(keys, 5), best.gx),
             fma(slope, symmetric(keys, 6), best.gy)}, few ? judges : everyone, some);
    if (sweep.random_depth) {
      const f8 w = fma(uniform(keys, 7), splat(job.w_max - job.w_min), splat(job.w_min)), ratio = w / best.w;
      attempt({w, best.gx * ratio, best.gy * ratio}, everyone, job.view_count);
    }
    store(job.w + at, best.w), store(job.gx + at, best.gx), store(job.gy + at, best.gy), store(job.cost + at, cost);
    store(job.judges + at, judges);
  }
}

void stereo_cost_row(const StereoJob& job, int64_t row, float* cost, float* variance) {
  Window q;
  for (int colour = 0; colour < 2; ++colour) {
    const int first_x = static_cast<int>((row + colour) & 1);
    for (int64_t i = 0; 2 * i + first_x < job.width; i += kLanes) {
      window_at(job, row, first_x, i, q);
      const int64_t at = room2dgs::stereo_at(job.width, job.height, colour, row, i);
      const f8 found = cost_of(job, q, {load(job.w + at), load(job.gx + at), load(job.gy + at)}, all_views(job), job.view_count, splat(1e9f)).cost;
      for (int k = 0; k < kLanes; ++k) {
        const int64_t x = 2 * (i + k) + first_x;
        if (x < job.width) cost[row * job.width + x] = found[k], variance[row * job.width + x] = q.variance[k];
      }
    }
  }
}

}  // namespace R2_ISA
