// What one photo says of points of a surface, and the colour that the best photos give.
#include "coloring.h"

namespace R2_ISA {

using room2dgs::BlendJob;
using room2dgs::kBest;
using room2dgs::kPointChunk;
using room2dgs::LookJob;

namespace {

constexpr float kNear = 0.05f;       // metres, as Camera's
constexpr float kMinCosine = 0.1f;
constexpr int kReach = 1;            // pixels of the depth map: silhouettes of mesh and photo differ by so much
constexpr float kToleranceM = 0.015f, kToleranceShare = 0.008f;  // behind what is drawn, a point is hidden
constexpr float kRim = 0.04f;        // of the photo's width: what is nearer to its rim counts for less
constexpr float kBehind = 0.04f;     // of the depth: a point before something so far behind is at a silhouette
constexpr float kSilhouette = 0.3f;  // what that counts
constexpr float kBurnt = 250.0f, kBurntWeight = 0.3f;  // a level from which a channel may be cut off

inline float least(float a, float b) { return a < b ? a : b; }
inline float most(float a, float b) { return a > b ? a : b; }

// Between the four pixels around (x, y), whose middles are at + 0.5.
inline void between(const uint8_t* image, int64_t height, int64_t width, float x, float y, float* color) {
  x = least(most(x - 0.5f, 0.0f), static_cast<float>(width - 1));
  y = least(most(y - 0.5f, 0.0f), static_cast<float>(height - 1));
  const int64_t left = static_cast<int64_t>(x), top = static_cast<int64_t>(y);
  const int64_t right = left + 1 < width ? left + 1 : left, bottom = top + 1 < height ? top + 1 : top;
  const float u = x - left, v = y - top;
  for (int c = 0; c < 3; ++c) {
    const float above = image[3 * (top * width + left) + c] * (1 - u) + image[3 * (top * width + right) + c] * u;
    const float below = image[3 * (bottom * width + left) + c] * (1 - u) + image[3 * (bottom * width + right) + c] * u;
    color[c] = above * (1 - v) + below * v;
  }
}

// 0 where something is before the point, else 1, or less beside a silhouette.
inline float unhidden(const LookJob& job, float x, float y, float z, float slope) {
  const int64_t column = static_cast<int64_t>(x * job.columns / job.width);
  const int64_t row = static_cast<int64_t>(y * job.rows / job.height);
  const float tolerance = kToleranceM + kToleranceShare * z;
  float weight = 1.0f;
  for (int64_t j = row - kReach; j <= row + kReach; ++j)
    for (int64_t i = column - kReach; i <= column + kReach; ++i) {
      if (i < 0 || j < 0 || i >= job.columns || j >= job.rows) continue;
      const float drawn = job.depth[j * job.columns + i];
      if (drawn > 0 && drawn < z - tolerance - slope) return 0.0f;
      if (drawn > z * (1 + kBehind) + slope) weight = kSilhouette;
    }
  return weight;
}

// What the view is worth for a point, 0 where it does not see it; x and y are the place in the photo.
inline float quality_of(const LookJob& job, int64_t point, float& x, float& y, float& z) {
  const float *p = job.points + 3 * point, *n = job.normals + 3 * point;
  float in_cam[3], normal[3];
  for (int k = 0; k < 3; ++k) {
    const double* m = job.cam_from_world + 4 * k;
    in_cam[k] = static_cast<float>(m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3]);
    normal[k] = static_cast<float>(m[0] * n[0] + m[1] * n[1] + m[2] * n[2]);
  }
  z = in_cam[2];
  if (!(z > kNear)) return 0.0f;
  const float fx = static_cast<float>(job.fx), fy = static_cast<float>(job.fy);
  const float u = in_cam[0] / z, v = in_cam[1] / z;
  x = u * fx + static_cast<float>(job.cx), y = v * fy + static_cast<float>(job.cy);
  if (!(x >= 0 && y >= 0 && x < job.width && y < job.height)) return 0.0f;
  const float along = -(normal[0] * u + normal[1] * v + normal[2]);  // over a ray of depth 1
  const float cosine = along / __builtin_sqrtf(u * u + v * v + 1);
  if (!(cosine > kMinCosine)) return 0.0f;
  if (job.usable && !job.usable[static_cast<int64_t>(y) * job.width + static_cast<int64_t>(x)]) return 0.0f;
  // how much the depth of the point's own plane changes within the pixels that are asked
  const float pixel_x = static_cast<float>(job.width) / job.columns / fx, pixel_y = static_cast<float>(job.height) / job.rows / fy;
  const float tilt = __builtin_fabsf(normal[0]) * pixel_x + __builtin_fabsf(normal[1]) * pixel_y;
  const float seen = unhidden(job, x, y, z, z * (kReach + 1) * tilt / along);
  if (seen == 0.0f) return 0.0f;
  const float rim = least(least(x, job.width - x), least(y, job.height - y)) / (kRim * job.width);
  return cosine * fx / z * seen * least(rim, 1.0f) * job.sharpness;
}

inline uint8_t level(float value) { return static_cast<uint8_t>(least(most(value, 0.0f), 255.0f) + 0.5f); }

}  // namespace

