// Two views of one surface (losses/multiview.py), a pixel at a time: the round trip to a neighbour and back, and the
// warp of a pixel's tangent plane, with their derivatives.
#pragma once

#include "scalar.h"
#include "surface_maths.h"

namespace R2_ISA {

// As losses/multiview.py, geometry/homography.py and train/terms/multiview.py have them.
constexpr float kMaxErrorPx = 1.0f, kMinDepth = 1e-2f, kMaxDepth = 1e3f, kMinPatchVariance = 1e-8f;
constexpr float kMinFacing = 0.05f, kMinDistance = 1e-3f, kMinWeight = 1e-3f, kTinyNormal = 1e-3f;
constexpr float kWholeShare = 1.0f - 1e-4f;
constexpr int kMaxPatch = 31;

// Two pinholes: `there` = R of the neighbour from the reference, t its translation.
struct ViewPair {
  float fx, fy, cx, cy, other_fx, other_fy, other_cx, other_cy;
  float reference[9];  // cam_from_world's rotation
  float R[9], t[3];    // neighbour_from_reference
};

// From (3, 3) matrices without skew and (4, 4) poses.
R2_HD ViewPair view_pair(const float* K, const float* pose, const float* other_K, const float* other_pose) {
  ViewPair v = {K[0], K[4], K[2], K[5], other_K[0], other_K[4], other_K[2], other_K[5], {}, {}, {}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      v.reference[3 * i + j] = pose[4 * i + j];
      const float *a = other_pose + 4 * i, *b = pose + 4 * j;
      v.R[3 * i + j] = fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]));
    }
  }
  for (int i = 0; i < 3; ++i)
    v.t[i] = other_pose[4 * i + 3] - fma(v.R[3 * i], pose[3], fma(v.R[3 * i + 1], pose[7], v.R[3 * i + 2] * pose[11]));
  return v;
}

// to_camera and to_world (surface_maths.h) turn by a matrix of rows and by its transpose.
R2_HD Triple<float> ray_of(float x, float y, float fx, float fy, float cx, float cy) {
  return {(x - cx) / fx, (y - cy) / fy, 1.0f};
}

// An image between its pixels, and outside of it as at its border, with the derivatives.
struct Between {
  float value, dx, dy;
};

template <class T>
R2_HD Between between(const T* image, int64_t height, int64_t width, float x, float y) {
  const float right = static_cast<float>(width - 1), bottom = static_cast<float>(height - 1);
  x -= 0.5f, y -= 0.5f;
  const bool across = x > 0.0f && x < right, down = y > 0.0f && y < bottom;
  x = vmin(vmax(x, 0.0f), right), y = vmin(vmax(y, 0.0f), bottom);
  const int64_t left = static_cast<int64_t>(x), top = static_cast<int64_t>(y);
  const float s = x - static_cast<float>(left), t = y - static_cast<float>(top);
  const int64_t next = left + 1 < width ? 1 : 0, below = top + 1 < height ? width : 0;
  const T* p = image + top * width + left;
  const float a = static_cast<float>(p[0]), b = static_cast<float>(p[next]);
  const float c = static_cast<float>(p[below]), d = static_cast<float>(p[below + next]);
  const float upper = fma(s, b - a, a), lower = fma(s, d - c, c);
  return {fma(t, lower - upper, upper), across ? fma(t, (d - c) - (b - a), b - a) : 0.0f, down ? lower - upper : 0.0f};
}

// Where a camera sees a point, and how that moves with the point.
struct Seen {
  float x, y, dx, dy;
};
R2_HD Seen seen_at(const Triple<float>& point, const Triple<float>& moves, float fx, float fy, float cx, float cy) {
  const float inverse = 1.0f / point.z, x = point.x * inverse, y = point.y * inverse;
  return {fma(fx, x, cx), fma(fy, y, cy), fx * inverse * fma(-x, moves.z, moves.x), fy * inverse * fma(-y, moves.z, moves.y)};
}

// e = |p - H_nr H_rn p| and its derivative by the depth; weight exp(-e), or 0 where nothing can be compared.
struct RoundTrip {
  float error, moves, weight;
};

