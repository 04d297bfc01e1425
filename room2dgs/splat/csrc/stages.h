// What the rasterizer's stages do to one surfel, in the loops of the CPU's kernels and in block code: from the arrays to
// its record and its tiles, and back from its pixel sums to the gradients of its parameters.
#pragma once

#include <math.h>

#include "bounds.h"
#include "raster.h"
#include "scalar.h"
#include "sh.h"
#include "surfel.h"

namespace R2_ISA {

using room2dgs::kGradients;
using room2dgs::kSumColor;
using room2dgs::kSumNormal;
using room2dgs::kSumOpacity;
using room2dgs::kTile;
using room2dgs::Record;
using room2dgs::RecordNumbers;
using room2dgs::SurfelArrays;

R2_HD Surfel<double> load_surfel(const SurfelArrays& s, int64_t i) {
  const float *c = s.centers + 3 * i, *q = s.rotations + 4 * i, *e = s.scales + 2 * i;
  return {{c[0], c[1], c[2]}, q[0], q[1], q[2], q[3], e[0], e[1]};
}
R2_HD const float* sh_of(const SurfelArrays& s, int64_t i) { return s.sh + 3 * s.sh_count * i; }

// The four side planes of the view, through the camera's centre, normals inwards, for a quick test of spheres.
struct Frustum {
  float R[9], t[3], near, opacity_floor;
  float deviations;  // of a disc, over its edge: an opaque one falls to the floor before
  float shift;  // |t|: what rounding can do to a place follows from it and from the place
  float left[2], right[2], top[2], bottom[2];  // (x or y, z) of the unit normal
};
R2_HD void side_plane(double slope, double sign, float* plane) {
  const double length = ::sqrt(1 + slope * slope);
  plane[0] = static_cast<float>(sign / length), plane[1] = static_cast<float>(-sign * slope / length);
}
R2_HD Frustum frustum_of(const View& view) {
  Frustum f;
  for (int k = 0; k < 9; ++k) f.R[k] = static_cast<float>(view.R[k]);
  for (int k = 0; k < 3; ++k) f.t[k] = static_cast<float>(view.t[k]);
  f.near = static_cast<float>(view.near);
  f.opacity_floor = view.opacity_floor;
  f.deviations = static_cast<float>(1.003 * ::sqrt(-2 * ::log(view.opacity_floor)));
  f.shift = static_cast<float>(::fabs(view.t[0]) + ::fabs(view.t[1]) + ::fabs(view.t[2]));
  const double margin = 4;  // pixels, for the screen-space filter
  side_plane((-margin - view.cx) / view.fx, 1, f.left);
  side_plane((view.width + margin - view.cx) / view.fx, -1, f.right);
  side_plane((-margin - view.cy) / view.fy, 1, f.top);
  side_plane((view.height + margin - view.cy) / view.fy, -1, f.bottom);
  return f;
}

// Which surfels may be seen, by centre, larger scale and opacity: a disc lies in the ball of its largest scale times
// `deviations`. Of one surfel or eight.
template <class F>
R2_HD Mask<F> maybe_seen(const Frustum& f, F x, F y, F z, F scale, F opacity) {
  const F px = f.R[0] * x + f.R[1] * y + f.R[2] * z + f.t[0];
  const F py = f.R[3] * x + f.R[4] * y + f.R[5] * z + f.t[1];
  const F pz = f.R[6] * x + f.R[7] * y + f.R[8] * z + f.t[2];
  // far from the world's origin the sums above lose digits: kilometres away, millimetres
  const F lost = 1e-6f * (vmax(x, -x) + vmax(y, -y) + vmax(z, -z) + f.shift);
  const F reach = -f.deviations * scale - 1e-4f * pz - lost;
  return (pz >= 0.999f * f.near - lost) & (opacity >= f.opacity_floor) & (f.left[0] * px + f.left[1] * pz >= reach) &
         (f.right[0] * px + f.right[1] * pz >= reach) & (f.top[0] * py + f.top[1] * pz >= reach) &
         (f.bottom[0] * py + f.bottom[1] * pz >= reach);
}

// A surfel in a view, or several.
template <class T>
struct Standing {
  Axes<T> axes;
  Projected<T> o;
  Disc<T> disc;
  T log2_opacity;
  Mask<T> seen;  // clear where it has no disc or lies in front of the near plane
};
template <class T>
R2_HD Standing<T> stand(const Surfel<T>& s, T opacity, const View& view) {
  Standing<T> r;
  r.axes = axes_of(s);
  r.o = project(s, r.axes, view);
  // a quaternion of no norm (kept in step with splat/constants.py) and scales that are not positive have no disc
  r.seen = (r.axes.inverse_norm > T(0)) & (r.axes.inverse_norm < T(1e30)) & (s.su > T(0)) & (s.sv > T(0)) & r.o.front;
  r.log2_opacity = log2_of(opacity);
  constexpr double kLn2 = 0.69314718055994530942;
  Disc<T>& d = r.disc;
  const Projected<T>& o = r.o;
  d.rho = T(2 * kLn2) * (r.log2_opacity - log2_of(T(view.opacity_floor)));
  d.su = s.su, d.sv = s.sv, d.tu = o.tu, d.tv = o.tv;
  d.cx = o.cx, d.cy = o.cy, d.dx = o.dx, d.dy = o.dy, d.z = o.p.z;
  d.aux = o.aux, d.auy = o.auy, d.avx = o.avx, d.avy = o.avy, d.bx = o.bx, d.by = o.by;
  d.plane = o.plane;
  return r;
}
template <class T>
R2_HD Reach<T> reach_before(const Standing<T>& s, const View& view) { return reach_before(s.disc, view); }
R2_HD Reach<double> reach_of(const Standing<double>& s, const View& view) { return reach_of(s.disc, view); }

// What differs between surfels and 3D Gaussians (gaussian_stages.h) besides the overloads of stand, reach_before, reach_of,
// numbers_of and splat_backward: how many scales one has, the largest of them, the quick test of what may be seen, what its
// pixels are, and one of an array.
struct SurfelHits;  // pixel.h
struct SurfelKind {
  using Hits = SurfelHits;
  static constexpr int kScales = 2;
  static R2_HD float largest(const float* scales) { return scales[0] > scales[1] ? scales[0] : scales[1]; }
  static R2_HD Frustum frustum(const View& view) { return frustum_of(view); }
  static R2_HD Surfel<double> load(const SurfelArrays& s, int64_t i) { return load_surfel(s, i); }
};

template <class T>
R2_HD T first_pixel(T x) { return vceil(x - T(0.5)); }
template <class T>
R2_HD T last_pixel(T x) { return vfloor(x - T(0.5)); }

// Pixels that a disc can reach, inclusive, as whole numbers; `some` is clear where there are none.
template <class T>
struct Box {
  T x0, x1, y0, y1;
  Mask<T> some;
};
template <class T>
R2_HD Box<T> box_of(const Reach<T>& r, const View& view) {
  const T zero = T(), width = T(view.width), height = T(view.height);
  Box<T> b;
  b.x0 = first_pixel(vmax(r.x0, zero)), b.x1 = last_pixel(vmin(r.x1, width));
  b.y0 = first_pixel(vmax(r.y0, zero)), b.y1 = last_pixel(vmin(r.y1, height));
  // written so that a NaN fails
  b.some = (r.x0 < width) & (r.x1 > zero) & (r.y0 < height) & (r.y1 > zero) & (b.x0 <= b.x1) & (b.y0 <= b.y1);
  return b;
}

// A box that has pixels, in integers.
struct PixelRange {
  int x0, x1, y0, y1;
};
R2_HD PixelRange range_of(const Box<double>& b) {
  return {static_cast<int>(b.x0), static_cast<int>(b.x1), static_cast<int>(b.y0), static_cast<int>(b.y1)};
}

// Calls row(ty, begin, end) for every row of tiles in the range, with the tiles [begin, end) of it that the disc reaches.
template <class Row>
R2_HD void for_tile_rows(const Disc<double>& d, const Reach<double>& r, const View& view, const PixelRange& p,
                         Row&& row) {
  const double width = view.width;
  const int tx0 = p.x0 / kTile, tx1 = p.x1 / kTile, ty0 = p.y0 / kTile, ty1 = p.y1 / kTile;
  for (int ty = ty0; ty <= ty1; ++ty) {
    const double sy0 = ty * kTile + 0.5, sy1 = sy0 + kTile - 1;
    int a = tx0, b = tx1;
    if (r.crossing) {
      while (a <= b && !crossing_meets(d, a * kTile + 0.5, a * kTile + kTile - 0.5, sy0, sy1)) ++a;
      while (b > a && !crossing_meets(d, b * kTile + 0.5, b * kTile + kTile - 0.5, sy0, sy1)) --b;
    } else if (tx0 != tx1 || ty0 != ty1) {
      double s0, s1;
      const bool found = strip_range(d, r, sy0, sy1, s0, s1);
      // a NaN takes the whole row; far numbers do not fit an int
      s0 = s0 > 0 ? (s0 < width ? s0 : width) : 0, s1 = s1 < width ? (s1 > -1 ? s1 : -1) : width;
      const int p0 = found ? static_cast<int>(first_pixel(s0)) : 0, p1 = found ? static_cast<int>(last_pixel(s1)) : -1;
      a = p0 / kTile > tx0 ? p0 / kTile : tx0;
      b = p1 < p0 ? a - 1 : (p1 / kTile < tx1 ? p1 / kTile : tx1);
    }
    if (b < a) a = tx0, b = tx0 - 1;
    row(ty, a, b + 1);
  }
}

// A record's numbers: where it lies, what its pixels need, its normal and, from its coefficients `sh`, its colour.
template <class T, class Coefficients>
R2_HD RecordNumbers<Narrow<T>> numbers_of(const Standing<T>& s, const Reach<T>& reach, const View& view,
                                          const Coefficients& sh, int sh_count) {
  const Projected<T>& o = s.o;
  RecordNumbers<Narrow<T>> r;
  constexpr double kPixelMargin = 0.02;  // pixels are placed in float
  const T radius = reach.filter + T(kPixelMargin);
  r.filter2 = narrow(radius * radius);
  r.ellipse_x = narrow(o.cx + reach.ex), r.ellipse_y = narrow(o.cy + reach.ey);
  r.inverse_half_height = narrow(T(1) / (reach.hy * T(kLoose) + T(kPixelMargin)));
  r.shear = narrow(reach.shear);
  r.half_width = narrow(select(reach.crossing, T(-1), reach.width * T(kLoose)));
  r.margin = narrow(T(kPixelMargin) + T(1e-5) * reach.hx);
  r.cx = narrow(o.cx), r.cy = narrow(o.cy), r.z = narrow(o.p.z);
  r.cx_rest = narrow(o.cx - widen(r.cx)), r.cy_rest = narrow(o.cy - widen(r.cy));
  r.aux = narrow(o.aux), r.auy = narrow(o.auy);
  r.avx = narrow(o.avx), r.avy = narrow(o.avy);
  r.bx = narrow(o.bx), r.by = narrow(o.by);
  r.den_max = narrow(o.p.z / T(view.near));
  r.log2_opacity = narrow(s.log2_opacity);
  T inverse_distance, color[3];
  color_of(sh, sh_count, view_direction(view, o, inverse_distance), color);
  for (int c = 0; c < 3; ++c) r.color[c] = narrow(select(color[c] > T(0), color[c], T(0)));
  r.normal[0] = narrow(o.side * s.axes.tw.x);
  r.normal[1] = narrow(o.side * s.axes.tw.y);
  r.normal[2] = narrow(o.side * s.axes.tw.z);
  return r;
}
R2_HD void put_box(const PixelRange& p, Record& r) {
  r.x0 = static_cast<int16_t>(p.x0), r.x1 = static_cast<int16_t>(p.x1);
  r.y0 = static_cast<int16_t>(p.y0), r.y1 = static_cast<int16_t>(p.y1);
}

// A surfel's pixel sums (raster.h, kSum...) over its `count` entries.
R2_HD void sum_entries(const float* entry, uint32_t count, double* sum) {
  for (int k = 0; k < kGradients; ++k) sum[k] = 0;
  for (uint32_t e = 0; e < count; ++e, entry += kGradients)
    for (int k = 0; k < kGradients; ++k) sum[k] += entry[k];
}

R2_HD void zero(float* p, int64_t count) {
  for (int64_t k = 0; k < count; ++k) p[k] = 0;
}
R2_HD void zero_gradients(const room2dgs::SurfelGradients& out, int64_t i, int scales, int sh_floats) {
  zero(out.centers + 3 * i, 3), zero(out.rotations + 4 * i, 4), zero(out.scales + scales * i, scales);
  zero(out.center_px + 2 * i, 2), zero(out.opacities + i, 1), zero(out.sh + sh_floats * i, sh_floats);
}

// m += left right^T, row-major
template <class T>
R2_HD void add_outer(T* m, Vec3<T> left, Vec3<T> right) {
  m[0] += left.x * right.x, m[1] += left.x * right.y, m[2] += left.x * right.z;
  m[3] += left.y * right.x, m[4] += left.y * right.y, m[5] += left.y * right.z;
  m[6] += left.z * right.x, m[7] += left.z * right.y, m[8] += left.z * right.z;
}

// From a visible surfel's pixel sums the gradients of its parameters, each to put(array, numbers a surfel, which of them,
// gradient) as soon as it is known; adds the surfel's part of the camera's.
template <class T, class Coefficients, class Put>
R2_HD void splat_backward(const View& view, const Surfel<T>& surfel, T opacity, const T* sum, const Coefficients& sh,
                           int sh_count, const room2dgs::SurfelGradients& out, Put&& put,
                           room2dgs::CameraGradient<T>& total) {
  const Axes<T> axes = axes_of(surfel);
  const Projected<T> o = project(surfel, axes, view);
  const NineGrad<T> g = nine_from_sums(sum, o);
  put(out.center_px, 2, 0, g.cx), put(out.center_px, 2, 1, g.cy);
  const CameraGrad<T> c = project_backward(surfel, o, view, g);
  put(out.scales, 2, 0, c.su), put(out.scales, 2, 1, c.sv);
  put(out.opacities, 1, 0, sum[kSumOpacity] / opacity);

  T inverse_distance;
  const Vec3<T> direction = view_direction(view, o, inverse_distance);
  const auto put_sh = [&](int k, T gradient) { put(out.sh, 3 * sh_count, k, gradient); };
  const Vec3<T> gd = color_backward(sh, sh_count, direction, sum + kSumColor, put_sh);
  // normalise(p - o): the part across the ray, over the distance
  const Vec3<T> g_view = inverse_distance * (gd + (-dot(gd, direction)) * direction);
  const Vec3<T> center = rotate_transposed(view.R, c.p) + g_view;
  put(out.centers, 3, 0, center.x), put(out.centers, 3, 1, center.y), put(out.centers, 3, 2, center.z);
  T rotation[4];
  const Vec3<T> g_normal = {sum[kSumNormal], sum[kSumNormal + 1], sum[kSumNormal + 2]};
  axes_backward(axes, rotate_transposed(view.R, c.tu), rotate_transposed(view.R, c.tv),
                rotate_transposed(view.R, c.tw) + o.side * g_normal, rotation);
  for (int k = 0; k < 4; ++k) put(out.rotations, 4, k, rotation[k]);

  // camera = R world + t for the centre, R alone for the axes, and the projection centre -R^T t for the direction
  add_outer(total.R, c.p, surfel.center);
  add_outer(total.R, c.tu, axes.tu), add_outer(total.R, c.tv, axes.tv), add_outer(total.R, c.tw, axes.tw);
  add_outer(total.R, {T(view.t[0]), T(view.t[1]), T(view.t[2])}, g_view);
  const Vec3<T> g_translation = c.p + rotate(view.R, g_view);
  total.t[0] += g_translation.x, total.t[1] += g_translation.y, total.t[2] += g_translation.z;
  total.fx += c.fx, total.fy += c.fy, total.cx += c.cx, total.cy += c.cy;
}

}  // namespace R2_ISA
