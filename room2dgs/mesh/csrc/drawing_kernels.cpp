// A depth map of faces, by rays: a pixel's ray d meets the triangle (a, b, c) where d.(a x b), d.(b x c) and d.(c x a)
// have one sign, at the depth a.(b x c) / their sum. So faces that reach behind the camera need no clipping.
#include "coloring.h"

namespace R2_ISA {

using room2dgs::DrawJob;
using room2dgs::kBandRows;
using room2dgs::kPointChunk;

namespace {

struct Vector {
  double x, y, z;
};

inline Vector cross(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

inline double dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

inline Vector vertex(const DrawJob& job, int64_t face, int corner) {
  const float* v = job.vertices + 3 * static_cast<int64_t>(job.faces[3 * face + corner]);
  return {v[0], v[1], v[2]};
}

struct Box {
  double left = 1e30, right = -1e30, top = 1e30, bottom = -1e30;

  void add(const DrawJob& job, const Vector& v) {
    const double x = v.x / v.z * job.fx + job.cx, y = v.y / v.z * job.fy + job.cy;
    left = x < left ? x : left, right = x > right ? x : right;
    top = y < top ? y : top, bottom = y > bottom ? y : bottom;
  }
};

// The first pixel whose middle is not left of `place`, within 0..count.
inline int32_t first_from(double place, int64_t count) {
  const double at = __builtin_ceil(place - 0.5);
  return static_cast<int32_t>(at < 0 ? 0 : at > count ? count : at);
}

}  // namespace

void bound_faces(const DrawJob& job, int64_t chunk) {
  const int64_t first = chunk * kPointChunk, end = first + kPointChunk < job.count ? first + kPointChunk : job.count;
  for (int64_t face = first; face < end; ++face) {
    Box box;
    for (int k = 0; k < 3; ++k) {
      const Vector a = vertex(job, face, k), b = vertex(job, face, (k + 1) % 3);
      if (a.z >= job.near) box.add(job, a);
      if ((a.z >= job.near) == (b.z >= job.near)) continue;
      const double t = (job.near - a.z) / (b.z - a.z);  // where the edge crosses the near plane
      box.add(job, {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), job.near});
    }
    // a hair wider: the ray decides
    int32_t* to = job.box + 4 * face;
    to[0] = first_from(box.left - 1e-3, job.width), to[1] = first_from(box.right + 1e-3, job.width);
    to[2] = first_from(box.top - 1e-3, job.height), to[3] = first_from(box.bottom + 1e-3, job.height);
  }
}

void draw_band(const DrawJob& job, int64_t band) {
  const int64_t top = band * kBandRows, bottom = top + kBandRows < job.height ? top + kBandRows : job.height;
  for (int64_t i = top * job.width; i < bottom * job.width; ++i) job.depth[i] = 0.0f, job.face[i] = -1;
  for (int64_t face = 0; face < job.count; ++face) {
    const int32_t* box = job.box + 4 * face;
    const int64_t from = box[2] > top ? box[2] : top, to = box[3] < bottom ? box[3] : bottom;
    if (from >= to || box[0] >= box[1]) continue;
    const Vector a = vertex(job, face, 0), b = vertex(job, face, 1), c = vertex(job, face, 2);
    const Vector ab = cross(a, b), bc = cross(b, c), ca = cross(c, a);
    const double volume = dot(a, bc);
    for (int64_t row = from; row < to; ++row) {
      const double y = (row + 0.5 - job.cy) / job.fy;
      for (int64_t column = box[0]; column < box[1]; ++column) {
        const double x = (column + 0.5 - job.cx) / job.fx;
        const Vector ray = {x, y, 1.0};
        const double u = dot(ray, ab), v = dot(ray, bc), w = dot(ray, ca);
        const bool inside = (u >= 0) & (v >= 0) & (w >= 0), outside = (u <= 0) & (v <= 0) & (w <= 0);
        if (inside == outside) continue;  // neither, or a face seen along its plane
        const float z = static_cast<float>(volume / (u + v + w));
        const int64_t pixel = row * job.width + column;
        // of faces at one depth the first stays, so that the order of threads does not matter
        if (z >= job.near && (job.face[pixel] < 0 || z < job.depth[pixel])) job.depth[pixel] = z, job.face[pixel] = static_cast<int32_t>(face);
      }
    }
  }
}

}  // namespace R2_ISA
