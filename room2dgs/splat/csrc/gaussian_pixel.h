// The maths of one 3D Gaussian at one pixel, and its derivative, for any lane type F as in pixel.h, with the same record:
// rho = u^2 + v^2 with u = a_u.delta, v = a_v.delta, and z = z_c / den with den = 1 + b.delta, which bends the depth alone. Far
// from the centre that map is no longer linear: the depth is held at 8 times the centre's, and is the centre's where the ray's
// would lie before the near plane.
#pragma once

#include "pixel.h"

namespace R2_ISA {

constexpr float kGaussianDenMin = 0.125f;

// `plane` of the hit: the depth is that of the ray.
template <class F>
R2_HD Hit<F> gaussian_hit(const room2dgs::Record& r, F dx, const RowTerms<F>& row) {
  const auto all = [](float x) { return Lanes<F>::all(x); };
  Hit<F> h;
  const F den = fma(all(r.bx), dx, row.den);
  h.inverse = 1.0f / vmax(den, all(kGaussianDenMin));
  h.u = fma(all(r.aux), dx, row.u);
  h.v = fma(all(r.avx), dx, row.v);
  h.rho = fma(h.u, h.u, h.v * h.v);
  h.plane = den <= r.den_max;
  h.z = select(h.plane, r.z * h.inverse, all(r.z));
  h.raw = exp2_from(fma(h.rho, all(-0.72134752044f), all(r.log2_opacity)));
  return h;
}

template <class F>
R2_HD HitGradient<F> gaussian_hit_backward(const Hit<F>& hit, Mask<F> keep, F g_alpha, F g_z) {
  HitGradient<F> g;
  g_z = masked(keep, g_z);
  g.opacity = masked(keep & (hit.raw < kAlphaMax), hit.raw * g_alpha);
  g.filter = Lanes<F>::all(0);
  g.u = -g.opacity * hit.u;
  g.v = -g.opacity * hit.v;
  g.den = masked(hit.plane & (hit.inverse < 1.0f / kGaussianDenMin), -g_z * hit.z * hit.inverse);
  g.z = select(hit.plane, g_z * hit.inverse, g_z);
  return g;
}

// What a Gaussian's pixels are.
struct GaussianHits {
  template <class F>
  static R2_HD Hit<F> hit(const room2dgs::Record& r, F dx, const RowTerms<F>& row) { return gaussian_hit(r, dx, row); }
  template <class F>
  static R2_HD HitGradient<F> backward(const Hit<F>& hit, Mask<F> keep, F g_alpha, F g_z) {
    return gaussian_hit_backward(hit, keep, g_alpha, g_z);
  }
};

}  // namespace R2_ISA
