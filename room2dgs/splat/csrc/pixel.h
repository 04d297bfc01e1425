// The maths of one surfel at one pixel, and its derivative, for any lane type F (scalar.h): float, or a vector of pixels
// (wide.h, included before this file). Both directions take their branches from `intersect`: the same ones.
#pragma once

#include "raster.h"
#include "scalar.h"
#include "surfel.h"

namespace R2_ISA {

constexpr float kAlphaMax = 0.99f;
constexpr float kTransmittanceMin = 1e-4f;
constexpr float kDenMin = 1e-6f;
constexpr float kDistortionNear = 0.2f, kDistortionFar = 100.0f;
constexpr float kDistortionScale = kDistortionNear * kDistortionFar / (kDistortionFar - kDistortionNear);

template <class F>
struct Hit {
  F u, v, inverse, rho, z, raw;  // raw: opacity before the clamp; the hit counts where it reaches the floor
  Mask<F> plane;                 // the disc itself is hit; elsewhere its screen-space filter
};

// What a hit of a record takes from its row of pixels alone, dy from the projected centre.
template <class F>
struct RowTerms {
  F den, u, v, filter;
};
template <class F>
R2_HD RowTerms<F> row_terms(const room2dgs::Record& r, F dy) {
  return {r.by * dy + 1.0f, r.auy * dy, r.avy * dy, kFilterInverseVariance * dy * dy};
}

// A record dx columns from its projected centre, in a row.
template <class F>
R2_HD Hit<F> intersect(const room2dgs::Record& r, F dx, const RowTerms<F>& row) {
  const auto all = [](float x) { return Lanes<F>::all(x); };
  Hit<F> h;
  const F den = fma(all(r.bx), dx, row.den);
  h.inverse = 1.0f / den;
  h.u = fma(all(r.aux), dx, row.u) * h.inverse;
  h.v = fma(all(r.avx), dx, row.v) * h.inverse;
  const F rho_plane = fma(h.u, h.u, h.v * h.v);
  const F rho_filter = fma(dx * kFilterInverseVariance, dx, row.filter);
  h.plane = (den > kDenMin) & (den <= r.den_max) & (rho_plane <= rho_filter);
  h.rho = select(h.plane, rho_plane, rho_filter);
  h.z = select(h.plane, r.z * h.inverse, all(r.z));
  h.raw = exp2_from(fma(h.rho, all(-0.72134752044f), all(r.log2_opacity)));
  return h;
}

template <class F>
R2_HD Hit<F> intersect(const room2dgs::Record& r, F dx, float dy) {
  const auto all = [](float x) { return Lanes<F>::all(x); };
  const RowTerms<float> row = row_terms(r, dy);
  return intersect(r, dx, RowTerms<F>{all(row.den), all(row.u), all(row.v), all(row.filter)});
}

// A record's offset from a tile's first pixel; the centre's rounding is made good here.
R2_HD float offset(int tile, float center, float rest) { return ((static_cast<float>(tile) + 0.5f) - center) - rest; }

// Columns of a tile, from its first one, that a record reaches in rows whose centres are at `row`; `tile_x` is its first
// pixel. Not of a disc that crosses the near plane, which has its box alone.
template <class F>
struct Columns {
  F left, right;
};
template <class F>
R2_HD Columns<F> columns_of(const room2dgs::Record& r, int tile_x, F row) {
  const auto all = [](float x) { return Lanes<F>::all(x); };
  const float center = -offset(tile_x, r.cx, r.cx_rest);  // column of the projected centre
  const float middle = r.ellipse_x - (static_cast<float>(tile_x) + 0.5f);
  const F none = all(1e30f);
  const F t = row - r.ellipse_y, s = t * r.inverse_half_height, inside = 1.0f - s * s;
  const F half = fma(all(r.half_width), vsqrt(vmax(inside, all(0))), all(r.margin));
  const F mid = fma(all(r.shear), t, all(middle));
  const F dy = row - r.cy, f2 = r.filter2 - dy * dy, f = vsqrt(vmax(f2, all(0)));
  const Mask<F> disc = inside >= 0.0f, filter = f2 >= 0.0f;
  return {vmin(select(disc, mid - half, none), select(filter, center - f, none)),
          vmax(select(disc, mid + half, -none), select(filter, center + f, -none))};
}

// Opacity where the hit is kept, 0 elsewhere.
template <class F>
R2_HD F alpha_of(F raw, Mask<F> keep) {
  return masked(keep, vmin(raw, Lanes<F>::all(kAlphaMax)));
}

// 2DGS's m = far / (far - near) (1 - near / z), less that of the pixel's first hit: nothing cancels.
template <class F>
R2_HD F shifted_depth(F z, F first) {
  return kDistortionScale * (z - first) / (z * first);
}

// sum_j w_j (mu - mu_j)^2 over hits of total weight w, with m1 = sum w mu and m2 = sum w mu^2.
template <class F>
R2_HD F spread(F mu, F w, F m1, F m2) {
  return fma(mu, fma(mu, w, -2.0f * m1), m2);
}

// What one hit gives to its record's sums (raster.h, kSum...).
template <class F>
struct HitGradient {
  F u, v, den, z, filter, opacity;
};

// From the gradients of the hit's alpha and of its depth; none through the clamp.
template <class F>
R2_HD HitGradient<F> hit_backward(const Hit<F>& hit, Mask<F> keep, F g_alpha, F g_z) {
  HitGradient<F> g;
  g_z = masked(keep, g_z);
  g.opacity = masked(keep & (hit.raw < kAlphaMax), hit.raw * g_alpha);
  g.filter = masked(inverted(hit.plane), g.opacity);
  // masked last: off the plane u, v and 1 / den may be infinite
  const F through = g.opacity * hit.inverse;
  g.u = masked(hit.plane, -through * hit.u);
  g.v = masked(hit.plane, -through * hit.v);
  g.den = masked(hit.plane, hit.inverse * fma(g.opacity, hit.rho, -g_z * hit.z));
  g.z = select(hit.plane, g_z * hit.inverse, g_z);
  return g;
}

// What a surfel's pixels are, for code that draws 3D Gaussians as well (gaussian_pixel.h).
struct SurfelHits {
  template <class F>
  static R2_HD Hit<F> hit(const room2dgs::Record& r, F dx, const RowTerms<F>& row) { return intersect(r, dx, row); }
  template <class F>
  static R2_HD HitGradient<F> backward(const Hit<F>& hit, Mask<F> keep, F g_alpha, F g_z) {
    return hit_backward(hit, keep, g_alpha, g_z);
  }
};

}  // namespace R2_ISA