R2_HD RoundTrip round_trip(const ViewPair& v, float x, float y, float depth, const float* inverse_depth, int64_t height,
                           int64_t width, float step) {
  const Triple<float> ray = ray_of(x, y, v.fx, v.fy, v.cx, v.cy), moves = to_camera(v.R, ray);
  const Triple<float> there = {fma(moves.x, depth, v.t[0]), fma(moves.y, depth, v.t[1]), fma(moves.z, depth, v.t[2])};
  const Seen at = seen_at(there, moves, v.other_fx, v.other_fy, v.other_cx, v.other_cy);
  const float map_x = (at.x - 0.5f) / step + 0.5f, map_y = (at.y - 0.5f) / step + 0.5f;
  const bool inside = map_x >= 0.5f && map_x <= static_cast<float>(width) - 0.5f && map_y >= 0.5f &&
                      map_y <= static_cast<float>(height) - 0.5f;
  if (!inside || !(there.z > kMinDepth)) return {0.0f, 0.0f, 0.0f};
  const Between inverse = between(inverse_depth, height, width, map_x, map_y);
  if (!(inverse.value > 1.0f / kMaxDepth)) return {0.0f, 0.0f, 0.0f};
  const float found = 1.0f / inverse.value, nearer = -found * found * fma(inverse.dx, at.dx, inverse.dy * at.dy) / step;
  const Triple<float> other = ray_of(at.x, at.y, v.other_fx, v.other_fy, v.other_cx, v.other_cy);
  const Triple<float> point = {fma(other.x, found, -v.t[0]), fma(other.y, found, -v.t[1]), found - v.t[2]};
  const Triple<float> goes = {fma(other.x, nearer, at.dx / v.other_fx * found),
                              fma(other.y, nearer, at.dy / v.other_fy * found), nearer};
  const Triple<float> back = to_world(v.R, point);
  if (!(back.z > kMinDepth)) return {0.0f, 0.0f, 0.0f};
  const Seen home = seen_at(back, to_world(v.R, goes), v.fx, v.fy, v.cx, v.cy);
  const float ex = home.x - x, ey = home.y - y, error = vsqrt(fma(ex, ex, ey * ey));
  if (!(error < kMaxErrorPx)) return {error, 0.0f, 0.0f};
  const float along = error > 0.0f ? fma(ex, home.dx, ey * home.dy) / error : 0.0f;
  return {error, along, exp2_from(-1.44269504f * error)};
}

// The tangent plane m . X = 1 of a pixel, in the reference camera.
struct Tangent {
  Triple<float> normal, m, ray;
  float facing, distance, length;  // length: of the rendered normal, softened
  bool free;                       // the distance follows depth and normal
};

R2_HD Tangent tangent_of(const ViewPair& v, float x, float y, float depth, const float* rendered) {
  const Triple<float> n = to_camera(v.reference, Triple<float>{rendered[0], rendered[1], rendered[2]});
  const float length = vsqrt(fma(kTinyNormal, kTinyNormal, inner(n, n))), inverse = 1.0f / length;
  Tangent q = {{n.x * inverse, n.y * inverse, n.z * inverse}, {}, ray_of(x, y, v.fx, v.fy, v.cx, v.cy), 0, 0, length, false};
  q.facing = inner(q.normal, q.ray);
  const float side = q.facing > 0.0f ? 1.0f : -1.0f, far = vmax(side * q.facing, kMinFacing) * depth;
  q.free = far >= kMinDistance;
  q.distance = side * vmax(far, kMinDistance);
  q.m = {q.normal.x / q.distance, q.normal.y / q.distance, q.normal.z / q.distance};
  return q;
}

// Where the neighbour sees the plane's point of pixel (x, y), and how that moves with s = m . ray.
struct Warped {
  float x, y, dx, dy, weight;
  Triple<float> ray;
};

R2_HD Warped warped_at(const ViewPair& v, const Tangent& q, float x, float y) {
  const Triple<float> ray = ray_of(x, y, v.fx, v.fy, v.cx, v.cy), turned = to_camera(v.R, ray);
  const float s = inner(q.m, ray);
  const Triple<float> at = {fma(v.t[0], s, turned.x), fma(v.t[1], s, turned.y), fma(v.t[2], s, turned.z)};
  const Triple<float> before = {at.x, at.y, vmax(at.z, kMinWeight)};
  const Seen seen = seen_at(before, {v.t[0], v.t[1], v.t[2]}, v.other_fx, v.other_fy, v.other_cx, v.other_cy);
  return {seen.x, seen.y, seen.dx, seen.dy, at.z, ray};
}

R2_HD bool seen_whole(const Warped& w, int64_t height, int64_t width) {
  return w.x >= 0.5f && w.x <= static_cast<float>(width) - 0.5f && w.y >= 0.5f && w.y <= static_cast<float>(height) - 0.5f &&
         w.weight > kMinWeight;
}

// Gradients by depth and by the rendered normal, from that by m.
struct TangentGradient {
  float depth;
  Triple<float> normal;
};

R2_HD TangentGradient tangent_gradient(const ViewPair& v, const Tangent& q, float depth, const Triple<float>& by_m) {
  const float by_distance = q.free ? -inner(by_m, q.m) / q.distance : 0.0f;
  const float c = by_distance * depth;
  const Triple<float> n = {fma(c, q.ray.x, by_m.x / q.distance), fma(c, q.ray.y, by_m.y / q.distance),
                           fma(c, q.ray.z, by_m.z / q.distance)};
  const float along = inner(n, q.normal), inverse = 1.0f / q.length;
  const Triple<float> turned = {fma(-along, q.normal.x, n.x) * inverse, fma(-along, q.normal.y, n.y) * inverse,
                                fma(-along, q.normal.z, n.z) * inverse};
  return {by_distance * q.facing, to_world(v.reference, turned)};
}

}  // namespace R2_ISA
