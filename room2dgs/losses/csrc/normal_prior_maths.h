// The normal prior's loss (losses/normal_prior.py) at one pixel, or at the lanes of F (scalar.h).
#pragma once

#include "surface_maths.h"

namespace R2_ISA {

constexpr float kNormalMinAlpha = 0.5f, kTinyNormal = 1e-3f;  // as losses/normal_prior.py has them

template <class F>
struct NormalLoss {
  F value;
  Triple<F> gradient;
};

// Of a rendered normal of any length and a unit one, both counted `share` times; a share below 0 counts as 0.
template <class F>
R2_HD NormalLoss<F> normal_loss(Triple<F> rendered, Triple<F> wanted, F share, float l1, float cosine) {
  const auto all = [](float x) { return Lanes<F>::all(x); };
  const F w = vmax(share, all(0.0f)), ones = all(l1), c = all(-cosine);
  const F inverse = 1.0f / vsqrt(inner(rendered, rendered) + kTinyNormal * kTinyNormal);
  const Triple<F> unit = {rendered.x * inverse, rendered.y * inverse, rendered.z * inverse};
  const Triple<F> apart = {unit.x - wanted.x, unit.y - wanted.y, unit.z - wanted.z};
  const auto sign = [&](F d) { return masked(d > 0.0f, ones) - masked(d < 0.0f, ones); };
  const Triple<F> push = {sign(apart.x), sign(apart.y), sign(apart.z)};
  const Triple<F> g = {fma(c, wanted.x, push.x), fma(c, wanted.y, push.y), fma(c, wanted.z, push.z)};
  const F radial = -inner(unit, g), by = w * inverse;
  return {fma(c, inner(unit, wanted) - 1.0f, inner(apart, push)) * w,
          {fma(radial, unit.x, g.x) * by, fma(radial, unit.y, g.y) * by, fma(radial, unit.z, g.z) * by}};
}

}  // namespace R2_ISA
