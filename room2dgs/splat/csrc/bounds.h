// Which pixels and tiles a surfel can reach: exact for its opacity, also for a disc that crosses the camera plane.
//
// A disc is seen where rho <= rho_max = 2 ln(255 opacity), or where its screen-space filter is.
#pragma once

#include <math.h>  // the C functions: inline ones of <cmath> must not be shared between instruction sets

#include "raster.h"
#include "surfel.h"

namespace R2_ISA {

// Pixels are tested in float: what is left out here must be out there too.
constexpr double kLoose = 1.00001, kMarginPx = 1e-3;

template <class T>
struct Disc {
  T su, sv;
  Vec3<T> tu, tv;       // camera frame
  T cx, cy, dx, dy, z;  // projected centre, p / z_c, z_c
  T aux, auy, avx, avy, bx, by;
  Mask<T> plane;
  T rho;
};

template <class T>
struct Reach {
  T x0, x1, y0, y1;  // pixel coordinates
  Mask<T> crossing;  // crosses the near plane: tiles are tested one by one
  T ex, ey;          // ellipse: its centre relative to (cx, cy),
  T hx, hy;          // half extents,
  T shear, lean;     // centre of a row over y; height of its rightmost point,
  T width;           // half width of its middle row, all in pixels
  T filter;          // radius, pixels
};

template <class T>
R2_HD void include(T x, T& low, T& high) {
  low = vmin(x, low);
  high = vmax(x, high);
}

// A disc's two axes on the screen, before the division by depth, and how its depth goes along them, for a deviation.
template <class T>
struct Spread {
  T Xu, Xv, Yu, Yv, Wu, Wv;
};
template <class T>
R2_HD Spread<T> spread_of(const Disc<T>& d, const View& view) {
  return {d.su * view.fx * (d.tu.x - d.dx * d.tu.z), d.sv * view.fx * (d.tv.x - d.dx * d.tv.z),
          d.su * view.fy * (d.tu.y - d.dy * d.tu.z), d.sv * view.fy * (d.tv.y - d.dy * d.tv.z),
          d.su * d.tu.z, d.sv * d.tv.z};
}

// Extremes over the visible part (z >= near) of a disc that crosses the near plane, relative to the projected centre.
// They lie at the ends of the chord z = near or where the boundary turns; rows L (of one axis) and W (of z) over (u, v).
R2_HD void crossing_extremes(double Lu, double Lv, double Wu, double Wv, double z, double near, double c,
                                 double& low, double& high) {
  const double W = ::sqrt(Wu * Wu + Wv * Wv), L = ::sqrt(Lu * Lu + Lv * Lv);
  const double chord = (near - z) / (c * W);
  const double phi = ::atan2(Wv, Wu), open = ::acos(chord < -1 ? -1 : (chord > 1 ? 1 : chord));
  for (int k = -1; k <= 1; k += 2) {
    const double angle = phi + k * open;
    include((c * (Lu * ::cos(angle) + Lv * ::sin(angle)) / near), low, high);
  }
  const double turn = -c * (Lv * Wu - Lu * Wv) / (z * L);
  if (!(turn >= -1 && turn <= 1)) return;
  const double theta0 = ::atan2(-Lu, Lv), half = ::acos(turn);
  for (int k = -1; k <= 1; k += 2) {
    const double angle = theta0 + k * half;
    const double depth = z + c * (Wu * ::cos(angle) + Wv * ::sin(angle));
    if (depth >= near) include((c * (Lu * ::cos(angle) + Lv * ::sin(angle)) / depth), low, high);
  }
}

// What a disc reaches that lies before the near plane as a whole; one that crosses it lacks its box (`add_crossing`).
template <class T>
R2_HD Reach<T> reach_before(const Disc<T>& d, const View& view) {
  Reach<T> r;
  r.filter = vsqrt(d.rho / T(kFilterInverseVariance)) * T(kLoose) + T(kMarginPx);
  r.x0 = d.cx - r.filter, r.x1 = d.cx + r.filter;
  r.y0 = d.cy - r.filter, r.y1 = d.cy + r.filter;
  const Spread<T> a = spread_of(d, view);
  const T rho = d.rho * T(kLoose);
  const T along = vsqrt(rho) * vsqrt(a.Wu * a.Wu + a.Wv * a.Wv);
  const Mask<T> before = d.z - along > T(view.near);
  const Mask<T> whole = d.plane & before;
  r.crossing = d.plane & inverted(before);
  const T s = rho * (T(1) / (d.z * d.z - along * along));
  const T ex = -s * (a.Xu * a.Wu + a.Xv * a.Wv), ey = -s * (a.Yu * a.Wu + a.Yv * a.Wv);
  const T sxx = ex * ex + s * (a.Xu * a.Xu + a.Xv * a.Xv), syy = ey * ey + s * (a.Yu * a.Yu + a.Yv * a.Yv);
  const T sxy = ex * ey + s * (a.Xu * a.Yu + a.Xv * a.Yv);
  const T half_x = vsqrt(sxx), half_y = vsqrt(syy), shear = sxy / syy;
  // without an ellipse they are 0, and the box below lies inside the filter's
  r.ex = select(whole, ex, T()), r.ey = select(whole, ey, T());
  r.hx = select(whole, half_x, T()), r.hy = select(whole, half_y, T());
  r.shear = select(whole, shear, T()), r.lean = select(whole, sxy / half_x, T());
  r.width = select(whole, vsqrt(vmax(sxx - sxy * shear, T())), T());
  const T hx = r.hx * T(kLoose) + T(kMarginPx), hy = r.hy * T(kLoose) + T(kMarginPx);
  include(d.cx + r.ex - hx, r.x0, r.x1), include(d.cx + r.ex + hx, r.x0, r.x1);
  include(d.cy + r.ey - hy, r.y0, r.y1), include(d.cy + r.ey + hy, r.y0, r.y1);
  return r;
}

// The box of a disc that crosses the near plane.
R2_HD void add_crossing(const Disc<double>& d, const View& view, Reach<double>& r) {
  const Spread<double> a = spread_of(d, view);
  const double radius = vsqrt(d.rho * kLoose);
  double x0 = 0, x1 = 0, y0 = 0, y1 = 0;
  crossing_extremes(a.Xu, a.Xv, a.Wu, a.Wv, d.z, view.near, radius, x0, x1);
  crossing_extremes(a.Yu, a.Yv, a.Wu, a.Wv, d.z, view.near, radius, y0, y1);
  const double mx = 1e-4 * (x1 - x0) + kMarginPx, my = 1e-4 * (y1 - y0) + kMarginPx;
  include(d.cx + x0 - mx, r.x0, r.x1), include(d.cx + x1 + mx, r.x0, r.x1);
  include(d.cy + y0 - my, r.y0, r.y1), include(d.cy + y1 + my, r.y0, r.y1);
}

R2_HD Reach<double> reach_of(const Disc<double>& d, const View& view) {
  Reach<double> r = reach_before(d, view);
  if (r.crossing) add_crossing(d, view, r);
  return r;
}

// The x range of ellipse and filter circle over the strip [y0, y1], pixels. False when neither reaches it.
R2_HD bool strip_range(const Disc<double>& d, const Reach<double>& r, double y0, double y1, double& x0, double& x1) {
  bool found = false;
  x0 = 1e30, x1 = -1e30;
  const double fy = (d.cy < y0 ? y0 : (d.cy > y1 ? y1 : d.cy)) - d.cy;
  const double f2 = r.filter * r.filter - fy * fy;
  if (f2 >= 0) {
    const double half = ::sqrt(f2);
    x0 = d.cx - half, x1 = d.cx + half, found = true;
  }
  if (!d.plane) return found;
  const double ey = d.cy + r.ey;
  const double top = y0 > ey - r.hy ? y0 : ey - r.hy, bottom = y1 < ey + r.hy ? y1 : ey + r.hy;
  if (top > bottom + 1e-6 * r.hy + kMarginPx) return found;
  const double inverse_hy = 1.0 / r.hy, margin = 1e-6 * r.hx + kMarginPx;
  for (int k = -1; k <= 1; k += 2) {
    double y = ey + k * r.lean;  // where the boundary is furthest to this side
    y = y < top ? top : (y > bottom ? bottom : y);
    const double t = y - ey, inside = 1.0 - t * inverse_hy * (t * inverse_hy);
    const double x = d.cx + r.ex + r.shear * t + k * (r.width * ::sqrt(inside > 0 ? inside : 0) + margin);
    if (k < 0) x0 = x < x0 ? x : x0;
    else x1 = x > x1 ? x : x1;
  }
  return true;
}

// Does a disc that crosses the near plane reach the rectangle? Its visible part is convex on the screen, so either it
// holds the projected centre or it cuts an edge, where the condition is a quadratic.
R2_HD bool crossing_meets(const Disc<double>& d, double x0, double x1, double y0, double y1) {
  const double ax = x0 - d.cx, bx = x1 - d.cx, ay = y0 - d.cy, by = y1 - d.cy;
  const double f = ::sqrt(d.rho / kFilterInverseVariance);
  if (ax <= f && bx >= -f && ay <= f && by >= -f) return true;
  const double corner[4][2] = {{ax, ay}, {bx, ay}, {bx, by}, {ax, by}};
  const double rho = d.rho * kLoose;
  for (int k = 0; k < 4; ++k) {
    const double *p = corner[k], *q = corner[(k + 1) & 3];
    const double ex = q[0] - p[0], ey = q[1] - p[1];
    const double u0 = d.aux * p[0] + d.auy * p[1], u1 = d.aux * ex + d.auy * ey;
    const double v0 = d.avx * p[0] + d.avy * p[1], v1 = d.avx * ex + d.avy * ey;
    const double n0 = 1 + d.bx * p[0] + d.by * p[1], n1 = d.bx * ex + d.by * ey;
    const double c = u0 * u0 + v0 * v0 - rho * n0 * n0;
    if (c <= 0 && n0 > 0) return true;
    const double a = u1 * u1 + v1 * v1 - rho * n1 * n1, b = u0 * u1 + v0 * v1 - rho * n0 * n1;
    if (a <= 0) continue;  // concave along the edge: its ends decide
    const double t = -b / a;
    if (t > 0 && t < 1 && c + b * t <= 0 && n0 + n1 * t > 0) return true;
  }
  return false;
}

}  // namespace R2_ISA
