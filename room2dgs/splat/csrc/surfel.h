// The maths of one surfel in one view, and its derivative, for any scalar type and machine (scalar.h); for several at
// once as well (doubles.h). The CPU uses double: some hundred nanoseconds a surfel buy the digits that a grazing disc
// loses in float, and pixels cost far more than surfels. What happens at a pixel is in pixel.h.
//
// Centre form of the ray-disc intersection (eq. 5-7 of the paper, rewritten about the projected centre c):
//   delta = x - c,  den = 1 + b.delta,  z = z_c / den,  u = a_u.delta / den,  v = a_v.delta / den.
#pragma once

#include "raster.h"
#include "scalar.h"

namespace R2_ISA {

using View = room2dgs::Camera;

constexpr float kFilterInverseVariance = 2.0f;
constexpr float kEdgeOn = 1e-3f;
constexpr float kFilterOnlySlope = 1e10f;  // stands for an infinitely thin disc: only its filter is seen

template <class T>
struct Vec3 {
  T x, y, z;
};
template <class T>
R2_HD Vec3<T> operator+(Vec3<T> a, Vec3<T> b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class T>
R2_HD Vec3<T> operator*(T s, Vec3<T> a) { return {s * a.x, s * a.y, s * a.z}; }
template <class T>
R2_HD T dot(Vec3<T> a, Vec3<T> b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }

template <class T>
R2_HD Vec3<T> rotate(const double* R, Vec3<T> v) {
  return {fma(T(R[0]), v.x, fma(T(R[1]), v.y, T(R[2]) * v.z)),
          fma(T(R[3]), v.x, fma(T(R[4]), v.y, T(R[5]) * v.z)),
          fma(T(R[6]), v.x, fma(T(R[7]), v.y, T(R[8]) * v.z))};
}
template <class T>
R2_HD Vec3<T> rotate_transposed(const double* R, Vec3<T> v) {
  return {fma(T(R[0]), v.x, fma(T(R[3]), v.y, T(R[6]) * v.z)),
          fma(T(R[1]), v.x, fma(T(R[4]), v.y, T(R[7]) * v.z)),
          fma(T(R[2]), v.x, fma(T(R[5]), v.y, T(R[8]) * v.z))};
}

// A surfel's parameters, world frame; the quaternion (w, x, y, z) may have any norm.
template <class T>
struct Surfel {
  Vec3<T> center;
  T qw, qx, qy, qz;
  T su, sv;
};

// Unit tangents and normal in the world, and 1 / |q|.
template <class T>
struct Axes {
  Vec3<T> tu, tv, tw;
  T w, x, y, z, inverse_norm;
};

template <class T>
R2_HD Axes<T> axes_of(const Surfel<T>& s) {
  const T norm2 = fma(s.qw, s.qw, fma(s.qx, s.qx, fma(s.qy, s.qy, s.qz * s.qz)));
  const T inverse = T(1) / vsqrt(norm2);
  const T w = s.qw * inverse, x = s.qx * inverse, y = s.qy * inverse, z = s.qz * inverse;
  Axes<T> a;
  a.tu = {T(1) - T(2) * (y * y + z * z), T(2) * (x * y + w * z), T(2) * (x * z - w * y)};
  a.tv = {T(2) * (x * y - w * z), T(1) - T(2) * (x * x + z * z), T(2) * (y * z + w * x)};
  a.tw = {T(2) * (x * z + w * y), T(2) * (y * z - w * x), T(1) - T(2) * (x * x + y * y)};
  a.w = w, a.x = x, a.y = y, a.z = z, a.inverse_norm = inverse;
  return a;
}

// Gradients of the axes to the raw quaternion.
template <class T>
R2_HD void axes_backward(const Axes<T>& a, Vec3<T> gu, Vec3<T> gv, Vec3<T> gw, T* gq) {
  const T w = a.w, x = a.x, y = a.y, z = a.z;
  const T hw = T(2) * (z * gu.y - y * gu.z - z * gv.x + x * gv.z + y * gw.x - x * gw.y);
  const T hx = T(2) * (y * gu.y + z * gu.z + y * gv.x - T(2) * x * gv.y + w * gv.z + z * gw.x - w * gw.y - T(2) * x * gw.z);
  const T hy = T(2) * (x * gu.y - T(2) * y * gu.x - w * gu.z + x * gv.x + z * gv.z + w * gw.x + z * gw.y - T(2) * y * gw.z);
  const T hz = T(2) * (w * gu.y - T(2) * z * gu.x + x * gu.z - w * gv.x - T(2) * z * gv.y + y * gv.z + x * gw.x + y * gw.y);
  const T along = fma(hw, w, fma(hx, x, fma(hy, y, hz * z)));
  gq[0] = (hw - along * w) * a.inverse_norm;
  gq[1] = (hx - along * x) * a.inverse_norm;
  gq[2] = (hy - along * y) * a.inverse_norm;
  gq[3] = (hz - along * z) * a.inverse_norm;
}

// A surfel in a view. `plane` is clear for an edge-on disc, which has the screen-space filter alone.
template <class T>
struct Projected {
  Vec3<T> p;           // centre, camera frame
  Vec3<T> tu, tv, tw;  // camera frame
  T cx, cy;            // projected centre, pixels
  T dx, dy;            // p / z_c
  T kappa;             // t_w . p / z_c
  T bx, by, aux, auy, avx, avy;
  T side;              // the normal that faces the camera is side * t_w
  Mask<T> front, plane;
};

// Unit direction from the camera to the surfel in the world, and 1 / distance.
template <class T>
R2_HD Vec3<T> view_direction(const View& view, const Projected<T>& o, T& inverse_distance) {
  inverse_distance = T(1) / vsqrt(dot(o.p, o.p));
  return rotate_transposed(view.R, inverse_distance * o.p);
}

template <class T>
R2_HD Projected<T> project(const Surfel<T>& s, const Axes<T>& a, const View& view) {
  Projected<T> o;
  o.p = rotate(view.R, s.center) + Vec3<T>{T(view.t[0]), T(view.t[1]), T(view.t[2])};
  o.tu = rotate(view.R, a.tu);
  o.tv = rotate(view.R, a.tv);
  o.tw = rotate(view.R, a.tw);
  o.front = o.p.z >= T(view.near);
  const T inverse_z = T(1) / select(o.front, o.p.z, T(1));
  o.dx = o.p.x * inverse_z;
  o.dy = o.p.y * inverse_z;
  o.cx = fma(T(view.fx), o.dx, T(view.cx));
  o.cy = fma(T(view.fy), o.dy, T(view.cy));
  const T cosine = fma(o.tw.x, o.dx, fma(o.tw.y, o.dy, o.tw.z));
  const T length2 = fma(o.dx, o.dx, fma(o.dy, o.dy, T(1)));
  o.plane = cosine * cosine > kEdgeOn * kEdgeOn * length2;
  o.side = select(cosine < T(0), T(1), T(-1));
  o.kappa = select(o.plane, cosine, T(1));
  const T inverse_kappa = T(1) / o.kappa;
  const T ifx = T(1) / T(view.fx), ify = T(1) / T(view.fy);
  const T bx = o.tw.x * ifx * inverse_kappa, by = o.tw.y * ify * inverse_kappa;
  const T along_u = fma(o.tu.x, o.dx, fma(o.tu.y, o.dy, o.tu.z));
  const T along_v = fma(o.tv.x, o.dx, fma(o.tv.y, o.dy, o.tv.z));
  const T ku = o.p.z / s.su, kv = o.p.z / s.sv;
  o.bx = select(o.plane, bx, T());
  o.by = select(o.plane, by, T());
  o.aux = select(o.plane, ku * fma(-along_u, bx, o.tu.x * ifx), T(kFilterOnlySlope));
  o.auy = select(o.plane, ku * fma(-along_u, by, o.tu.y * ify), T());
  o.avx = select(o.plane, kv * fma(-along_v, bx, o.tv.x * ifx), T());
  o.avy = select(o.plane, kv * fma(-along_v, by, o.tv.y * ify), T(kFilterOnlySlope));
  return o;
}

// Gradients of the nine numbers, as they come out of the pixels.
template <class T>
struct NineGrad {
  T cx, cy, z, aux, auy, avx, avy, bx, by;
};

// From a surfel's sums over pixels (raster.h, kSum...): what moves with the projected centre goes to it.
template <class T>
R2_HD NineGrad<T> nine_from_sums(const T* sum, const Projected<T>& o) {
  using namespace room2dgs;
  const T gu = sum[kSumU], gv = sum[kSumV], gden = sum[kSumDen];
  NineGrad<T> g;
  g.aux = sum[kSumU + 1], g.auy = sum[kSumU + 2], g.avx = sum[kSumV + 1], g.avy = sum[kSumV + 2];
  g.bx = sum[kSumDen + 1], g.by = sum[kSumDen + 2], g.z = sum[kSumZ];
  g.cx = T(kFilterInverseVariance) * sum[kSumFilter], g.cy = T(kFilterInverseVariance) * sum[kSumFilter + 1];
  g.cx -= select(o.plane, gu * o.aux + gv * o.avx + gden * o.bx, T());
  g.cy -= select(o.plane, gu * o.auy + gv * o.avy + gden * o.by, T());
  return g;
}

// Gradients of a surfel's place in the camera frame, of its scales and of the intrinsics.
template <class T>
struct CameraGrad {
  Vec3<T> p, tu, tv, tw;
  T su, sv;
  T fx, fy, cx, cy;
};

template <class T>
R2_HD CameraGrad<T> project_backward(const Surfel<T>& s, const Projected<T>& o, const View& view, NineGrad<T> g) {
  const T ifx = T(1) / T(view.fx), ify = T(1) / T(view.fy);
  const T zero = T();
  // an edge-on disc has constants for slopes
  g.aux = select(o.plane, g.aux, zero), g.auy = select(o.plane, g.auy, zero);
  g.avx = select(o.plane, g.avx, zero), g.avy = select(o.plane, g.avy, zero);
  T gbx = select(o.plane, g.bx, zero), gby = select(o.plane, g.by, zero);
  const T along_u = fma(o.tu.x, o.dx, fma(o.tu.y, o.dy, o.tu.z));
  const T along_v = fma(o.tv.x, o.dx, fma(o.tv.y, o.dy, o.tv.z));
  const T z = o.p.z, inverse_z = T(1) / z;
  const T ku = z / s.su, kv = z / s.sv;
  CameraGrad<T> r;
  // c = f d + (c_x, c_y); a_u, a_v and b fall as 1 / f, each along its own axis
  r.fx = fma(g.cx, o.dx, -ifx * fma(g.aux, o.aux, fma(g.avx, o.avx, gbx * o.bx)));
  r.fy = fma(g.cy, o.dy, -ify * fma(g.auy, o.auy, fma(g.avy, o.avy, gby * o.by)));
  r.cx = g.cx, r.cy = g.cy;
  // a_u = k_u (J^T t_u - (t_u.d) b), k_u = z / s_u
  const T au_g = fma(g.aux, o.aux, g.auy * o.auy), av_g = fma(g.avx, o.avx, g.avy * o.avy);
  r.su = -au_g / s.su;
  r.sv = -av_g / s.sv;
  T gz = g.z + (au_g + av_g) * inverse_z;
  const T galong_u = -ku * fma(g.aux, o.bx, g.auy * o.by), galong_v = -kv * fma(g.avx, o.bx, g.avy * o.by);
  gbx = gbx - ku * along_u * g.aux - kv * along_v * g.avx;
  gby = gby - ku * along_u * g.auy - kv * along_v * g.avy;
  r.tu = {fma(galong_u, o.dx, ku * g.aux * ifx), fma(galong_u, o.dy, ku * g.auy * ify), galong_u};
  r.tv = {fma(galong_v, o.dx, kv * g.avx * ifx), fma(galong_v, o.dy, kv * g.avy * ify), galong_v};
  // b = J^T t_w / kappa, kappa = t_w.d
  const T inverse_kappa = T(1) / o.kappa;
  const T gkappa = -inverse_kappa * fma(gbx, o.bx, gby * o.by);
  r.tw = {fma(gkappa, o.dx, gbx * inverse_kappa * ifx), fma(gkappa, o.dy, gby * inverse_kappa * ify), gkappa};
  // d = p / z
  const T gdx = fma(T(view.fx), g.cx, fma(galong_u, o.tu.x, fma(galong_v, o.tv.x, gkappa * o.tw.x)));
  const T gdy = fma(T(view.fy), g.cy, fma(galong_u, o.tu.y, fma(galong_v, o.tv.y, gkappa * o.tw.y)));
  gz = gz - inverse_z * fma(gdx, o.dx, gdy * o.dy);
  r.p = {gdx * inverse_z, gdy * inverse_z, gz};
  return r;
}

}  // namespace R2_ISA
