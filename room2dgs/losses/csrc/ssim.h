// SSIM and L1 of one value from its window means, with their gradient, for any lane type F (scalar.h): float, or values
// side by side (wide.h, included before this file).
//
// With x rendered, y target, d = x - y and m(.) the Gaussian window, SSIM is written with the moments of d:
//
//     SSIM = l c,   l = 1 - m(d)^2 / B1,   c = 1 - var(d) / B2,
//     B1 = m(x)^2 + m(y)^2 + C1,           B2 = var(x) + var(y) + C2,
//
// the same number as the usual (2 mx my + C1)(2 cov + C2) / (B1 B2), but without its float32 cancellation where the
// images agree: 1 - SSIM and its gradient are then sums of small terms instead of differences of large ones.
// Colours are taken about 0.5, which leaves variances as they are and makes their squares four times smaller; the
// zero padding of the images is then -0.5.
#pragma once

#include "scalar.h"

namespace R2_ISA {

constexpr int kTaps = 11, kReach = 5;
constexpr float kC1 = 0.01f * 0.01f, kC2 = 0.03f * 0.03f;
// exp(-k^2 / (2 1.5^2)), normalised; the floats add up to 1 within 3e-9. A list, since CUDA has no arrays of the host's.
#define R2_SSIM_WINDOW                                                                                     \
  {0.0010283801f, 0.007598758f, 0.036000773f, 0.10936069f, 0.21300554f, 0.26601171f,                      \
   0.21300554f,   0.10936069f,  0.036000773f, 0.007598758f, 0.0010283801f}

// Of x - 0.5, d, d^2 and (x - 0.5)^2 + (y - 0.5)^2: at one value, or their window means.
template <class F>
struct Moments {
  F x, d, dd, q;
};
template <class F>
R2_HD Moments<F> moments_of(F x, F y) {
  const F d = x - y, xc = x - 0.5f, yc = y - 0.5f;
  return {xc, d, d * d, fma(yc, yc, xc * xc)};
}
// What the window means of the zero padding are, far outside.
constexpr float kPadding[4] = {-0.5f, 0.0f, 0.0f, 0.5f};

// 1 - SSIM, and the maps whose window sums give its gradient:
// d SSIM / d x = 2 (G * map0 + d (G * map1) + (x - 0.5) (G * map2)).
template <class F>
struct SsimMaps {
  F loss, map0, map1, map2;
};
template <class F>
R2_HD SsimMaps<F> ssim_maps_of(const Moments<F>& mean) {
  const F mx = mean.x, md = mean.d, mdd = mean.dd, mq = mean.q;
  const F my = mx - md, full_x = mx + 0.5f, full_y = my + 0.5f;
  const F b1 = fma(full_x, full_x, fma(full_y, full_y, Lanes<F>::all(kC1)));
  const F b2 = mq - fma(mx, mx, my * my) + kC2;
  const F inverse = 1.0f / (b1 * b2), i1 = inverse * b2, i2 = inverse * b1;
  const F a = md * md * i1, b = (mdd - md * md) * i2;
  const F l = 1.0f - a, c = 1.0f - b;
  SsimMaps<F> r;
  r.loss = a + b - a * b;
  r.map1 = -l * i2, r.map2 = l * b * i2;
  r.map0 = c * i1 * (a * full_x - md) - md * r.map1 - mx * r.map2;
  return r;
}

// The gradient of the loss from the window sums of the maps: the factors of sign(d) and of d(1 - SSIM) / dx are given.
template <class F>
R2_HD F rgb_gradient(F x, F d, F sum0, F sum1, F sum2, float l1_scale, float dssim_scale) {
  const F slope = fma(d, sum1, fma(x - 0.5f, sum2, sum0));
  const F sign = masked(d > 0.0f, Lanes<F>::all(l1_scale)) - masked(d < 0.0f, Lanes<F>::all(l1_scale));
  return fma(slope, Lanes<F>::all(-2.0f * dssim_scale), sign);
}

}  // namespace R2_ISA