void look_up(const LookJob& job, int64_t chunk) {
  const int64_t first = chunk * kPointChunk, end = first + kPointChunk < job.count ? first + kPointChunk : job.count;
  const float to_soft_x = static_cast<float>(job.soft_width) / job.width, to_soft_y = static_cast<float>(job.soft_height) / job.height;
  for (int64_t point = first; point < end; ++point) {
    float x, y, z;
    float quality = quality_of(job, point, x, y, z);
    float* best = job.quality + kBest * point;
    if (!(quality > best[kBest - 1])) continue;
    float sharp[3], low[3];
    between(job.photo, job.height, job.width, x, y, sharp);
    between(job.soft, job.soft_height, job.soft_width, x * to_soft_x, y * to_soft_y, low);
    for (int c = 0; c < 3; ++c)
      if (job.gain[c] > 1.02f && low[c] > kBurnt) quality *= kBurntWeight;
    if (!(quality > best[kBest - 1])) continue;
    // points so far apart that detail falls between them take the mean of their surroundings
    const float apart = job.spacing[point] * static_cast<float>(job.fx) / z / job.softness_px;
    const float detail = least(most(1.5f - apart, 0.0f), 1.0f);
    int slot = kBest - 1;
    uint8_t *sharps = job.sharp + 3 * kBest * point, *lows = job.low + 3 * kBest * point;
    for (; slot > 0 && best[slot - 1] < quality; --slot) {
      best[slot] = best[slot - 1];
      for (int c = 0; c < 3; ++c) sharps[3 * slot + c] = sharps[3 * slot - 3 + c], lows[3 * slot + c] = lows[3 * slot - 3 + c];
    }
    best[slot] = quality;
    for (int c = 0; c < 3; ++c) {
      sharps[3 * slot + c] = level((low[c] + detail * (sharp[c] - low[c])) / job.gain[c]);
      lows[3 * slot + c] = level(low[c] / job.gain[c]);
    }
  }
}

namespace {

constexpr float kDoubt = 12.0f;  // levels off the views' median at which a view counts half

inline float power4(float x) { return (x * x) * (x * x); }

// The middle one by weight; values of at most kBest - 1 views.
inline float weighted_median(const float* values, const float* weights, int count) {
  float total = 0.0f;
  for (int k = 0; k < count; ++k) total += weights[k];
  for (int k = 0; k < count; ++k) {
    float below = 0.0f, up_to = 0.0f;
    for (int j = 0; j < count; ++j) {
      if (values[j] < values[k]) below += weights[j];
      if (values[j] <= values[k]) up_to += weights[j];
    }
    if (2 * below <= total && 2 * up_to >= total) return values[k];
  }
  return values[0];
}

}  // namespace

void blend(const BlendJob& job, int64_t chunk) {
  const int64_t first = chunk * kPointChunk, end = first + kPointChunk < job.count ? first + kPointChunk : job.count;
  for (int64_t point = first; point < end; ++point) {
    const float* quality = job.quality + kBest * point;
    const uint8_t *sharp = job.sharp + 3 * kBest * point, *low = job.low + 3 * kBest * point;
    float* color = job.color + 3 * point;
    job.share[point] = quality[0];
    color[0] = color[1] = color[2] = 0.0f;
    if (!(quality[0] > 0)) continue;
    float weight[kBest - 1], light[kBest - 1];
    int count = 0;
    // weights count from the first view that is left out, so that none comes or goes with a step
    const float floor = power4(quality[kBest - 1] / quality[0]);
    for (; count < kBest - 1 && quality[count] > 0; ++count) {
      weight[count] = power4(quality[count] / quality[0]) - floor + 1e-6f;
      light[count] = low[3 * count] + low[3 * count + 1] + low[3 * count + 2];
    }
    const float middle = weighted_median(light, weight, count);
    float total = 0.0f, details = 0.0f, detail[3] = {0, 0, 0};
    for (int k = 0; k < count; ++k) {
      const float off = (light[k] - middle) / (3 * kDoubt), trusted = weight[k] / (1 + off * off);
      const float lead = power4(trusted);  // the best view's detail nearly alone: a mean of several is blurred
      total += trusted, details += lead;
      for (int c = 0; c < 3; ++c) {
        color[c] += trusted * low[3 * k + c];
        detail[c] += lead * (static_cast<float>(sharp[3 * k + c]) - static_cast<float>(low[3 * k + c]));
      }
    }
    for (int c = 0; c < 3; ++c) color[c] = least(most(color[c] / total + detail[c] / details, 0.0f), 255.0f);
  }
}

}  // namespace R2_ISA
