// What the rasterizer's stages do to one 3D Gaussian, as stages.h does to one surfel.
#pragma once

#include "gaussian.h"
#include "stages.h"

namespace R2_ISA {

// The side planes of the view for the quick test. The linear map can spread a Gaussian wider than perspective spreads the ball
// around it: at most by the length of the direction that the map is taken at, which `project` holds.
R2_HD Frustum gaussian_frustum(const View& view) {
  Frustum f = frustum_of(view);
  const auto far = [](double a, double b) { return a > b ? a : b; };
  const double x = far(view.cx, view.width - view.cx) / view.fx + kBeyondView * 0.5 * view.width / view.fx;
  const double y = far(view.cy, view.height - view.cy) / view.fy + kBeyondView * 0.5 * view.height / view.fy;
  f.deviations *= static_cast<float>(::sqrt(1 + x * x + y * y));
  return f;
}

// A Gaussian in a view, or several. Of `disc` and of what it reaches only what an ellipse about the centre needs is there.
template <class T>
struct GaussianStanding {
  Axes<T> axes;
  GaussianProjected<T> o;
  Disc<T> disc;
  T log2_opacity;
  Mask<T> seen;
};
template <class T>
R2_HD GaussianStanding<T> stand(const Gaussian<T>& g, T opacity, const View& view) {
  GaussianStanding<T> r;
  r.axes = axes_of(g);
  r.o = project(g, r.axes, view);
  const GaussianProjected<T>& o = r.o;
  const T zero = T();
  r.seen = (r.axes.inverse_norm > zero) & (r.axes.inverse_norm < T(1e30)) & (g.s[0] > zero) & (g.s[1] > zero) &
           (g.s[2] > zero) & (o.det > zero) & o.front;
  r.log2_opacity = log2_of(opacity);
  if (view.compensated) {
    r.seen = r.seen & (o.bare > zero);
    r.log2_opacity += T(0.5) * (log2_of(select(o.bare > zero, o.bare, T(1))) - log2_of(o.det));
  }
  constexpr double kLn2 = 0.69314718055994530942;
  const T rho = T(2 * kLn2) * (r.log2_opacity - log2_of(T(view.opacity_floor)));
  const Vec3<T> none = {zero, zero, zero};
  r.disc = {zero, zero, none, none, o.cx, o.cy, zero, zero, zero, zero, zero, zero, zero, zero, zero, o.front, rho};
  r.seen = r.seen & (r.disc.rho >= zero);
  return r;
}

template <class T>
R2_HD Reach<T> reach_before(const GaussianStanding<T>& s, const View&) {
  const GaussianProjected<T>& o = s.o;
  const T rho = s.disc.rho * T(kLoose), zero = T();
  Reach<T> r;
  r.crossing = inverted(s.o.front) & s.o.front;  // never
  r.filter = r.ex = r.ey = zero;
  r.hx = vsqrt(rho * o.a), r.hy = vsqrt(rho * o.c);
  r.shear = o.b / o.c, r.lean = o.b * vsqrt(rho / o.a);
  r.width = vsqrt(rho * o.det / o.c);
  const T hx = r.hx * T(kLoose) + T(kMarginPx), hy = r.hy * T(kLoose) + T(kMarginPx);
  r.x0 = o.cx - hx, r.x1 = o.cx + hx, r.y0 = o.cy - hy, r.y1 = o.cy + hy;
  return r;
}

R2_HD Reach<double> reach_of(const GaussianStanding<double>& s, const View& view) { return reach_before(s, view); }

struct GaussianHits;  // gaussian_pixel.h
struct GaussianKind {
  using Hits = GaussianHits;
  static constexpr int kScales = 3;
  static R2_HD float largest(const float* s) {
    const float two = s[0] > s[1] ? s[0] : s[1];
    return two > s[2] ? two : s[2];
  }
  static R2_HD Frustum frustum(const View& view) { return gaussian_frustum(view); }
  static R2_HD Gaussian<double> load(const SurfelArrays& s, int64_t i) {
    const float *c = s.centers + 3 * i, *q = s.rotations + 4 * i, *e = s.scales + 3 * i;
    return {{c[0], c[1], c[2]}, q[0], q[1], q[2], q[3], {e[0], e[1], e[2]}};
  }
};

template <class T, class Coefficients>
R2_HD RecordNumbers<Narrow<T>> numbers_of(const GaussianStanding<T>& s, const Reach<T>& reach, const View& view,
                                          const Coefficients& sh, int sh_count) {
  const GaussianProjected<T>& o = s.o;
  RecordNumbers<Narrow<T>> r;
  constexpr double kPixelMargin = 0.02;  // pixels are placed in float
  r.filter2 = narrow(T(-1));             // no circle
  r.ellipse_x = narrow(o.cx), r.ellipse_y = narrow(o.cy);
  r.inverse_half_height = narrow(T(1) / (reach.hy * T(kLoose) + T(kPixelMargin)));
  r.shear = narrow(reach.shear);
  r.half_width = narrow(reach.width * T(kLoose));
  r.margin = narrow(T(kPixelMargin) + T(1e-5) * reach.hx);
  r.cx = narrow(o.cx), r.cy = narrow(o.cy), r.z = narrow(o.p.z);
  r.cx_rest = narrow(o.cx - widen(r.cx)), r.cy_rest = narrow(o.cy - widen(r.cy));
  r.aux = narrow(o.aux), r.auy = narrow(o.auy);
  r.avx = narrow(T()), r.avy = narrow(o.avy);
  r.bx = narrow(o.bx), r.by = narrow(o.by);
  r.den_max = narrow(o.p.z / T(view.near));
  r.log2_opacity = narrow(s.log2_opacity);
  T color[3];
  const T inverse_distance = T(1) / vsqrt(dot(o.p, o.p));
  color_of(sh, sh_count, rotate_transposed(view.R, inverse_distance * o.p), color);
  for (int c = 0; c < 3; ++c) r.color[c] = narrow(select(color[c] > T(0), color[c], T(0)));
  const Vec3<T> normal = rotate_transposed(view.R, o.normal);
  r.normal[0] = narrow(normal.x), r.normal[1] = narrow(normal.y), r.normal[2] = narrow(normal.z);
  return r;
}

// As of a surfel (stages.h).
template <class T, class Coefficients, class Put>
R2_HD void splat_backward(const View& view, const Gaussian<T>& gaussian, T opacity, const T* sum, const Coefficients& sh,
                          int sh_count, const room2dgs::SurfelGradients& out, Put&& put,
                          room2dgs::CameraGradient<T>& total) {
  using namespace room2dgs;
  const Axes<T> axes = axes_of(gaussian);
  const GaussianProjected<T> o = project(gaussian, axes, view);
  const T gu = sum[kSumU], gv = sum[kSumV], gden = sum[kSumDen];
  const Vec3<T> g_normal = {sum[kSumNormal], sum[kSumNormal + 1], sum[kSumNormal + 2]};  // world frame
  GaussianGrad<T> g;
  g.aux = sum[kSumU + 1], g.auy = sum[kSumU + 2], g.avy = sum[kSumV + 2];
  g.bx = sum[kSumDen + 1], g.by = sum[kSumDen + 2], g.z = sum[kSumZ];
  g.cx = -(gu * o.aux + gden * o.bx);
  g.cy = -(gu * o.auy + gv * o.avy + gden * o.by);
  g.normal = rotate(view.R, g_normal);
  g.log_kept = view.compensated ? sum[kSumOpacity] : T();
  put(out.center_px, 2, 0, g.cx), put(out.center_px, 2, 1, g.cy);
  const GaussianCameraGrad<T> c = project_backward(gaussian, o, view, g);
  for (int k = 0; k < 3; ++k) put(out.scales, 3, k, c.s[k]);
  put(out.opacities, 1, 0, sum[kSumOpacity] / opacity);

  const T inverse_distance = T(1) / vsqrt(dot(o.p, o.p));
  const Vec3<T> direction = rotate_transposed(view.R, inverse_distance * o.p);
  const auto put_sh = [&](int k, T gradient) { put(out.sh, 3 * sh_count, k, gradient); };
  const Vec3<T> gd = color_backward(sh, sh_count, direction, sum + kSumColor, put_sh);
  // normalise(p - o): the part across the ray, over the distance
  const Vec3<T> g_view = inverse_distance * (gd + (-dot(gd, direction)) * direction);
  const Vec3<T> center = rotate_transposed(view.R, c.p) + g_view;
  put(out.centers, 3, 0, center.x), put(out.centers, 3, 1, center.y), put(out.centers, 3, 2, center.z);
  T rotation[4];
  axes_backward(axes, rotate_transposed(view.R, c.axis[0]), rotate_transposed(view.R, c.axis[1]),
                rotate_transposed(view.R, c.axis[2]), rotation);
  for (int k = 0; k < 4; ++k) put(out.rotations, 4, k, rotation[k]);

  // camera = R world + t for the centre, R alone for the axes, R^T for the normal, and -R^T t for the direction
  add_outer(total.R, c.p, gaussian.center);
  add_outer(total.R, c.axis[0], axes.tu), add_outer(total.R, c.axis[1], axes.tv), add_outer(total.R, c.axis[2], axes.tw);
  add_outer(total.R, o.normal, g_normal);
  add_outer(total.R, {T(view.t[0]), T(view.t[1]), T(view.t[2])}, g_view);
  const Vec3<T> g_translation = c.p + rotate(view.R, g_view);
  total.t[0] += g_translation.x, total.t[1] += g_translation.y, total.t[2] += g_translation.z;
  total.fx += c.fx, total.fy += c.fy, total.cx += c.cx, total.cy += c.cy;
}

}  // namespace R2_ISA
