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
using room2dgs::SurfelArrays;

R2_HD Surfel<double> load_surfel(const SurfelArrays& s, int64_t i) {
  const float *c = s.centers + 3 * i, *q = s.rotations + 4 * i, *e = s.scales + 2 * i;
  return {{c[0], c[1], c[2]}, q[0], q[1], q[2], q[3], e[0], e[1]};
}
R2_HD const float* sh_of(const SurfelArrays& s, int64_t i) { return s.sh + 3 * s.sh_count * i; }

// The four side planes of the view, through the camera's centre, normals inwards, for a quick test of spheres.
struct Frustum {
  float R[9], t[3], near;
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
  f.shift = static_cast<float>(::fabs(view.t[0]) + ::fabs(view.t[1]) + ::fabs(view.t[2]));
  const double margin = 4;  // pixels, for the screen-space filter
  side_plane((-margin - view.cx) / view.fx, 1, f.left);
  side_plane((view.width + margin - view.cx) / view.fx, -1, f.right);
  side_plane((-margin - view.cy) / view.fy, 1, f.top);
  side_plane((view.height + margin - view.cy) / view.fy, -1, f.bottom);
  return f;
}

// Which surfels may be seen, by centre, larger scale and opacity: a disc lies in the ball of its largest scale, 3.34
// sigma at most. Of one surfel or eight.
template <class F>
R2_HD Mask<F> maybe_seen(const Frustum& f, F x, F y, F z, F scale, F opacity) {
  const F px = f.R[0] * x + f.R[1] * y + f.R[2] * z + f.t[0];
  const F py = f.R[3] * x + f.R[4] * y + f.R[5] * z + f.t[1];
  const F pz = f.R[6] * x + f.R[7] * y + f.R[8] * z + f.t[2];
  // far from the world's origin the sums above lose digits: kilometres away, millimetres
  const F lost = 1e-6f * (vmax(x, -x) + vmax(y, -y) + vmax(z, -z) + f.shift);
  const F reach = -3.34f * scale - 1e-4f * pz - lost;
  return (pz >= 0.999f * f.near - lost) & (opacity >= kAlphaMin) & (f.left[0] * px + f.left[1] * pz >= reach) &
         (f.right[0] * px + f.right[1] * pz >= reach) & (f.top[0] * py + f.top[1] * pz >= reach) &
         (f.bottom[0] * py + f.bottom[1] * pz >= reach);
}

// A surfel in a view. False where it has no disc or lies in front of the near plane.
R2_HD bool stand(const SurfelArrays& s, int64_t i, const View& view, Axes<double>& axes, Projected<double>& o, Disc& d) {
  const Surfel<double> surfel = load_surfel(s, i);
  axes = axes_of(surfel);
  // a quaternion of no norm (kept in step with splat/constants.py) and scales that are not positive have no disc
  if (!(axes.inverse_norm > 0 && axes.inverse_norm < 1e30 && surfel.su > 0 && surfel.sv > 0)) return false;
  o = project(surfel, axes, view);
  if (!o.front) return false;
  d.rho = 2.0 * ::log(static_cast<double>(s.opacities[i]) / kAlphaMin);
  d.su = surfel.su, d.sv = surfel.sv, d.tu = o.tu, d.tv = o.tv;
  d.cx = o.cx, d.cy = o.cy, d.dx = o.dx, d.dy = o.dy, d.z = o.p.z;
  d.aux = o.aux, d.auy = o.auy, d.avx = o.avx, d.avy = o.avy, d.bx = o.bx, d.by = o.by;
  d.plane = o.plane;
  return true;
}

R2_HD int first_pixel(double x) { return static_cast<int>(::ceil(x - 0.5)); }
R2_HD int last_pixel(double x) { return static_cast<int>(::floor(x - 0.5)); }

