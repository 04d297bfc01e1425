// See other_views.h.
#include "other_views.h"

#include <algorithm>
#include <cmath>

#include "simd.h"

namespace R2_ISA {

using room2dgs::OtherViewsJob;
using room2dgs::OtherViewsScratch;
using room2dgs::Vote;

namespace {

// Adds up what one neighbour has in each pixel. Comparisons are written so that NaN fails them.
void project(const OtherViewsJob& job, int64_t view, int64_t slot, const OtherViewsScratch& scratch) {
  const int64_t other = job.near[view * job.neighbours + slot];
  const double* m = job.warp + (view * job.neighbours + slot) * 12;
  const int64_t height = job.size[2 * view], width = job.size[2 * view + 1];
  const int64_t rows = job.size[2 * other], columns = job.size[2 * other + 1];
  const float *depth = job.depth + job.first[other], *sure = job.sure + job.first[other];
  for (int64_t y = 0; y < rows; ++y) {
    for (int64_t x = 0; x < columns; ++x) {
      const double d = depth[y * columns + x], weight = sure[y * columns + x];
      if (!(d > 0 && weight > job.least)) continue;
      const double column = double(x), row = double(y);
      const double z = d * (m[8] * column + m[9] * row + m[10]) + m[11];
      if (!(z > 1e-6)) continue;
      const double u = (d * (m[0] * column + m[1] * row + m[2]) + m[3]) / z;
      const double v = (d * (m[4] * column + m[5] * row + m[6]) + m[7]) / z;
      if (!(u > -0.5 && u < double(width) - 0.5 && v > -0.5 && v < double(height) - 0.5)) continue;
      const int64_t pixel = int64_t(std::rint(v)) * width + int64_t(std::rint(u));
      scratch.sum[pixel] += weight;
      scratch.sums[pixel] += weight * z;
      ++scratch.met[pixel];
    }
  }
}

// Of one pixel's votes: their weighted median, then the mean of those near it and the trust in that.
void decide(Vote* votes, int64_t count, double same, float* depth, float* trust) {
  double total = 0;
  for (int64_t k = 0; k < count; ++k) {  // sorted by insertion: few, and equal ones keep their order
    const Vote vote = votes[k];
    total += vote.weight;
    int64_t place = k;
    for (; place > 0 && votes[place - 1].depth > vote.depth; --place) votes[place] = votes[place - 1];
    votes[place] = vote;
  }
  int64_t middle = 0;
  for (double so_far = votes[0].weight; so_far < total / 2 && middle + 1 < count;) so_far += votes[++middle].weight;
  const double median = votes[middle].depth;
  double weights = 0, squares = 0, depths = 0;
  for (int64_t k = 0; k < count; ++k) {
    if (!(std::abs(votes[k].depth - median) < same * median)) continue;
    weights += votes[k].weight;
    squares += votes[k].weight * votes[k].weight;
    depths += votes[k].weight * votes[k].depth;
  }
  *depth = float(depths / weights);
  *trust = float(squares / weights * (weights / total) * (weights / (weights + 1)));
}

}  // namespace

void depth_of_other_views(const OtherViewsJob& job, int64_t view, const OtherViewsScratch& scratch) {
  const int64_t pixels = job.size[2 * view] * job.size[2 * view + 1], first = job.first[view];
  std::fill_n(scratch.count, pixels, 0);
  for (int64_t slot = 0; slot < job.neighbours; ++slot) {
    if (job.near[view * job.neighbours + slot] < 0) continue;
    std::fill_n(scratch.sum, pixels, 0.0);
    std::fill_n(scratch.sums, pixels, 0.0);
    std::fill_n(scratch.met, pixels, 0);
    project(job, view, slot, scratch);
    for (int64_t p = 0; p < pixels; ++p)
      if (scratch.met[p])
        scratch.votes[p * job.neighbours + scratch.count[p]++] = {scratch.sums[p] / scratch.sum[p],
                                                                  scratch.sum[p] / scratch.met[p]};
  }
  for (int64_t p = 0; p < pixels; ++p) {
    float &depth = job.result[first + p], &trust = job.trust[first + p];
    depth = trust = 0;
    if (scratch.count[p]) decide(scratch.votes + p * job.neighbours, scratch.count[p], job.same, &depth, &trust);
  }
}

}  // namespace R2_ISA
