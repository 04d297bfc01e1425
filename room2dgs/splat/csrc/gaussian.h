// The maths of one 3D Gaussian in one view, and its derivative, for any scalar type as surfel.h.
//
// Around its centre the map from the camera's space to the screen and to the inverse depth is taken as linear (EWA). With the
// three axes times their scales A_k in the camera frame, and the centre's direction d = p / z_c:
//   X_k = f_x (A_k.x - d_x A_k.z) / z_c,  Y_k = f_y (A_k.y - d_y A_k.z) / z_c,  W_k = -A_k.z / z_c  (of 1/z, relative)
//   Sigma = [[sum X^2 + h, sum X Y], [sum X Y, sum Y^2 + h]],  h the variance of the pixel's filter
//   rho = delta^T Sigma^-1 delta = (a_u.delta)^2 + (a_v.delta)^2
//   z = z_c / (1 + b.delta),  b = Sigma^-1 (sum X W, sum Y W): the mean of 1/z along the pixel's ray, where the Gaussian is
//   densest (RaDe-GS), which for a flat one is its plane. It is a plane's depth in any case; the normal is that plane's.
// Products of axes give |Sigma| without a difference: sum_{k<l} (X_k Y_l - X_l Y_k)^2 + h (sum X^2 + sum Y^2) + h^2.
#pragma once

#include "surfel.h"