// Pixels that a disc can reach, inclusive.
struct PixelRange {
  int x0, x1, y0, y1;
};
R2_HD bool pixels_of(const Reach& r, const View& view, PixelRange& p) {
  const double width = view.width, height = view.height;
  // written so that a NaN fails
  if (!(r.x0 < width && r.x1 > 0 && r.y0 < height && r.y1 > 0)) return false;
  p.x0 = first_pixel(r.x0 > 0 ? r.x0 : 0), p.x1 = last_pixel(r.x1 < width ? r.x1 : width);
  p.y0 = first_pixel(r.y0 > 0 ? r.y0 : 0), p.y1 = last_pixel(r.y1 < height ? r.y1 : height);
  return p.x0 <= p.x1 && p.y0 <= p.y1;
}

// Calls row(ty, begin, end) for every row of tiles in the range, with the tiles [begin, end) of it that the disc reaches.
template <class Row>
R2_HD void for_tile_rows(const Disc& d, const Reach& r, const View& view, const PixelRange& p, Row&& row) {
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
      const int p0 = found ? first_pixel(s0) : 0, p1 = found ? last_pixel(s1) : -1;
      a = p0 / kTile > tx0 ? p0 / kTile : tx0;
      b = p1 < p0 ? a - 1 : (p1 / kTile < tx1 ? p1 / kTile : tx1);
    }
    if (b < a) a = tx0, b = tx0 - 1;
    row(ty, a, b + 1);
  }
}

// Everything of a record: where it lies, what its pixels need, its colour and its normal.
R2_HD void fill_record(const SurfelArrays& s, int64_t i, const View& view, const Axes<double>& axes,
                       const Projected<double>& o, const Disc& d, const Reach& reach, const PixelRange& p, Record& r) {
  r.x0 = static_cast<int16_t>(p.x0), r.x1 = static_cast<int16_t>(p.x1);
  r.y0 = static_cast<int16_t>(p.y0), r.y1 = static_cast<int16_t>(p.y1);
  constexpr double kPixelMargin = 0.02;  // pixels are placed in float
  r.filter2 = static_cast<float>((reach.filter + kPixelMargin) * (reach.filter + kPixelMargin));
  r.ellipse_x = static_cast<float>(d.cx + reach.ex), r.ellipse_y = static_cast<float>(d.cy + reach.ey);
  r.inverse_half_height = static_cast<float>(1 / (reach.hy * kLoose + kPixelMargin));
  r.shear = static_cast<float>(reach.shear);
  r.half_width = reach.crossing ? -1.0f : static_cast<float>(reach.width * kLoose);
  r.margin = static_cast<float>(kPixelMargin + 1e-5 * reach.hx);
  r.cx = static_cast<float>(o.cx), r.cy = static_cast<float>(o.cy), r.z = static_cast<float>(o.p.z);
  r.cx_rest = static_cast<float>(o.cx - r.cx), r.cy_rest = static_cast<float>(o.cy - r.cy);
  r.aux = static_cast<float>(o.aux), r.auy = static_cast<float>(o.auy);
  r.avx = static_cast<float>(o.avx), r.avy = static_cast<float>(o.avy);
  r.bx = static_cast<float>(o.bx), r.by = static_cast<float>(o.by);
  r.den_max = static_cast<float>(o.p.z / view.near);
  r.log2_opacity = static_cast<float>(::log2(static_cast<double>(s.opacities[i])));
  double inverse_distance, color[3];
  color_of(sh_of(s, i), s.sh_count, view_direction(view, o, inverse_distance), color);
  for (int c = 0; c < 3; ++c) r.color[c] = color[c] > 0 ? static_cast<float>(color[c]) : 0.0f;
  r.normal[0] = static_cast<float>(o.side * axes.tw.x);
  r.normal[1] = static_cast<float>(o.side * axes.tw.y);
  r.normal[2] = static_cast<float>(o.side * axes.tw.z);
}

