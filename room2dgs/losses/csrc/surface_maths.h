// Normals from depth by central differences at one pixel, and the normal-consistency term with its gradients, for any
// lane type F (scalar.h): float, or eight pixels of a row (simd.h, included before this file).
//
// For a pinhole the cross product of the two differences of back-projected points shortens. With D the depth of the
// right, left, lower and upper neighbours and
//
//     p = (D_r - D_l) / (D_r + D_l),   q = (D_d - D_u) / (D_d + D_u),   (dx, dy) = pixel centre - (cx, cy),
//
// it is parallel to -(m_x, m_y, m_z), m = (fx p, fy q, -(1 + p dx + q dy)): exact for every plane, since p and q are
// the relative slopes of 1/D. The triple product with the viewing ray is (D_r + D_l)(D_d + D_u) / (fx fy) > 0 before
// the sign, so m faces the camera at every pixel whose four neighbours have a depth.
#pragma once

#include "scalar.h"
#include "surface.h"

namespace R2_ISA {

template <class F>
struct Triple {
  F x, y, z;
};
template <class F>
R2_HD Triple<F> to_camera(const float* r, Triple<F> v) {
  const auto all = [](float x) { return Lanes<F>::all(x); };
  return {fma(v.x, all(r[0]), fma(v.y, all(r[1]), v.z * r[2])),
          fma(v.x, all(r[3]), fma(v.y, all(r[4]), v.z * r[5])),
          fma(v.x, all(r[6]), fma(v.y, all(r[7]), v.z * r[8]))};
}
template <class F>
R2_HD Triple<F> to_world(const float* r, Triple<F> v) {
  const auto all = [](float x) { return Lanes<F>::all(x); };
  return {fma(v.x, all(r[0]), fma(v.y, all(r[3]), v.z * r[6])),
          fma(v.x, all(r[1]), fma(v.y, all(r[4]), v.z * r[7])),
          fma(v.x, all(r[2]), fma(v.y, all(r[5]), v.z * r[8]))};
}
template <class F>
R2_HD F inner(Triple<F> a, Triple<F> b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }

// The surface normal in the camera frame.
template <class F>
struct SurfaceNormal {
  Mask<F> valid;
  F inverse_sum_x, inverse_sum_y;  // 1 / (D_r + D_l), 1 / (D_d + D_u)
  F dx, dy;
  F inverse_length;
  Triple<F> n;
};

// Depths are 0 where there is none.
template <class F>
R2_HD SurfaceNormal<F> surface_normal_of(F here, F right, F left, F below, F above, F dx, F dy,
                                         const room2dgs::Pinhole& camera) {
  const F one = Lanes<F>::all(1.0f);
  SurfaceNormal<F> s;
  s.valid = (here > 0.0f) & (right > 0.0f) & (left > 0.0f) & (below > 0.0f) & (above > 0.0f);
  s.inverse_sum_x = 1.0f / select(s.valid, right + left, one);
  s.inverse_sum_y = 1.0f / select(s.valid, below + above, one);
  const F p = (right - left) * s.inverse_sum_x, q = (below - above) * s.inverse_sum_y;
  s.dx = dx, s.dy = dy;
  const Triple<F> m = {p * camera.fx, q * camera.fy, -fma(p, s.dx, fma(q, s.dy, one))};
  s.inverse_length = 1.0f / vsqrt(inner(m, m));
  s.n = {m.x * s.inverse_length, m.y * s.inverse_length, m.z * s.inverse_length};
  return s;
}

// What a pixel adds to the loss, and its gradients: to the rendered normal in the camera frame, and to p and q, divided
// by (D_r + D_l)^2 and (D_d + D_u)^2.
template <class F>
struct Consistency {
  F loss;
  Triple<F> towards;
  F gp, gq;
};
template <class F>
R2_HD Consistency<F> consistency_of(const SurfaceNormal<F>& s, Triple<F> rendered, F alpha,
                                    const room2dgs::Pinhole& camera, float scale) {
  Consistency<F> c;
  const F cosine = inner(rendered, s.n);
  // g = d term / d n, its part across n over |m| = d term / d m
  const F weight = masked(s.valid, alpha * -scale);
  const Triple<F> gm = {(rendered.x - s.n.x * cosine), (rendered.y - s.n.y * cosine), (rendered.z - s.n.z * cosine)};
  const F across = weight * s.inverse_length;
  c.gp = masked(s.valid, across * (gm.x * camera.fx - gm.z * s.dx) * s.inverse_sum_x * s.inverse_sum_x);
  c.gq = masked(s.valid, across * (gm.y * camera.fy - gm.z * s.dy) * s.inverse_sum_y * s.inverse_sum_y);
  c.towards = {s.n.x * weight, s.n.y * weight, s.n.z * weight};
  c.loss = masked(s.valid, alpha * (alpha - cosine));
  return c;
}

// The gradient of a pixel's depth, gathered from the pixels beside: dp/dD_r = 2 D_l / (D_r + D_l)^2 and
// dp/dD_l = -2 D_r / (D_r + D_l)^2. `left2` is the depth two to the left, `p_left` the gradient of p one to the left.
template <class F>
R2_HD F depth_gradient_of(F left2, F p_left, F right2, F p_right, F above2, F q_above, F below2, F q_below) {
  const F along_x = left2 * p_left - right2 * p_right;
  const F along_y = above2 * q_above - below2 * q_below;
  return 2.0f * (along_x + along_y);
}

}  // namespace R2_ISA