namespace R2_ISA {

constexpr double kBeyondView = 0.3;  // of half the view: further out, d is held for the linear map (3DGS)

// A Gaussian's parameters, world frame; the quaternion (w, x, y, z) may have any norm.
template <class T>
struct Gaussian {
  Vec3<T> center;
  T qw, qx, qy, qz;
  T s[3];
};

template <class T>
struct GaussianProjected {
  Vec3<T> p;                 // centre, camera frame
  Vec3<T> axis[3];           // unit, camera frame
  T cx, cy, dx, dy;          // projected centre, pixels; p / z_c
  T hx, hy;                  // d as the linear map has it
  Mask<T> free_x, free_y;    // h is d
  T X[3], Y[3], W[3];
  T a, b, c, e, f;           // Sigma = [[a, b], [b, c]], and sum X W, sum Y W
  T bare, det;               // determinants without and with the filter
  T aux, auy, avy, bx, by;   // avx is 0
  Vec3<T> normal;            // camera frame, towards the camera
  T inverse_length;          // of the normal before it had unit length
  Mask<T> front;
};

template <class T>
R2_HD T held(T d, double low, double high, Mask<T>& free) {
  free = (d >= T(low)) & (d <= T(high));
  return vmin(vmax(d, T(low)), T(high));
}

template <class T>
R2_HD Axes<T> axes_of(const Gaussian<T>& g) {
  return axes_of(Surfel<T>{g.center, g.qw, g.qx, g.qy, g.qz, g.s[0], g.s[1]});
}

template <class T>
R2_HD GaussianProjected<T> project(const Gaussian<T>& g, const Axes<T>& axes, const View& view) {
  GaussianProjected<T> o;
  o.p = rotate(view.R, g.center) + Vec3<T>{T(view.t[0]), T(view.t[1]), T(view.t[2])};
  o.axis[0] = rotate(view.R, axes.tu), o.axis[1] = rotate(view.R, axes.tv), o.axis[2] = rotate(view.R, axes.tw);
  o.front = o.p.z >= T(view.near);
  const T inverse_z = T(1) / select(o.front, o.p.z, T(1));
  const T fx = T(view.fx), fy = T(view.fy), h = T(view.filter_px2);
  o.dx = o.p.x * inverse_z, o.dy = o.p.y * inverse_z;
  o.cx = fma(fx, o.dx, T(view.cx)), o.cy = fma(fy, o.dy, T(view.cy));
  const double wide = kBeyondView * 0.5 * view.width / view.fx, high = kBeyondView * 0.5 * view.height / view.fy;
  o.hx = held(o.dx, -view.cx / view.fx - wide, (view.width - view.cx) / view.fx + wide, o.free_x);
  o.hy = held(o.dy, -view.cy / view.fy - high, (view.height - view.cy) / view.fy + high, o.free_y);
  T xx = T(), xy = T(), yy = T();
  o.e = T(), o.f = T();
  for (int k = 0; k < 3; ++k) {
    const T s = g.s[k] * inverse_z;
    const T z = s * o.axis[k].z;
    o.X[k] = fx * fma(s, o.axis[k].x, -o.hx * z);
    o.Y[k] = fy * fma(s, o.axis[k].y, -o.hy * z);
    o.W[k] = -z;
    xx = fma(o.X[k], o.X[k], xx), xy = fma(o.X[k], o.Y[k], xy), yy = fma(o.Y[k], o.Y[k], yy);
    o.e = fma(o.X[k], o.W[k], o.e), o.f = fma(o.Y[k], o.W[k], o.f);
  }
  o.bare = T();
  for (int k = 0; k < 3; ++k) {
    const int l = (k + 1) % 3;
    const T m = o.X[k] * o.Y[l] - o.X[l] * o.Y[k];
    o.bare = fma(m, m, o.bare);
  }
  o.a = xx + h, o.b = xy, o.c = yy + h;
  o.det = fma(h, xx + yy + h, o.bare);
  const T root_c = vsqrt(o.c), inverse = T(1) / vsqrt(o.det);
  o.aux = root_c * inverse;
  o.avy = T(1) / root_c;
  o.auy = -o.b * inverse * o.avy;
  const T inverse_det = inverse * inverse;
  o.bx = fma(o.c, o.e, -o.b * o.f) * inverse_det;
  o.by = fma(o.a, o.f, -o.b * o.e) * inverse_det;
  const Vec3<T> m = {o.bx * fx, o.by * fy, T(1) - o.bx * fx * o.dx - o.by * fy * o.dy};
  o.inverse_length = T(1) / vsqrt(dot(m, m));
  o.normal = -o.inverse_length * m;
  return o;
}

// Gradients of the numbers that pixels are drawn by, the normal's in the camera frame; `log_kept` is that of the logarithm
// of what compensation leaves of the opacity.
template <class T>
struct GaussianGrad {
  T cx, cy, z, aux, auy, avy, bx, by;
  Vec3<T> normal;
  T log_kept;
};

// Gradients of a Gaussian's place in the camera frame, of its scales and of the intrinsics.
template <class T>
struct GaussianCameraGrad {
  Vec3<T> p, axis[3];
  T s[3];
  T fx, fy, cx, cy;
};

template <class T>
R2_HD GaussianCameraGrad<T> project_backward(const Gaussian<T>& gaussian, const GaussianProjected<T>& o,
                                             const View& view, GaussianGrad<T> g) {
  const T zero = T(), fx = T(view.fx), fy = T(view.fy), h = T(view.filter_px2);
  const T inverse_z = T(1) / o.p.z, ifx = T(1) / fx, ify = T(1) / fy;
  GaussianCameraGrad<T> r;
  // the normal: -m / |m|, m = (f_x b_x, f_y b_y, 1 - f_x b_x d_x - f_y b_y d_y)
  const T along = dot(o.normal, g.normal);
  const Vec3<T> gm = -o.inverse_length * (g.normal + -along * o.normal);
  const T gbx = g.bx + fx * fma(-o.dx, gm.z, gm.x), gby = g.by + fy * fma(-o.dy, gm.z, gm.y);
  T gdx = fma(fx, g.cx, -gm.z * o.bx * fx), gdy = fma(fy, g.cy, -gm.z * o.by * fy);
  r.fx = fma(g.cx, o.dx, o.bx * fma(-o.dx, gm.z, gm.x)), r.fy = fma(g.cy, o.dy, o.by * fma(-o.dy, gm.z, gm.y));
  r.cx = g.cx, r.cy = g.cy;
  // a_u, a_v and b from Sigma and its determinant
  const T inverse_det = T(1) / o.det, inverse_c = T(1) / o.c;
  const T of_u = fma(g.aux, o.aux, g.auy * o.auy);
  T ga = gby * o.f * inverse_det;
  T gb = -(gbx * o.f + gby * o.e) * inverse_det - g.auy * o.avy * vsqrt(inverse_det);
  T gc = gbx * o.e * inverse_det + T(0.5) * inverse_c * (g.aux * o.aux - g.auy * o.auy - g.avy * o.avy);
  const T ge = fma(o.c, gbx, -o.b * gby) * inverse_det, gf = fma(o.a, gby, -o.b * gbx) * inverse_det;
  const T gdet = -inverse_det * fma(T(0.5), of_u + g.log_kept, fma(gbx, o.bx, gby * o.by));
  const T gbare = gdet + select(o.bare > zero, T(0.5) * g.log_kept / o.bare, zero);
  ga = fma(h, gdet, ga), gc = fma(h, gdet, gc);
  T gX[3], gY[3], gW[3];
  for (int k = 0; k < 3; ++k) {
    gX[k] = fma(T(2) * ga, o.X[k], fma(gb, o.Y[k], ge * o.W[k]));
    gY[k] = fma(T(2) * gc, o.Y[k], fma(gb, o.X[k], gf * o.W[k]));
    gW[k] = fma(ge, o.X[k], gf * o.Y[k]);
  }
  for (int k = 0; k < 3; ++k) {
    const int l = (k + 1) % 3;
    const T gm2 = T(2) * gbare * (o.X[k] * o.Y[l] - o.X[l] * o.Y[k]);
    gX[k] += gm2 * o.Y[l], gX[l] -= gm2 * o.Y[k];
    gY[l] += gm2 * o.X[k], gY[k] -= gm2 * o.X[l];
  }
  T gz = g.z, ghx = zero, ghy = zero;
  for (int k = 0; k < 3; ++k) {
    const T s = gaussian.s[k], scale = s * inverse_z;
    const T gx = fx * gX[k], gy = fy * gY[k];
    const Vec3<T> to = {gx, gy, -(gx * o.hx + gy * o.hy + gW[k])};  // of A_k / z_c
    r.s[k] = inverse_z * dot(to, o.axis[k]);
    r.axis[k] = scale * to;
    gz -= inverse_z * fma(gX[k], o.X[k], fma(gY[k], o.Y[k], gW[k] * o.W[k]));
    ghx = fma(gx, o.W[k], ghx), ghy = fma(gy, o.W[k], ghy);
    r.fx = fma(gX[k] * ifx, o.X[k], r.fx), r.fy = fma(gY[k] * ify, o.Y[k], r.fy);
  }
  // where d is held it is the view's own: (x - c_x) / f_x of a column x
  gdx += select(o.free_x, ghx, zero), gdy += select(o.free_y, ghy, zero);
  const T held_x = select(o.free_x, zero, ghx * ifx), held_y = select(o.free_y, zero, ghy * ify);
  r.fx -= held_x * o.hx, r.fy -= held_y * o.hy;
  r.cx -= held_x, r.cy -= held_y;
  r.p = {gdx * inverse_z, gdy * inverse_z, gz - inverse_z * fma(gdx, o.dx, gdy * o.dy)};
  return r;
}

}  // namespace R2_ISA