R2_HD void put(float* p, Vec3<double> v) {
  p[0] = static_cast<float>(v.x), p[1] = static_cast<float>(v.y), p[2] = static_cast<float>(v.z);
}
R2_HD void zero(float* p, int64_t count) {
  for (int64_t k = 0; k < count; ++k) p[k] = 0;
}
R2_HD void zero_gradients(const room2dgs::SurfelGradients& out, int64_t i, int sh_floats) {
  zero(out.centers + 3 * i, 3), zero(out.rotations + 4 * i, 4), zero(out.scales + 2 * i, 2);
  zero(out.center_px + 2 * i, 2), zero(out.opacities + i, 1), zero(out.sh + sh_floats * i, sh_floats);
}

// m += left right^T, row-major
R2_HD void add_outer(double* m, Vec3<double> left, Vec3<double> right) {
  m[0] += left.x * right.x, m[1] += left.x * right.y, m[2] += left.x * right.z;
  m[3] += left.y * right.x, m[4] += left.y * right.y, m[5] += left.y * right.z;
  m[6] += left.z * right.x, m[7] += left.z * right.y, m[8] += left.z * right.z;
}

// A visible surfel's gradients from its `count` entries of pixel sums; adds its part of the camera's.
R2_HD void surfel_backward(const View& view, const SurfelArrays& s, int64_t i, const float* entry, uint32_t count,
                           const room2dgs::SurfelGradients& out, room2dgs::CameraGradient& total) {
  double sum[kGradients] = {};
  for (uint32_t e = 0; e < count; ++e, entry += kGradients)
    for (int k = 0; k < kGradients; ++k) sum[k] += entry[k];

  const Surfel<double> surfel = load_surfel(s, i);
  const Axes<double> axes = axes_of(surfel);
  const Projected<double> o = project(surfel, axes, view);
  const NineGrad<double> g = nine_from_sums(sum, o);
  out.center_px[2 * i] = static_cast<float>(g.cx), out.center_px[2 * i + 1] = static_cast<float>(g.cy);
  const CameraGrad<double> c = project_backward(surfel, o, view, g);
  out.scales[2 * i] = static_cast<float>(c.su), out.scales[2 * i + 1] = static_cast<float>(c.sv);
  out.opacities[i] = static_cast<float>(sum[kSumOpacity] / s.opacities[i]);

  double inverse_distance;
  const Vec3<double> direction = view_direction(view, o, inverse_distance);
  const Vec3<double> gd =
      color_backward<double>(sh_of(s, i), s.sh_count, direction, sum + kSumColor, out.sh + int64_t{3} * s.sh_count * i);
  // normalise(p - o): the part across the ray, over the distance
  const Vec3<double> g_view = inverse_distance * (gd + (-dot(gd, direction)) * direction);
  put(out.centers + 3 * i, rotate_transposed(view.R, c.p) + g_view);
  double gq[4];
  axes_backward(axes, rotate_transposed(view.R, c.tu), rotate_transposed(view.R, c.tv),
                rotate_transposed(view.R, c.tw) + o.side * Vec3<double>{sum[kSumNormal], sum[kSumNormal + 1], sum[kSumNormal + 2]}, gq);
  for (int k = 0; k < 4; ++k) out.rotations[4 * i + k] = static_cast<float>(gq[k]);

  // camera = R world + t for the centre, R alone for the axes, and the projection centre -R^T t for the direction
  add_outer(total.R, c.p, surfel.center);
  add_outer(total.R, c.tu, axes.tu), add_outer(total.R, c.tv, axes.tv), add_outer(total.R, c.tw, axes.tw);
  add_outer(total.R, {view.t[0], view.t[1], view.t[2]}, g_view);
  const Vec3<double> g_translation = c.p + rotate(view.R, g_view);
  total.t[0] += g_translation.x, total.t[1] += g_translation.y, total.t[2] += g_translation.z;
  total.fx += c.fx, total.fy += c.fy, total.cx += c.cx, total.cy += c.cy;
}

}  // namespace R2_ISA
