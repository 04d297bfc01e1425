// See joint.h. A vector holds eight samples; lanes without a residual look at harmless places and pull nothing.
#include "joint.h"

#include "lane_sum.h"
#include "simd.h"

namespace R2_ISA {

using room2dgs::AdamStep;
using room2dgs::JointJob;
using room2dgs::JointSum;
using room2dgs::kAdamFirst;
using room2dgs::kAdamSecond;
using room2dgs::kJointSlopeStep;

namespace {

constexpr float kNearest = 0.05f;        // metres before a camera; nearer is not seen
constexpr float kOneSurface = 0.1f;      // four neighbouring depths that differ more, relatively, lie on two surfaces
constexpr float kSlopeJump = 0.15f;      // ends that differ more, relatively, lie on two surfaces
constexpr int kLeastStep = 4;            // samples between two points of a textureless region
constexpr float kPlaneCosine = 0.9f;     // between normals that may belong to one plane
constexpr float kAxisCosine = 0.97f;     // a surface that faces an axis so nearly is taken to face it
constexpr float kUprightSine = 0.25f;    // and one that leans less for a wall

R2_INLINE f8 number(i8 x) { return __builtin_convertvector(x, f8); }
R2_INLINE i8 truncated(f8 x) { return __builtin_convertvector(x, i8); }
R2_INLINE f8 absolute(f8 x) { return as_float(as_int(x) & splat_i(0x7fffffff)); }
R2_INLINE f8 between(f8 x, float low, float high) { return vmin(vmax(x, splat(low)), splat(high)); }  // NaN gives low
R2_INLINE i8 within(i8 x, int64_t count) { return (x >= 0) & (x < static_cast<int32_t>(count)); }

struct Three {
  f8 x, y, z;
};
R2_INLINE f8 dot(Three a, Three b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
R2_INLINE Three cross(Three a, Three b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
R2_INLINE Three operator-(Three a, Three b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
R2_INLINE Three operator*(Three a, f8 s) { return {a.x * s, a.y * s, a.z * s}; }
R2_INLINE Three three_at(const float* p, i8 index) {
  return {gather(p, index * 3), gather(p + 1, index * 3), gather(p + 2, index * 3)};
}

// Eight samples of a term: their draws, checked, and what is found out about them.
struct Samples {
  const JointJob& job;
  const int32_t* draws;  // of the term, at the first of these samples
  int64_t at;            // their number
  i8 there;              // lanes that hold a sample
  LaneSum& cost;
  JointSum& sum;

  R2_INLINE i8 draw(int row) const {
    const int32_t* p = draws + row * job.samples;
    i8 found = splat_i(0);
    std::memcpy(&found, p, at + kLanes <= job.samples ? sizeof found : 4 * (job.samples - at));
    return found;
  }
  // Draws that name what is not there are counted, and never read by.
  R2_INLINE void allow(i8 good) {
    const uint32_t strange = bits(there & ~good);
    if (strange) sum.strange += __builtin_popcount(strange);
    there &= good;
  }
  R2_INLINE i8 only(i8 x) const { return x & there; }
};

struct Camera {
  i8 view;
  f8 cx, cy, per_fx, per_fy, per_width, per_height;
};
R2_INLINE Camera camera_of(const JointJob& job, i8 view) {
  const auto row = [&](int field) { return gather(job.view_table + field * job.views, view); };
  return {view,
          row(room2dgs::kJointCentre), row(room2dgs::kJointCentre + 1),
          row(room2dgs::kJointPerFocal), row(room2dgs::kJointPerFocal + 1),
          row(room2dgs::kJointPerSize), row(room2dgs::kJointPerSize + 1)};
}
R2_INLINE i8 map_index(const JointJob& job, i8 view, i8 row, i8 column) {
  return (view * static_cast<int32_t>(job.height) + row) * static_cast<int32_t>(job.width) + column;
}

// The grid at a place given by shares of the image: bilinear, with the four knots that it lies between.
struct Place {
  i8 knot;
  f8 right, lower, value;
  f8 corner[4];
};
R2_INLINE Place place_at(const JointJob& job, i8 view, f8 x, f8 y) {
  const float last_column = static_cast<float>(job.columns - 1), last_row = static_cast<float>(job.rows - 1);
  x = between(x * last_column, 0.0f, last_column), y = between(y * last_row, 0.0f, last_row);
  const i8 left = truncated(vmin(x, splat(last_column - 1.0f))), top = truncated(vmin(y, splat(last_row - 1.0f)));
  Place p;
  p.right = x - number(left), p.lower = y - number(top);
  p.knot = (view * static_cast<int32_t>(job.rows) + top) * static_cast<int32_t>(job.columns) + left;
  const float* below = job.grid + job.columns;
  p.corner[0] = gather(job.grid, p.knot), p.corner[1] = gather(job.grid + 1, p.knot);
  p.corner[2] = gather(below, p.knot), p.corner[3] = gather(below + 1, p.knot);
  const f8 upper = fma(p.right, p.corner[1] - p.corner[0], p.corner[0]);
  const f8 under = fma(p.right, p.corner[3] - p.corner[2], p.corner[2]);
  p.value = fma(p.lower, under - upper, upper);
  return p;
}

// A sample of a depth map, unprojected by the optimised depth; its derivative by the log-scale is itself.
struct Surface {
  Three at;
  Place place;
};
R2_INLINE Surface surface_at(const JointJob& job, const Camera& camera, i8 row, i8 column, f8 depth) {
  const float step = static_cast<float>(job.step), first = static_cast<float>(job.step / 2) + 0.5f;
  const f8 u = number(column) * step + first, v = number(row) * step + first;
  Surface s;
  s.place = place_at(job, camera.view, u * camera.per_width, v * camera.per_height);
  s.at.z = depth * exp_of(s.place.value);
  s.at.x = (u - camera.cx) * camera.per_fx * s.at.z;
  s.at.y = (v - camera.cy) * camera.per_fy * s.at.z;
  return s;
}

// The robust cost of residuals where `good`, and its derivative.
R2_INLINE f8 pull_of(Samples& q, int term, i8 good, f8 residual, f8 weight) {
  const float narrow = 1.0f / (q.job.width_of[term] * q.job.width_of[term]);
  const f8 squared = residual * residual * narrow, share = 1.0f / (1.0f + squared);
  q.cost.add(masked(good, weight * squared * share));
  q.sum.count += __builtin_popcount(bits(good));
  return masked(good, weight * residual * (2.0f * narrow) * share * share);
}
R2_INLINE void keep(const Samples& q, int place, const Place& p, f8 pull) {
  const int64_t at = place * q.job.stride + q.at;
  const i8 knot = q.only(p.knot);
  std::memcpy(q.job.knot + at, &knot, sizeof knot);
  store(q.job.right + at, p.right), store(q.job.lower + at, p.lower), store(q.job.pull + at, pull);
}

R2_INLINE void points(Samples& q, int term, int to) {
  i8 view = q.draw(0), point = q.draw(1);
  q.allow(within(view, q.job.views) & within(point, q.job.point_count));
  view = q.only(view), point = q.only(point);
  const float* places = q.job.point_place;
  const Place place = place_at(q.job, view, gather(places, point * 2), gather(places + 1, point * 2));
  keep(q, to, place, pull_of(q, term, q.there, gather(q.job.point_off, point) + place.value, splat(1.0f)));
}

// Log of one view's depth, warped into another view, over that view's own.
R2_INLINE void views(Samples& q, int term, int to) {
  const JointJob& job = q.job;
  i8 pair = q.draw(0), row = q.draw(1), column = q.draw(2);
  q.allow(within(pair, job.pairs) & within(row, job.height) & within(column, job.width));
  pair = q.only(pair), row = q.only(row), column = q.only(column);
  i8 view = gather(job.pair_views, pair), other = gather(job.pair_views + job.pairs, pair);
  q.allow(within(view, job.views) & within(other, job.views));
  view = q.only(view), other = q.only(other);
  const i8 index = map_index(job, view, row, column);
  const f8 depth = gather(job.depth, index);
  const Surface own = surface_at(job, camera_of(job, view), row, column, depth);
  const auto of_pair = [&](int field) { return gather(job.pair_table + field * job.pairs, pair); };
  const auto turned = [&](int line) {
    const int first = room2dgs::kJointThere + 4 * line;
    return fma(of_pair(first), own.at.x, fma(of_pair(first + 1), own.at.y, of_pair(first + 2) * own.at.z));
  };
  const Three change = {turned(0), turned(1), turned(2)};  // by the log-scale
  const f8 z = change.z + of_pair(room2dgs::kJointThere + 11);
  i8 good = q.there & (depth > 0.0f) & (z > kNearest);
  const f8 per_z = 1.0f / select(good, z, splat(1.0f));
  const f8 across = (change.x + of_pair(room2dgs::kJointThere + 3)) * per_z;
  const f8 down = (change.y + of_pair(room2dgs::kJointThere + 7)) * per_z;
  const f8 fx = of_pair(room2dgs::kJointFocal), fy = of_pair(room2dgs::kJointFocal + 1);
  const f8 width = of_pair(room2dgs::kJointSize), height = of_pair(room2dgs::kJointSize + 1);
  f8 u = fma(across, fx, of_pair(room2dgs::kJointPrincipal)), v = fma(down, fy, of_pair(room2dgs::kJointPrincipal + 1));
  good &= (u > 0.0f) & (u < width) & (v > 0.0f) & (v < height);
  if (!any(good)) {
    keep(q, to, own.place, splat(0.0f)), keep(q, to + 1, own.place, splat(0.0f));
    return;
  }
  u = masked(good, u), v = masked(good, v);

  const float per_step = 1.0f / static_cast<float>(job.step), first = static_cast<float>(job.step / 2) + 0.5f;
  const float last_column = static_cast<float>(job.width - 1), last_row = static_cast<float>(job.height - 1);
  const f8 x = (u - first) * per_step, y = (v - first) * per_step;
  const i8 left = truncated(between(x, 0.0f, last_column - 1.0f)), top = truncated(between(y, 0.0f, last_row - 1.0f));
  const f8 a = between(x - number(left), 0.0f, 1.0f), b = between(y - number(top), 0.0f, 1.0f);
  const i8 corner = map_index(job, other, top, left);
  const float* below = job.depth + job.width;
  const f8 d[4] = {gather(job.depth, corner), gather(job.depth + 1, corner), gather(below, corner), gather(below + 1, corner)};
  const f8 least = vmin(vmin(d[0], d[1]), vmin(d[2], d[3])), most = vmax(vmax(d[0], d[1]), vmax(d[2], d[3]));
  good &= (least > 0.0f) & (least > most * (1.0f - kOneSurface));
  const f8 upper = fma(a, d[1] - d[0], d[0]), known = fma(b, fma(a, d[3] - d[2], d[2]) - upper, upper);

  // the nearest sample, halves to the even one
  const float magic = 12582912.0f;
  const i8 nearest_column = truncated((between(x, 0.0f, last_column) + magic) - magic);
  const i8 nearest_row = truncated((between(y, 0.0f, last_row) + magic) - magic);
  const f8 there = gather(job.depth_confidence, map_index(job, other, nearest_row, nearest_column));
  const f8 weight = vmin(gather(job.depth_confidence, index), there);

  // shares of the image have the size that `other`'s pairs have
  const f8 per_width = 1.0f / width, per_height = 1.0f / height;
  const Place place = place_at(job, other, u * per_width, v * per_height);
  const f8 ratio = select(good, z / known, splat(1.0f));
  const f8 pull = pull_of(q, term, good, log_of(ratio) - place.value, weight);
  const f8* k = place.corner;
  const f8 by_u = fma(place.lower, (k[3] - k[2]) - (k[1] - k[0]), k[1] - k[0]) * per_width * static_cast<float>(job.columns - 1);
  const f8 by_v = fma(place.right, (k[3] - k[1]) - (k[2] - k[0]), k[2] - k[0]) * per_height * static_cast<float>(job.rows - 1);
  const f8 du = (change.x - across * change.z) * per_z * fx, dv = (change.y - down * change.z) * per_z * fy;
  const f8 whole = change.z * per_z - fma(by_u, du, by_v * dv);
  keep(q, to, own.place, masked(good, pull * whole));
  keep(q, to + 1, place, -pull);
}

// Sine of the angle between a short segment of the surface and the plane of the normal prior at its middle.
R2_INLINE void slopes(Samples& q, int term, int to) {
  const JointJob& job = q.job;
  i8 view = q.draw(0), row = q.draw(1), column = q.draw(2), down = q.draw(3);
  q.allow(within(view, job.views) & within(row, job.height - kJointSlopeStep) & within(column, job.width - kJointSlopeStep) &
          within(down, 2));
  view = q.only(view), row = q.only(row), column = q.only(column), down = q.only(down);
  const i8 right = 1 - down, end_row = row + down * kJointSlopeStep, end_column = column + right * kJointSlopeStep;
  const i8 middle = map_index(job, view, row + down * (kJointSlopeStep / 2), column + right * (kJointSlopeStep / 2));
  const Three normal = three_at(job.normal, middle);
  const f8 first = gather(job.depth, map_index(job, view, row, column));
  const f8 last = gather(job.depth, map_index(job, view, end_row, end_column));
  const f8 near = vmin(first, last), far = vmax(first, last);
  const i8 some = (normal.x != 0.0f) | (normal.y != 0.0f) | (normal.z != 0.0f);
  const i8 good = q.there & (near > 0.0f) & (far < near * (1.0f + kSlopeJump)) & some;
  const Camera camera = camera_of(job, view);
  const Surface start = surface_at(job, camera, row, column, first);
  const Surface end = surface_at(job, camera, end_row, end_column, last);
  const Three segment = end.at - start.at;
  const f8 length = vsqrt(dot(segment, segment));
  const i8 long_enough = length > 1e-6f;
  const f8 per_length = 1.0f / vmax(length, splat(1e-6f));
  const f8 sine = dot(segment, normal) * per_length;
  const f8 pull = pull_of(q, term, good, sine, gather(job.normal_confidence, middle)) * per_length;
  const Three by_segment = normal - segment * masked(long_enough, sine * per_length);
  keep(q, to, start.place, masked(good, -pull * dot(by_segment, start.at)));
  keep(q, to + 1, end.place, masked(good, pull * dot(by_segment, end.at)));
}

// Three samples, by their steps from a drawn one: lanes where they lie in one textureless region with one normal, and
// the depths of all.
struct Region {
  i8 view, row[3], column[3], good;
  f8 depth[3];
};
R2_INLINE Region region_of(Samples& q, const int (&by_down)[3][2], const int (&by_right)[3][2]) {
  const JointJob& job = q.job;
  i8 view = q.draw(0), row = q.draw(1), column = q.draw(2), down = q.draw(3), right = q.draw(4);
  constexpr int32_t limit = 1 << 20;  // what is counted from here on does not overflow
  q.allow(within(view, job.views) & within(row, job.height) & within(column, job.width) & (down > -limit) &
          (down < limit) & (right > -limit) & (right < limit));
  row &= q.there, column &= q.there, down &= q.there, right &= q.there;  // what is not allowed may be any number
  const i8 far_down = select(down < 0, -down, down), far_right = select(right < 0, -right, right);
  const i8 longest = select(far_down > far_right, far_down, far_right);
  Region r;
  // all three stay inside, to whichever side they lie
  r.good = q.there & (longest >= kLeastStep) & (row >= longest) & (column >= longest) &
           (row + longest < static_cast<int32_t>(job.height)) & (column + longest < static_cast<int32_t>(job.width));
  r.view = r.good & view;
  down &= r.good, right &= r.good, row &= r.good, column &= r.good;
  i8 index[3];
  for (int k = 0; k < 3; ++k) {
    r.row[k] = row + down * by_down[k][0] + right * by_down[k][1];
    r.column[k] = column + down * by_right[k][0] + right * by_right[k][1];
    index[k] = map_index(job, r.view, r.row[k], r.column[k]);
  }
  const i8 region = gather(job.region, index[0]);
  r.good &= (region > 0);
  if (!any(r.good)) return r;
  r.good &= (region == gather(job.region, index[1])) & (region == gather(job.region, index[2]));
  if (!any(r.good)) return r;
  Three normal[3];
  for (int k = 0; k < 3; ++k) {
    r.depth[k] = gather(job.depth, index[k]), normal[k] = three_at(job.region_normal, index[k]);
    r.good &= r.depth[k] > 0.0f;
  }
  for (int k = 0; k < 3; ++k) r.good &= dot(normal[k], normal[(k + 1) % 3]) >= kPlaneCosine;
  return r;
}

// Deviation of a textureless region from a plane, on which 1 / depth is linear over the image.
R2_INLINE bool planes(Samples& q, int term, int to) {
  const Region r = region_of(q, {{-1, 0}, {0, 0}, {1, 0}}, {{0, -1}, {0, 0}, {0, 1}});
  if (!any(r.good)) return false;
  const Camera camera = camera_of(q.job, r.view);
  Surface s[3];
  for (int k = 0; k < 3; ++k) s[k] = surface_at(q.job, camera, r.row[k], r.column[k], select(r.good, r.depth[k], splat(1.0f)));
  const f8 before = s[1].at.z / s[0].at.z * 0.5f, after = s[1].at.z / s[2].at.z * 0.5f;
  const f8 pull = pull_of(q, term, r.good, (before - 0.5f) + (after - 0.5f), splat(1.0f));
  keep(q, to, s[0].place, -pull * before);
  keep(q, to + 1, s[1].place, pull * (before + after));
  keep(q, to + 2, s[2].place, -pull * after);
  return true;
}

// Sine of the angle of a textureless region to the axis that it nearly faces; the tilt of other walls.
R2_INLINE bool axes(Samples& q, int term, int to) {
  const JointJob& job = q.job;
  // the second and third points are seen from the first at a right angle
  const Region r = region_of(q, {{0, 0}, {1, 0}, {0, -1}}, {{0, 0}, {0, 1}, {1, 0}});
  if (!any(r.good)) return false;
  const Camera camera = camera_of(job, r.view);
  Surface s[3];
  for (int k = 0; k < 3; ++k) s[k] = surface_at(job, camera, r.row[k], r.column[k], select(r.good, r.depth[k], splat(1.0f)));
  const Three u = s[1].at - s[0].at, v = s[2].at - s[0].at;
  Three normal = cross(u, v);
  const f8 length = vsqrt(dot(normal, normal)), per_length = 1.0f / vmax(length, splat(1e-9f));
  const i8 long_enough = length > 1e-9f;
  normal = normal * per_length;
  const auto axis_of = [&](int64_t a) {
    const auto part = [&](int k) { return gather(job.axes + (3 * a + k) * job.views, r.view); };
    return Three{part(0), part(1), part(2)};
  };
  const Three up = axis_of(0);
  const f8 tilt = dot(normal, up);
  Three axis = up;
  f8 along = tilt;
  for (int64_t a = 1; a < job.axis_count; ++a) {
    const Three next = axis_of(a);
    const f8 to_next = dot(normal, next);
    const i8 nearer = absolute(to_next) > absolute(along);
    axis = {select(nearer, next.x, axis.x), select(nearer, next.y, axis.y), select(nearer, next.z, axis.z)};
    along = select(nearer, to_next, along);
  }
  const i8 facing = absolute(along) > kAxisCosine, leaning = ~facing & (absolute(tilt) < kUprightSine);
  const i8 good = r.good & (facing | leaning);
  const f8 squared = 1.0f - along * along, sine = vsqrt(vmax(squared, splat(1e-12f)));
  const f8 pull = pull_of(q, term, good, select(facing, sine, tilt), splat(1.0f));
  const f8 by_along = select(facing, masked(squared >= 1e-12f, -along / sine), splat(1.0f));
  axis = {select(facing, axis.x, up.x), select(facing, axis.y, up.y), select(facing, axis.z, up.z)};
  const f8 chosen = masked(long_enough, select(facing, along, tilt));
  const Three by_normal = (axis - normal * chosen) * (pull * by_along * per_length);
  const Three by_u = cross(v, by_normal), by_v = cross(by_normal, u);
  keep(q, to, s[0].place, masked(good, -dot(by_u, s[0].at) - dot(by_v, s[0].at)));
  keep(q, to + 1, s[1].place, masked(good, dot(by_u, s[1].at)));
  keep(q, to + 2, s[2].place, masked(good, dot(by_v, s[2].at)));
  return true;
}

}  // namespace

JointSum joint_samples(const JointJob& job, int term, int64_t first) {
  JointSum sum = {};
  LaneSum cost;
  const int64_t last = first + room2dgs::kJointChunk < job.samples ? first + room2dgs::kJointChunk : job.samples;
  const int to = room2dgs::kJointFirstPlace[term], after = room2dgs::kJointFirstPlace[term + 1];
  const int32_t* draws = job.draws + room2dgs::kJointFirstDraw[term] * job.samples;
  for (int64_t at = first; at < last; at += kLanes) {
    const i8 there = number(splat_i(0)) + iota() < static_cast<float>(job.samples - at);
    Samples q = {job, draws + at, at, there, cost, sum};
    bool some = true;
    switch (term) {
      case room2dgs::kJointPoints: points(q, term, to); break;
      case room2dgs::kJointViews: views(q, term, to); break;
      case room2dgs::kJointSlopes: slopes(q, term, to); break;
      case room2dgs::kJointPlanes: some = planes(q, term, to); break;
      default: some = axes(q, term, to); break;
    }
    if (!some)
      for (int place = to; place < after; ++place) {
        Place nowhere = {};
        keep(q, place, nowhere, splat(0.0f));
      }
  }
  sum.cost = cost.total();
  return sum;
}

void joint_scatter(const JointJob& job, int term, float scale) {
  for (int place = room2dgs::kJointFirstPlace[term]; place < room2dgs::kJointFirstPlace[term + 1]; ++place) {
    const int64_t first = place * job.stride;
    for (int64_t at = first; at < first + job.samples; ++at) {
      const float pull = job.pull[at] * scale;
      if (pull == 0.0f) continue;
      float* knots = job.gradient + job.knot[at];
      const float right = job.right[at], under = pull * job.lower[at], upper = pull - under;
      const float upper_right = upper * right, lower_right = under * right;
      knots[0] += upper - upper_right, knots[1] += upper_right;
      knots[job.columns] += under - lower_right, knots[job.columns + 1] += lower_right;
    }
  }
}

// Bending energy of a thin plate (mean squared second differences) and mean square, both weighted by the stiffness.
// Differences lie in rows with a margin: what lies beyond the grid is 0 and weighs nothing.
double joint_regulariser(const JointJob& job, int64_t view, float* scratch) {
  const int64_t rows = job.rows, columns = job.columns, stride = room2dgs::joint_row(columns);
  const int64_t size = (rows + 2) * stride, knots = rows * columns;
  std::memset(scratch, 0, 5 * size * sizeof(float));
  const int64_t origin = stride + kLanes;
  float *grid = scratch + origin, *stiff = grid + size, *down = stiff + size, *along = down + size, *mixed = along + size;
  for (int64_t r = 0; r < rows; ++r) {
    std::memcpy(grid + r * stride, job.grid + view * knots + r * columns, columns * sizeof(float));
    std::memcpy(stiff + r * stride, job.stiffness + view * knots + r * columns, columns * sizeof(float));
  }
  const auto share = [&](int64_t count, float weight) {
    return count > 0 ? static_cast<float>(weight / (static_cast<double>(job.views) * count)) : 0.0f;
  };
  const float of_down = share((rows - 2) * columns, job.smoothness), of_along = share(rows * (columns - 2), job.smoothness);
  const float of_mixed = share((rows - 1) * (columns - 1), 2.0f * job.smoothness), of_size = share(knots, job.magnitude);
  LaneSum cost;
  for (int64_t r = 0; r < rows; ++r)
    for (int64_t c = 0; c < columns; c += kLanes) {
      const int64_t at = r * stride + c;
      const f8 column = iota() + static_cast<float>(c);
      const f8 s = load(stiff + at), g = load(grid + at), below = load(grid + at + stride);
      const f8 size_pull = s * g * of_size;
      f8 sum = size_pull * g;
      if (r > 0 && r < rows - 1) {
        const f8 d = below - 2.0f * g + load(grid + at - stride), pull = s * d * of_down;
        sum = sum + pull * d;
        store(down + at, pull);
      }
      const f8 d = load(grid + at + 1) - 2.0f * g + load(grid + at - 1);
      const f8 pull = masked((column > 0.0f) & (column < static_cast<float>(columns - 1)), s * d * of_along);
      sum = sum + pull * d;
      store(along + at, pull);
      if (r < rows - 1) {
        const f8 twist = (load(grid + at + stride + 1) - below) - (load(grid + at + 1) - g);
        const f8 twist_pull = masked(column < static_cast<float>(columns - 1), s * twist * of_mixed);
        sum = sum + twist_pull * twist;
        store(mixed + at, twist_pull);
      }
      cost.add(sum);
    }
  for (int64_t r = 0; r < rows; ++r) {
    float* to = job.gradient + view * knots + r * columns;
    for (int64_t c = 0; c < columns; c += kLanes) {
      const int64_t at = r * stride + c;
      f8 pull = load(stiff + at) * load(grid + at) * of_size;
      pull = pull + (load(down + at - stride) - 2.0f * load(down + at) + load(down + at + stride));
      pull = pull + (load(along + at - 1) - 2.0f * load(along + at) + load(along + at + 1));
      pull = pull + (load(mixed + at - stride - 1) - load(mixed + at - stride));
      pull = (pull + (load(mixed + at) - load(mixed + at - 1))) * 2.0f;
      if (c + kLanes <= columns)
        store(to + c, load(to + c) + pull);
      else
        for (int64_t k = 0; c + k < columns; ++k) to[c + k] += pull[k];
    }
  }
  return cost.total();
}

void adam_step(const AdamStep& step, int64_t first, int64_t last) {
  constexpr float kFirst = static_cast<float>(1.0 - kAdamFirst), kSecond = static_cast<float>(1.0 - kAdamSecond);
  constexpr float kKept = static_cast<float>(kAdamSecond), kLeast = 1e-8f;
  const auto moved = [&](auto g, auto& m, auto& v, auto x) {
    m = m + (g - m) * kFirst;
    v = v * kKept + g * g * kSecond;
    return x - m * step.size / (vsqrt(v) * step.per_root + kLeast);
  };
  int64_t at = first;
  for (; at + kLanes <= last; at += kLanes) {
    f8 m = load(step.first + at), v = load(step.second + at);
    store(step.values + at, moved(load(step.gradient + at), m, v, load(step.values + at)));
    store(step.first + at, m), store(step.second + at, v);
  }
  for (; at < last; ++at)
    step.values[at] = moved(step.gradient[at], step.first[at], step.second[at], step.values[at]);
}

}  // namespace R2_ISA
