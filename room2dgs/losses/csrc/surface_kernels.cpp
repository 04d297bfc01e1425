// Normals from depth and the normal-consistency loss with its gradients (surface_maths.h), over rows of a strip.
#include "lane_sum.h"
#include "simd.h"  // before surface_maths.h, whose templates see what stands before them

#include "surface_maths.h"

namespace R2_ISA {
namespace {

constexpr int kMargin = 8;

using Vector = Triple<f8>;

#if defined(__clang__)
#define R2_PERMUTE(v, ...) __builtin_shufflevector(v, v, __VA_ARGS__)
#else
#define R2_PERMUTE(v, ...) __builtin_shuffle(v, i8{__VA_ARGS__})
#endif
#define R2_MASK(a, b, c, d, e, f, g, h) i8{-(a), -(b), -(c), -(d), -(e), -(f), -(g), -(h)}

// Eight interleaved triples. Lane l of the three loads holds component (8 load + l) mod 3, so for each component the
// three loads use different lanes: two blends and one permutation.
R2_INLINE Vector load_triples(const float* p) {
  const f8 a = load(p), b = load(p + 8), c = load(p + 16);
  const i8 m036 = R2_MASK(1, 0, 0, 1, 0, 0, 1, 0), m147 = R2_MASK(0, 1, 0, 0, 1, 0, 0, 1);
  const f8 x = select(m036, a, select(m147, b, c));
  const f8 z = select(m036, b, select(m147, c, a));
  const f8 y = select(m036, c, select(m147, a, b));
  return {R2_PERMUTE(x, 0, 3, 6, 1, 4, 7, 2, 5), R2_PERMUTE(y, 1, 4, 7, 2, 5, 0, 3, 6),
          R2_PERMUTE(z, 2, 5, 0, 3, 6, 1, 4, 7)};
}
R2_INLINE void store_triples(float* p, Vector v) {
  const i8 m036 = R2_MASK(1, 0, 0, 1, 0, 0, 1, 0), m147 = R2_MASK(0, 1, 0, 0, 1, 0, 0, 1);
  const f8 x = R2_PERMUTE(v.x, 0, 3, 6, 1, 4, 7, 2, 5), y = R2_PERMUTE(v.y, 5, 0, 3, 6, 1, 4, 7, 2),
           z = R2_PERMUTE(v.z, 2, 5, 0, 3, 6, 1, 4, 7);
  store(p, select(m036, x, select(m147, y, z)));
  store(p + 8, select(m036, z, select(m147, x, y)));
  store(p + 16, select(m036, y, select(m147, z, x)));
}

R2_INLINE void copy_floats(float* to, const float* from, int64_t count) {
  for (int64_t k = 0; k < count; ++k) to[k] = from[k];
}

// Rows [from, to) of the depth between margins of zeros; what is not a positive finite number becomes 0 = invalid.
void copy_depth(const float* depth, int64_t height, int64_t width, int64_t from, int64_t to, float* out) {
  const int64_t stride = room2dgs::surface_stride(width);
  for (int64_t row = from; row < to; ++row, out += stride) {
    std::memset(out, 0, sizeof(float) * stride);
    if (row < 0 || row >= height) continue;
    const float* in = depth + row * width;
    int64_t x = 0;
    for (; x + kLanes <= width; x += kLanes) {
      const f8 d = load(in + x);
      store(out + kMargin + x, masked((d > 0.0f) & (d <= __FLT_MAX__), d));
    }
    for (; x < width; ++x) out[kMargin + x] = in[x] > 0.0f && in[x] <= __FLT_MAX__ ? in[x] : 0.0f;
  }
}

// The surface normal in the camera frame at eight pixels; d points at the pixel's depth in rows of the given stride.
R2_INLINE SurfaceNormal<f8> surface_normal(const float* d, int64_t stride, const room2dgs::Pinhole& camera, int64_t x,
                                           int64_t y) {
  return surface_normal_of(load(d), load(d + 1), load(d - 1), load(d + stride), load(d - stride),
                           iota() + (static_cast<float>(x) + 0.5f - camera.cx),
                           splat(static_cast<float>(y) + 0.5f - camera.cy), camera);
}

}  // namespace

void depth_normals_strip(const room2dgs::DepthNormalsJob& job, int64_t strip, int worker) {
  const int64_t width = job.width, stride = room2dgs::surface_stride(width);
  const int64_t first = strip * job.strip_rows;
  const int64_t last = first + job.strip_rows < job.height ? first + job.strip_rows : job.height;
  float* depth = job.scratch + worker * room2dgs::depth_normals_scratch(width, job.strip_rows);
  copy_depth(job.depth, job.height, width, first - 1, last + 1, depth);
  for (int64_t y = first; y < last; ++y) {
    const float* d = depth + (y - first + 1) * stride + kMargin;
    float* out = job.normal + y * width * 3;
    for (int64_t x = 0; x < width; x += kLanes) {
      const SurfaceNormal<f8> s = surface_normal(d + x, stride, job.camera, x, y);
      const Vector n = to_world(job.camera.cam_from_world, s.n);
      const Vector kept = {masked(s.valid, n.x), masked(s.valid, n.y), masked(s.valid, n.z)};
      if (x + kLanes <= width) {
        store_triples(out + 3 * x, kept);
      } else {
        float part[3 * kLanes];
        store_triples(part, kept);
        copy_floats(out + 3 * x, part, 3 * (width - x));
      }
    }
  }
}

void normal_consistency_strip(const room2dgs::NormalConsistencyJob& job, int64_t strip, int worker) {
  const int64_t width = job.width, height = job.height, stride = room2dgs::surface_stride(width);
  const int64_t first = strip * job.strip_rows;
  const int64_t last = first + job.strip_rows < height ? first + job.strip_rows : height;
  // Row r of the depth lies at r - (first - 2); row r of the slopes' gradients, divided by (D_r + D_l)^2 and
  // (D_d + D_u)^2, at r - (first - 1).
  float* depth = job.scratch + worker * room2dgs::normal_consistency_scratch(width, job.strip_rows);
  float* grad_p = depth + (job.strip_rows + 4) * stride;
  float* grad_q = grad_p + (job.strip_rows + 2) * stride;
  copy_depth(job.depth, height, width, first - 2, last + 2, depth);

  const room2dgs::Pinhole& camera = job.camera;
  for (int64_t y = first - 1; y < last + 1; ++y) {
    float* p_row = grad_p + (y - first + 1) * stride + kMargin;
    float* q_row = grad_q + (y - first + 1) * stride + kMargin;
    std::memset(p_row - kMargin, 0, sizeof(float) * stride);
    std::memset(q_row - kMargin, 0, sizeof(float) * stride);
    if (y < 0 || y >= height) continue;
    const float* d = depth + (y - first + 2) * stride + kMargin;
    const float* normals = job.normal + y * width * 3;
    const float* alphas = job.alpha + y * width;
    const bool counted = y >= first && y < last;
    LaneSum loss;
    f8 rotation[9];  // a row is short enough for float sums
    for (int k = 0; k < 9; ++k) rotation[k] = splat(0.0f);
    for (int64_t x = 0; x < width; x += kLanes) {
      const int64_t count = width - x < kLanes ? width - x : kLanes;
      float part_normal[3 * kLanes] = {}, part_alpha[kLanes] = {};
      if (count < kLanes) {
        copy_floats(part_normal, normals + 3 * x, 3 * count);
        copy_floats(part_alpha, alphas + x, count);
      }
      const Vector world = load_triples(count < kLanes ? part_normal : normals + 3 * x);
      const f8 alpha = load(count < kLanes ? part_alpha : alphas + x);

      const SurfaceNormal<f8> s = surface_normal(d + x, stride, camera, x, y);
      const Vector rendered = to_camera(camera.cam_from_world, world);
      const Consistency<f8> c = consistency_of(s, rendered, alpha, camera, job.scale);
      store(p_row + x, c.gp);
      store(q_row + x, c.gq);
      if (!counted) continue;

      const Vector grad = to_world(camera.cam_from_world, c.towards);
      float* out = job.grad_normal + (y * width + x) * 3;
      if (count == kLanes) {
        store_triples(out, grad);
      } else {
        store_triples(part_normal, grad);
        copy_floats(out, part_normal, 3 * count);
      }
      loss.add(c.loss);
      const f8 t[3] = {c.towards.x, c.towards.y, c.towards.z}, w[3] = {world.x, world.y, world.z};
      for (int k = 0; k < 9; ++k) rotation[k] = fma(t[k / 3], w[k % 3], rotation[k]);
    }
    if (!counted) continue;
    job.row_sums[10 * y] = loss.total();
    for (int k = 0; k < 9; ++k) job.row_sums[10 * y + 1 + k] = hsum(rotation[k]);
  }

  for (int64_t y = first; y < last; ++y) {
    const float* d = depth + (y - first + 2) * stride + kMargin;
    const float* p_row = grad_p + (y - first + 1) * stride + kMargin;
    const float* q_row = grad_q + (y - first + 1) * stride + kMargin;
    float* out = job.grad_depth + y * width;
    for (int64_t x = 0; x < width; x += kLanes) {
      const f8 grad = depth_gradient_of(load(d + x - 2), load(p_row + x - 1), load(d + x + 2), load(p_row + x + 1),
                                        load(d + x - 2 * stride), load(q_row + x - stride), load(d + x + 2 * stride),
                                        load(q_row + x + stride));
      if (x + kLanes <= width) {
        store(out + x, grad);
      } else {
        float part[kLanes];
        store(part, grad);
        copy_floats(out + x, part, width - x);
      }
    }
  }
}

}  // namespace R2_ISA
