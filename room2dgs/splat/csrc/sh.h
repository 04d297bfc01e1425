// Real spherical harmonics to degree 3 and their derivative with respect to the direction (geometry/spherical_harmonics.py has the same).
#pragma once

#include "surfel.h"

namespace R2_ISA {

// Calls f(k, value, d/dx, d/dy, d/dz) for k < count; derivatives as if x, y, z were independent.
template <class T, class F>
R2_HD void sh_terms(Vec3<T> d, int count, F&& f) {
  const T o = T(), x = d.x, y = d.y, z = d.z;
  f(0, o + 0.28209479177387814f, o, o, o);
  if (count <= 1) return;
  const float c1 = 0.4886025119029199f;
  f(1, -c1 * y, o, o - c1, o);
  f(2, c1 * z, o, o, o + c1);
  f(3, -c1 * x, o - c1, o, o);
  if (count <= 4) return;
  const float c20 = 1.0925484305920792f, c22 = 0.31539156525252005f, c24 = 0.5462742152960396f;
  const T xx = x * x, yy = y * y, zz = z * z;
  f(4, c20 * x * y, c20 * y, c20 * x, o);
  f(5, -c20 * y * z, o, -c20 * z, -c20 * y);
  f(6, c22 * (2.0f * zz - xx - yy), -2.0f * c22 * x, -2.0f * c22 * y, 4.0f * c22 * z);
  f(7, -c20 * x * z, -c20 * z, o, -c20 * x);
  f(8, c24 * (xx - yy), 2.0f * c24 * x, -2.0f * c24 * y, o);
  if (count <= 9) return;
  const float c30 = -0.5900435899266435f, c31 = 2.890611442640554f, c32 = -0.4570457994644658f,
              c33 = 0.3731763325901154f, c35 = 1.445305721320277f;
  f(9, c30 * y * (3.0f * xx - yy), 6.0f * c30 * x * y, c30 * (3.0f * xx - 3.0f * yy), o);
  f(10, c31 * x * y * z, c31 * y * z, c31 * x * z, c31 * x * y);
  f(11, c32 * y * (4.0f * zz - xx - yy), -2.0f * c32 * x * y, c32 * (4.0f * zz - xx - 3.0f * yy), 8.0f * c32 * y * z);
  f(12, c33 * z * (2.0f * zz - 3.0f * xx - 3.0f * yy), -6.0f * c33 * x * z, -6.0f * c33 * y * z,
    c33 * (6.0f * zz - 3.0f * xx - 3.0f * yy));
  f(13, c32 * x * (4.0f * zz - xx - yy), c32 * (4.0f * zz - 3.0f * xx - yy), -2.0f * c32 * x * y, 8.0f * c32 * x * z);
  f(14, c35 * z * (xx - yy), 2.0f * c35 * x * z, -2.0f * c35 * y * z, c35 * (xx - yy));
  f(15, c30 * x * (xx - 3.0f * yy), c30 * (3.0f * xx - 3.0f * yy), -6.0f * c30 * x * y, o);
}

// Colour seen along a unit direction, before the clamp at 0; sh[3 k + c] is the k-th coefficient of channel c.
template <class T, class Coefficients>
R2_HD void color_of(const Coefficients& sh, int count, Vec3<T> direction, T* color) {
  for (int c = 0; c < 3; ++c) color[c] = T(0.5);
  sh_terms<T>(direction, count, [&](int term, T value, T, T, T) {
    for (int c = 0; c < 3; ++c) color[c] += value * sh[3 * term + c];
  });
}

// Gives the coefficients' gradients to put(3 k + c, gradient), and returns that of the unit direction.
template <class T, class Coefficients, class Put>
R2_HD Vec3<T> color_backward(const Coefficients& sh, int count, Vec3<T> direction, const T* g_color, Put&& put) {
  const T none = T();
  T color[3], g[3];
  color_of(sh, count, direction, color);
  for (int c = 0; c < 3; ++c) g[c] = select(color[c] > none, g_color[c], none);
  Vec3<T> g_direction = {none, none, none};
  sh_terms<T>(direction, count, [&](int term, T value, T ddx, T ddy, T ddz) {
    T through = none;
    for (int c = 0; c < 3; ++c) {
      put(3 * term + c, value * g[c]);
      through += select(g[c] != none, g[c] * sh[3 * term + c], none);
    }
    g_direction = g_direction + through * Vec3<T>{ddx, ddy, ddz};
  });
  return g_direction;
}

}  // namespace R2_ISA
