// See agreement.h.
#include "agreement.h"

#include <algorithm>

#include "simd.h"

namespace R2_ISA {

using room2dgs::AgreementJob;

namespace {

struct Propagated {
  f8 x, y, z;
};
// Pixels in the other view, and z relative to the first view's.
R2_INLINE Propagated carried(const float* m, f8 x, f8 y, f8 w) {
  const auto along = [&](const float* r) { return fma(splat(r[0]), x, fma(splat(r[1]), y, fma(splat(r[3]), w, splat(r[2])))); };
  const f8 z = along(m + 8);
  return {along(m) / z, along(m + 4) / z, z};
}

// Four pixels are of one surface where their inverse depths differ by less.
constexpr float kOneSurface = 1.05f;

// The neighbour's inverse depth at a place, pixels: between four pixels of one surface, whose inverse depth is linear in
// the image, else of the nearest of them.
R2_INLINE f8 seen_at(const AgreementJob& job, f8 x, f8 y) {
  const int32_t columns = static_cast<int32_t>(job.columns), right = columns > 1, below = job.rows > 1 ? columns : 0;
  const auto before = [](f8 x, int64_t count) {  // the pixel to the left, or above, but for the last
    const float last = static_cast<float>(count > 1 ? count - 2 : 0);
    return __builtin_convertvector(vmin(vmax(x, splat(0)), splat(last)), i8);
  };
  const i8 left = before(x, job.columns), top = before(y, job.rows), at = top * columns + left;
  const f8 fx = x - __builtin_convertvector(left, f8), fy = y - __builtin_convertvector(top, f8);
  const f8 a = gather(job.theirs, at), b = gather(job.theirs, at + right);
  const f8 c = gather(job.theirs, at + below), d = gather(job.theirs, at + below + right);
  const f8 least = vmin(vmin(a, b), vmin(c, d)), most = vmax(vmax(a, b), vmax(c, d));
  const f8 upper = fma(fx, b - a, a), lower = fma(fx, d - c, c);
  const f8 nearest_one = select(fy > 0.5f, select(fx > 0.5f, d, c), select(fx > 0.5f, b, a));
  return select((least > 0.0f) & (most < least * kOneSurface), fma(fy, lower - upper, upper), nearest_one);
}

// Eight counters, one more where a mask is set.
R2_INLINE void count_up(uint8_t* counts, i8 mask) {
  for (uint32_t left = bits(mask); left; left &= left - 1) ++counts[__builtin_ctz(left)];
}

// Comparisons are written so that NaN fails them.
R2_INLINE void agree8(const AgreementJob& job, f8 x, f8 y, f8 w, uint8_t* count, uint8_t* through, uint8_t* hidden,
                      float* total, float* squares) {
  const Propagated to = carried(job.there, x, y, w);
  i8 inside = (w > 0.0f) & (to.z > 1e-6f) & (to.x > -0.5f) & (to.x < static_cast<float>(job.columns) - 0.5f) &
              (to.y > -0.5f) & (to.y < static_cast<float>(job.rows) - 0.5f);
  if (!any(inside)) return;
  const f8 seen = seen_at(job, masked(inside, to.x), masked(inside, to.y));
  inside &= seen > 0.0f;
  const Propagated back = carried(job.back, to.x, to.y, seen);
  const f8 dx = back.x - x, dy = back.y - y, ratio = w / to.z / seen;  // of the neighbour's depth there to the point's
  const i8 same = (ratio - 1.0f < job.max_relative) & (1.0f - ratio < job.max_relative);
  const i8 agrees = inside & same & (back.z > 1e-6f) & (dx * dx + dy * dy < job.max_px * job.max_px);
  const f8 said = masked(agrees, seen / back.z);
  count_up(count, agrees);
  count_up(through, inside & (ratio > 1.0f + job.max_relative));
  count_up(hidden, inside & (ratio < 1.0f - job.max_relative));
  store(total, load(total) + said);
  store(squares, fma(said, said, load(squares)));
}

}  // namespace

void agree_row(const AgreementJob& job, int64_t row) {
  const f8 y = splat(static_cast<float>(row));
  const int64_t first = row * job.width;
  int64_t column = 0;
  for (; column + kLanes <= job.width; column += kLanes) {
    const int64_t p = first + column;
    agree8(job, iota() + static_cast<float>(column), y, load(job.own + p), job.count + p, job.through + p,
           job.hidden + p, job.total + p, job.squares + p);
  }
  if (column == job.width) return;
  const int64_t p = first + column, left = job.width - column;
  float own[kLanes] = {}, total[kLanes] = {}, squares[kLanes] = {};
  uint8_t count[kLanes] = {}, through[kLanes] = {}, hidden[kLanes] = {};
  std::copy_n(job.own + p, left, own);
  std::copy_n(job.total + p, left, total), std::copy_n(job.squares + p, left, squares);
  agree8(job, iota() + static_cast<float>(column), y, load(own), count, through, hidden, total, squares);
  std::copy_n(total, left, job.total + p), std::copy_n(squares, left, job.squares + p);
  for (int64_t k = 0; k < left; ++k) {
    job.count[p + k] += count[k], job.through[p + k] += through[k], job.hidden[p + k] += hidden[k];
  }
}

}  // namespace R2_ISA
