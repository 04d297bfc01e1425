// The losses of depth and normal priors over the rows of a strip (losses/depth_prior.py, losses/normal_prior.py). Most
// sweeps are plain loops that the compiler turns into vectors; what a row costs is added lane by lane, in one order.
#include "priors.h"

#include "lane_sum.h"
#include "simd.h"  // before depth_prior_maths.h, whose functions see what stands before them

#include "depth_prior_maths.h"
#include "normal_prior_maths.h"

namespace R2_ISA {
namespace {

template <class Job, class F>
void each_row(const Job& job, int64_t strip, const F& f) {
  const int64_t first = strip * job.strip_rows;
  for (int64_t row = first; row < job.height && row < first + job.strip_rows; ++row) f(row);
}

// Zeros in the rows of the rendering from compared row `row` up to the next one, `floats` a pixel.
void clear_rows(const room2dgs::Rendered& rendered, int64_t row, int64_t floats, float* gradient) {
  const int64_t first = row * rendered.step;
  const int64_t last = first + rendered.step < rendered.height ? first + rendered.step : rendered.height;
  std::memset(gradient + first * rendered.width * floats, 0, sizeof(float) * (last - first) * rendered.width * floats);
}

double sum_of(const float* x, int64_t count) {
  LaneSum sum;
  int64_t i = 0;
  for (; i + kLanes <= count; i += kLanes) sum.add(load(x + i));
  double total = sum.total();
  for (; i < count; ++i) total += x[i];
  return total;
}

// share * trust * sign of the difference from `a` to `b`, and what the pair costs.
struct Push {
  float push, cost;
};
R2_INLINE Push push_of(float r_a, float r_b, float w_a, float w_b, float share) {
  const float least = w_a < w_b ? w_a : w_b, trust = least > 0.0f ? least * share : 0.0f, d = r_b - r_a;
  const float up = d > kDepthRounding ? trust : 0.0f, down = d < -kDepthRounding ? trust : 0.0f;
  return {up - down, d * (up - down)};
}

// Pairs along a row, `stride` apart: cost to the first, pushes to both.
R2_INLINE void pairs_along(const float* r, const float* w, int64_t width, int64_t stride, float share, float* g,
                           float* cost, float* pushes) {
  const int64_t count = (width - 1) / stride;  // pairs
  for (int64_t k = 0; k < count; ++k) {
    const int64_t a = k * stride, b = a + stride;
    const Push p = push_of(r[a], r[b], w[a], w[b], share);
    pushes[k] = p.push, cost[a] += p.cost;
  }
  for (int64_t k = 0; k < count; ++k) g[k * stride] -= pushes[k];
  for (int64_t k = 0; k < count; ++k) g[(k + 1) * stride] += pushes[k];
}

// Pairs from a row to the one `below`, which gets its push when it is its turn.
R2_INLINE void pairs_below(const float* r, const float* w, const float* r_below, const float* w_below, int64_t width,
                           int64_t stride, float share, float* g, float* cost) {
  for (int64_t i = 0; i < width; i += stride) {
    const Push p = push_of(r[i], r_below[i], w[i], w_below[i], share);
    g[i] -= p.push, cost[i] += p.cost;
  }
}
R2_INLINE void pairs_above(const float* r_above, const float* w_above, const float* r, const float* w, int64_t width,
                           int64_t stride, float share, float* g) {
  for (int64_t i = 0; i < width; i += stride) g[i] += push_of(r_above[i], r[i], w_above[i], w[i], share).push;
}

// Eight normals by axis, which become their gradients; a share below 0: not compared. Gives what they cost.
R2_INLINE f8 normal_losses(float* const* n, const float* const* p, f8 share, int64_t i, float l1, float cosine) {
  const NormalLoss<f8> loss = normal_loss<f8>({load(n[0] + i), load(n[1] + i), load(n[2] + i)},
                                              {load(p[0] + i), load(p[1] + i), load(p[2] + i)}, share, l1, cosine);
  store(n[0] + i, loss.gradient.x), store(n[1] + i, loss.gradient.y), store(n[2] + i, loss.gradient.z);
  return loss.value;
}

}  // namespace

void depth_prior_moments(const room2dgs::DepthPriorJob& job, int64_t strip) {
  each_row(job, strip, [&](int64_t row) {
    const int64_t width = job.width, at = row * width, step = job.rendered.step;
    const float *depth = job.depth + job.rendered.at(row), *alpha = job.alpha + job.rendered.at(row);
    const float* prior = job.prior + at;
    const uint8_t* valid = job.valid + at;
    float *weight = job.weight + at, *x = job.residual + at;
    for (int64_t i = 0; i < width; ++i) weight[i] = job.confidence ? job.confidence[at + i] : 1.0f;
    for (int64_t i = 0; i < width; ++i) {
      x[i] = depth[i * step];
      const bool good = (prior[i] > 0.0f) & (prior[i] <= __FLT_MAX__) & (x[i] > 0.0f);
      weight[i] = (valid[i] != 0) & (alpha[i * step] >= kDepthMinAlpha) & good ? weight[i] : -1.0f;
    }
    if (job.disparity)
      for (int64_t i = 0; i < width; ++i) x[i] = 1.0f / x[i];
    double* sums = job.row_moments + room2dgs::kPriorMoments * row;
    for (int k = 0; k < room2dgs::kPriorMoments; ++k) sums[k] = 0;
    int32_t count = 0;
    for (int64_t i = 0; i < width; ++i) count += weight[i] >= 0.0f;
    sums[0] = count;
    for (int64_t i = 0; i < width; ++i) {
      if (!(weight[i] > 0.0f)) continue;
      const double w = weight[i], p = prior[i];
      sums[1] += w, sums[2] += w * p;
      if (!job.align) continue;
      const double wx = w * x[i];
      sums[3] += wx, sums[4] += w * p * p, sums[5] += wx * p, sums[6] += wx * x[i];
    }
  });
}

void depth_prior_residuals(const room2dgs::DepthPriorJob& job, int64_t strip) {
  each_row(job, strip, [&](int64_t row) {
    const int64_t width = job.width, at = row * width;
    const float *w = job.weight + at, *prior = job.prior + at;
    float* residual = job.residual + at;
    const float scale = job.scale, shift = job.shift, inverse_unit = job.inverse_unit;
    for (int64_t i = 0; i < width; ++i) {
      const float r = (residual[i] - fma(scale, prior[i], shift)) * inverse_unit;
      residual[i] = w[i] >= 0.0f ? r : 0.0f;
    }
    int64_t* pairs = job.row_pairs + room2dgs::kPriorPairs * row;
    for (int k = 0; k < room2dgs::kPriorPairs; ++k) pairs[k] = 0;
    for (int level = 0; level < job.levels; ++level) {
      const int64_t stride = int64_t(1) << level;
      if (row % stride) break;
      int32_t along = 0, down = 0;
      for (int64_t i = 0; i + stride < width; i += stride) along += w[i] >= 0.0f && w[i + stride] >= 0.0f;
      if (row + stride < job.height) {
        const float* below = w + stride * width;
        for (int64_t i = 0; i < width; i += stride) down += w[i] >= 0.0f && below[i] >= 0.0f;
      }
      pairs[2 * level] = along, pairs[2 * level + 1] = down;
    }
  });
}

void depth_prior_gradient(const room2dgs::DepthPriorJob& job, int64_t strip, int worker) {
  const int64_t width = job.width;
  float* cost = job.scratch + worker * room2dgs::depth_prior_scratch(width);
  float *pushes = cost + width, *g = pushes + width;
  const bool disparity = job.disparity;
  const float mean = job.mean, inverse_unit = job.inverse_unit;  // a store to a map could change those of the job
  each_row(job, strip, [&](int64_t row) {
    const int64_t at = row * width;
    const float *r = job.residual + at, *w = job.weight + at;
    for (int64_t i = 0; i < width; ++i) {
      const float weighted = (w[i] > 0.0f ? w[i] : 0.0f) * mean * r[i];
      g[i] = 2.0f * weighted, cost[i] = weighted * r[i];
    }
    for (int level = 0; level < job.levels; ++level) {
      const int64_t stride = int64_t(1) << level, step = stride * width;
      if (row % stride) break;
      const float along = job.shares[level][0], down = job.shares[level][1];
      // the strides that every row and column has are worth a loop of their own
      if (stride == 1) {
        pairs_along(r, w, width, 1, along, g, cost, pushes);
        if (row + 1 < job.height) pairs_below(r, w, r + width, w + width, width, 1, down, g, cost);
        if (row >= 1) pairs_above(r - width, w - width, r, w, width, 1, down, g);
        continue;
      }
      pairs_along(r, w, width, stride, along, g, cost, pushes);
      if (row + stride < job.height) pairs_below(r, w, r + step, w + step, width, stride, down, g, cost);
      if (row >= stride) pairs_above(r - step, w - step, r, w, width, stride, down, g);
    }
    clear_rows(job.rendered, row, 1, job.gradient);
    const float* depth = job.depth + job.rendered.at(row);
    float* to = job.gradient + job.rendered.at(row);
    const int64_t apart = job.rendered.step;
    for (int64_t i = 0; i < width; ++i) {
      const float d = depth[i * apart], by = g[i] * inverse_unit * (disparity ? -1.0f / (d * d) : 1.0f);
      to[i * apart] = w[i] >= 0.0f ? by : 0.0f;
    }
    job.row_values[row] = sum_of(cost, width);
  });
}

void normal_prior_count(const room2dgs::NormalPriorJob& job, int64_t strip) {
  each_row(job, strip, [&](int64_t row) {
    const float* alpha = job.alpha + job.rendered.at(row);
    const uint8_t* valid = job.valid + row * job.width;
    int32_t count = 0;
    for (int64_t i = 0; i < job.width; ++i)
      count += (valid[i] != 0) & (alpha[i * job.rendered.step] >= kNormalMinAlpha);
    job.row_counts[row] = count;
  });
}

void normal_prior_gradient(const room2dgs::NormalPriorJob& job, int64_t strip, int worker) {
  const int64_t width = job.width, stride = room2dgs::whole_lanes(width);
  float* share = job.scratch + worker * room2dgs::normal_prior_scratch(width);
  float *n[3], *p[3];
  for (int k = 0; k < 3; ++k) n[k] = share + (1 + k) * stride, p[k] = share + (4 + k) * stride;
  std::memset(share, 0, sizeof(float) * room2dgs::normal_prior_scratch(width));  // what lies beyond the row costs nothing
  const float l1 = job.l1, cosine = job.cosine;  // a store to a map could change those of the job
  each_row(job, strip, [&](int64_t row) {
    const int64_t at = row * width, first = job.rendered.at(row), apart = job.rendered.step;
    const float *from = job.normal + 3 * first, *to = job.prior + 3 * at, *alpha = job.alpha + first;
    const uint8_t* valid = job.valid + at;
    for (int64_t i = 0; i < width; ++i) share[i] = job.confidence ? job.confidence[at + i] : 1.0f;
    for (int64_t i = 0; i < width; ++i) share[i] = (valid[i] != 0) & (alpha[i * apart] >= kNormalMinAlpha) ? share[i] : -1.0f;
    for (int k = 0; k < 3; ++k)
      for (int64_t i = 0; i < width; ++i) {
        const float a = from[3 * i * apart + k], b = to[3 * i + k];
        n[k][i] = share[i] >= 0.0f ? a : 0.0f, p[k][i] = share[i] >= 0.0f ? b : 0.0f;  // else they may be no numbers
      }
    LaneSum sum;
    for (int64_t i = 0; i < width; i += kLanes) sum.add(normal_losses(n, p, load(share + i), i, l1, cosine));
    clear_rows(job.rendered, row, 3, job.gradient);
    float* g = job.gradient + 3 * first;
    for (int64_t i = 0; i < width; ++i, g += 3 * apart) g[0] = n[0][i], g[1] = n[1][i], g[2] = n[2][i];
    job.row_values[row] = sum.total();
  });
}

}  // namespace R2_ISA
