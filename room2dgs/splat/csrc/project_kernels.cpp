// Surfels to records, bounds and tile spans; and the way back from a surfel's pixel sums to its parameters.
#include "bounds.h"
#include "raster.h"
#include "sh.h"

namespace R2_ISA {
namespace {

using room2dgs::Camera;
using room2dgs::Extent;
using room2dgs::kTile;
using room2dgs::Record;
using room2dgs::Span;
using room2dgs::SpanSink;
using room2dgs::SurfelArrays;

View view_of(const Camera& camera) {
  View v;
  for (int k = 0; k < 9; ++k) v.R[k] = camera.R[k];
  for (int k = 0; k < 3; ++k) v.t[k] = camera.t[k];
  v.fx = camera.fx, v.fy = camera.fy, v.cx = camera.cx, v.cy = camera.cy;
  v.near = camera.near, v.width = camera.width, v.height = camera.height;
  return v;
}

// Eight values, `stride` floats apart; lanes beyond `lanes` repeat the first.
R2_INLINE f8 gather(const float* p, int64_t stride, int lanes) {
  f8 r;
  for (int k = 0; k < kLanes; ++k) r[k] = p[k < lanes ? k * stride : 0];
  return r;
}

R2_INLINE Surfel<f8> load_surfels(const SurfelArrays& s, int64_t i, int lanes) {
  const float *c = s.centers + 3 * i, *q = s.rotations + 4 * i, *e = s.scales + 2 * i;
  return {{gather(c, 3, lanes), gather(c + 1, 3, lanes), gather(c + 2, 3, lanes)},
          gather(q, 4, lanes), gather(q + 1, 4, lanes), gather(q + 2, 4, lanes), gather(q + 3, 4, lanes),
          gather(e, 2, lanes), gather(e + 1, 2, lanes)};
}

// Unit direction from the camera to the surfel in the world, and 1 / distance.
R2_INLINE Vec3<f8> view_direction(const View& view, const Projected<f8>& o, f8& inverse_distance) {
  inverse_distance = 1.0f / vsqrt(dot(o.p, o.p));
  return rotate_transposed(view.R, inverse_distance * o.p);
}

R2_INLINE int first_pixel(float x) { return static_cast<int>(::ceilf(x - 0.5f)); }
R2_INLINE int last_pixel(float x) { return static_cast<int>(::floorf(x - 0.5f)); }

// Fills a visible surfel's pixel range, spans and extent. False when it reaches no pixel.
bool place(const Disc& d, const View& view, Record& record, Extent& extent, SpanSink sink) {
  const Reach r = reach_of(d, view);
  const float width = static_cast<float>(view.width), height = static_cast<float>(view.height);
  // written so that a NaN fails
  if (!(r.x0 < width && r.x1 > 0 && r.y0 < height && r.y1 > 0)) return false;
  const int x0 = first_pixel(r.x0 > 0 ? r.x0 : 0), x1 = last_pixel(r.x1 < width ? r.x1 : width);
  const int y0 = first_pixel(r.y0 > 0 ? r.y0 : 0), y1 = last_pixel(r.y1 < height ? r.y1 : height);
  if (x0 > x1 || y0 > y1) return false;
  record.x0 = static_cast<int16_t>(x0), record.x1 = static_cast<int16_t>(x1);
  record.y0 = static_cast<int16_t>(y0), record.y1 = static_cast<int16_t>(y1);
  const int tx0 = x0 / kTile, tx1 = x1 / kTile, ty0 = y0 / kTile, ty1 = y1 / kTile;
  extent.row = static_cast<uint16_t>(ty0);
  extent.rows = static_cast<uint16_t>(ty1 - ty0 + 1);
  Span* spans = sink.room(sink.context, extent.span, extent.rows);
  uint32_t tiles = 0;
  if (tx0 == tx1 && ty0 == ty1) {
    spans[0] = {static_cast<uint16_t>(tx0), static_cast<uint16_t>(tx0 + 1)};
    tiles = 1;
  } else {
    for (int ty = ty0; ty <= ty1; ++ty) {
      const float sy0 = ty * kTile + 0.5f, sy1 = sy0 + kTile - 1;
      int a = tx0, b = tx1;
      if (r.crossing) {
        while (a <= b && !crossing_meets(d, a * kTile + 0.5f, a * kTile + kTile - 0.5f, sy0, sy1)) ++a;
        while (b > a && !crossing_meets(d, b * kTile + 0.5f, b * kTile + kTile - 0.5f, sy0, sy1)) --b;
      } else {
        float s0, s1;
        if (strip_range(d, r, sy0, sy1, s0, s1)) {
          const int p0 = first_pixel(s0 > 0 ? s0 : 0), p1 = last_pixel(s1 < width ? s1 : width);
          a = p0 / kTile > tx0 ? p0 / kTile : tx0;
          b = p1 < 0 ? -1 : (p1 / kTile < tx1 ? p1 / kTile : tx1);
          if (p0 > p1) b = a - 1;
        } else {
          b = a - 1;
        }
      }
      if (b < a) a = b = tx0, b = a - 1;
      spans[ty - ty0] = {static_cast<uint16_t>(a), static_cast<uint16_t>(b + 1)};
      tiles += static_cast<uint32_t>(b + 1 - a);
    }
  }
  extent.tiles = tiles;
  return tiles > 0;
}

void project(const Camera& camera, const SurfelArrays& s, int64_t begin, int64_t end, Record* records,
             Extent* extents, SpanSink sink) {
  const View view = view_of(camera);
  uint32_t span = 0;
  for (int64_t i = begin; i < end; i += kLanes) {
    const int lanes = end - i < kLanes ? static_cast<int>(end - i) : kLanes;
    const Surfel<f8> surfel = load_surfels(s, i, lanes);
    const Axes<f8> axes = axes_of(surfel);
    const Projected<f8> o = project(surfel, axes, view);
    bool evaluated = false;
    f8 color[3];
    for (int k = 0; k < lanes; ++k) {
      Extent& extent = extents[i + k];
      extent.tiles = 0;
      extent.depth = o.p.z[k];
      const float opacity = s.opacities[i + k];
      if (!o.front[k] || !(opacity >= kAlphaMin)) continue;
      Disc d;
      d.rho = 2.0f * ::logf(opacity / kAlphaMin);
      d.su = surfel.su[k], d.sv = surfel.sv[k];
      d.tu = {o.tu.x[k], o.tu.y[k], o.tu.z[k]}, d.tv = {o.tv.x[k], o.tv.y[k], o.tv.z[k]};
      d.cx = o.cx[k], d.cy = o.cy[k], d.dx = o.dx[k], d.dy = o.dy[k], d.z = o.p.z[k];
      d.aux = o.aux[k], d.auy = o.auy[k], d.avx = o.avx[k], d.avy = o.avy[k], d.bx = o.bx[k], d.by = o.by[k];
      d.plane = o.plane[k] != 0;
      Record& r = records[i + k];
      extent.span = span;
      if (!place(d, view, r, extent, sink)) {
        extent.tiles = 0;
        continue;
      }
      span += extent.rows;
      if (!evaluated) {  // the colour of eight lanes costs as much as that of one
        evaluated = true;
        f8 inverse_distance;
        const Vec3<f8> direction = view_direction(view, o, inverse_distance);
        for (int c = 0; c < 3; ++c) color[c] = splat(0.5f);
        sh_terms<f8>(direction, s.sh_count, [&](int term, f8 value, f8, f8, f8) {
          const int64_t stride = 3 * s.sh_count;
          const float* p = s.sh + i * stride + 3 * term;
          for (int c = 0; c < 3; ++c) color[c] = fma(value, gather(p + c, stride, lanes), color[c]);
        });
        for (int c = 0; c < 3; ++c) color[c] = vmax(color[c], splat(0.0f));
      }
      r.cx = d.cx, r.cy = d.cy, r.z = d.z;
      r.aux = d.aux, r.auy = d.auy, r.avx = d.avx, r.avy = d.avy, r.bx = d.bx, r.by = d.by;
      r.den_max = d.z / view.near;
      r.opacity = opacity;
      r.rho_max = d.rho * 1.0001f + 1e-3f;  // a cheap first test; the exact one is on alpha
      for (int c = 0; c < 3; ++c) r.color[c] = color[c][k];
      r.normal[0] = o.side[k] * axes.tw.x[k], r.normal[1] = o.side[k] * axes.tw.y[k], r.normal[2] = o.side[k] * axes.tw.z[k];
    }
  }
}

// Sums a surfel's entries in the order of its tiles.
R2_INLINE void sum_entries(const float* entries, uint32_t count, float* sums) {
  f8 a = splat(0), b = splat(0), c = splat(0);
  for (uint32_t e = 0; e < count; ++e, entries += room2dgs::kGradients) {
    a += load(entries), b += load(entries + 8);
    f8 last = splat(0);
    for (int k = 0; k < 4; ++k) last[k] = entries[16 + k];
    c += last;
  }
  store(sums, a), store(sums + 8, b);
  for (int k = 0; k < 4; ++k) sums[16 + k] = c[k];
}

R2_INLINE void scatter(float* p, int64_t stride, int lanes, f8 value) {
  for (int k = 0; k < lanes; ++k) p[k * stride] = value[k];
}

void project_backward(const Camera& camera, const SurfelArrays& s, const Extent* extents, const uint32_t* first_entry,
                      const float* entries, int64_t begin, int64_t end, const room2dgs::SurfelGradients& out,
                      room2dgs::PoseGradient* pose) {
  const View view = view_of(camera);
  f8 gR[9], gt[3];
  for (f8& g : gR) g = splat(0);
  for (f8& g : gt) g = splat(0);
  const int64_t sh_stride = 3 * s.sh_count;
  for (int64_t i = begin; i < end; i += kLanes) {
    const int lanes = end - i < kLanes ? static_cast<int>(end - i) : kLanes;
    float sums[kLanes][room2dgs::kGradients];
    i8 seen = splat_i(0);
    bool any_seen = false;
    for (int k = 0; k < kLanes; ++k) {
      const uint32_t count = k < lanes ? extents[i + k].tiles : 0;
      if (count) {
        sum_entries(entries + static_cast<int64_t>(first_entry[i + k]) * room2dgs::kGradients, count, sums[k]);
        seen[k] = -1;
        any_seen = true;
      } else {
        for (float& x : sums[k]) x = 0;
      }
    }
    if (!any_seen) {
      for (int64_t k = 0; k < 3 * lanes; ++k) out.centers[3 * i + k] = 0;
      for (int64_t k = 0; k < 4 * lanes; ++k) out.rotations[4 * i + k] = 0;
      for (int64_t k = 0; k < 2 * lanes; ++k) out.scales[2 * i + k] = out.center_px[2 * i + k] = 0;
      for (int64_t k = 0; k < lanes; ++k) out.opacities[i + k] = 0;
      for (int64_t k = 0; k < sh_stride * lanes; ++k) out.sh[sh_stride * i + k] = 0;
      continue;
    }
    auto sum = [&](int j) {
      f8 r;
      for (int k = 0; k < kLanes; ++k) r[k] = sums[k][j];
      return r;
    };
    auto keep = [&](f8 x) { return masked(seen, x); };
    const Surfel<f8> surfel = load_surfels(s, i, lanes);
    const Axes<f8> axes = axes_of(surfel);
    const Projected<f8> o = project(surfel, axes, view);
    NineGrad<f8> g;
    const f8 gu = sum(0), gv = sum(3), gden = sum(6);
    g.aux = sum(1), g.auy = sum(2), g.avx = sum(4), g.avy = sum(5), g.bx = sum(7), g.by = sum(8), g.z = sum(9);
    g.cx = 2.0f * sum(10) - select(o.plane, gu * o.aux + gv * o.avx + gden * o.bx, splat(0));
    g.cy = 2.0f * sum(11) - select(o.plane, gu * o.auy + gv * o.avy + gden * o.by, splat(0));
    scatter(out.center_px + 2 * i, 2, lanes, keep(g.cx));
    scatter(out.center_px + 2 * i + 1, 2, lanes, keep(g.cy));
    CameraGrad<f8> c = project_backward(surfel, o, view, g);
    scatter(out.scales + 2 * i, 2, lanes, keep(c.su));
    scatter(out.scales + 2 * i + 1, 2, lanes, keep(c.sv));
    const f8 opacity = gather(s.opacities + i, 1, lanes);
    scatter(out.opacities + i, 1, lanes, keep(sum(12) / opacity));

    // colour -> coefficients and, beyond degree 0, the viewing direction
    f8 inverse_distance;
    const Vec3<f8> direction = view_direction(view, o, inverse_distance);
    f8 color[3] = {splat(0.5f), splat(0.5f), splat(0.5f)};
    sh_terms<f8>(direction, s.sh_count, [&](int term, f8 value, f8, f8, f8) {
      const float* p = s.sh + i * sh_stride + 3 * term;
      for (int ch = 0; ch < 3; ++ch) color[ch] = fma(value, gather(p + ch, sh_stride, lanes), color[ch]);
    });
    f8 gcolor[3];
    for (int ch = 0; ch < 3; ++ch) gcolor[ch] = masked(seen & (color[ch] > 0.0f), sum(13 + ch));
    Vec3<f8> gdirection = {splat(0), splat(0), splat(0)};
    sh_terms<f8>(direction, s.sh_count, [&](int term, f8 value, f8 ddx, f8 ddy, f8 ddz) {
      const float* p = s.sh + i * sh_stride + 3 * term;
      f8 through = splat(0);
      for (int ch = 0; ch < 3; ++ch) {
        scatter(out.sh + i * sh_stride + 3 * term + ch, sh_stride, lanes, value * gcolor[ch]);
        through = fma(gcolor[ch], gather(p + ch, sh_stride, lanes), through);
      }
      gdirection = gdirection + Vec3<f8>{through * ddx, through * ddy, through * ddz};
    });
    // d normalise(p - o): the part across the ray, over the distance; world frame
    const f8 radial = dot(gdirection, direction);
    const Vec3<f8> gview = {keep((gdirection.x - radial * direction.x) * inverse_distance),
                            keep((gdirection.y - radial * direction.y) * inverse_distance),
                            keep((gdirection.z - radial * direction.z) * inverse_distance)};

    const Vec3<f8> gp = {keep(c.p.x), keep(c.p.y), keep(c.p.z)};
    const Vec3<f8> ctu = {keep(c.tu.x), keep(c.tu.y), keep(c.tu.z)};
    const Vec3<f8> ctv = {keep(c.tv.x), keep(c.tv.y), keep(c.tv.z)};
    const Vec3<f8> ctw = {keep(c.tw.x), keep(c.tw.y), keep(c.tw.z)};
    const Vec3<f8> gcenter = rotate_transposed(view.R, gp) + gview;
    scatter(out.centers + 3 * i, 3, lanes, gcenter.x);
    scatter(out.centers + 3 * i + 1, 3, lanes, gcenter.y);
    scatter(out.centers + 3 * i + 2, 3, lanes, gcenter.z);
    const Vec3<f8> gnormal = {o.side * sum(16), o.side * sum(17), o.side * sum(18)};
    f8 gq[4];
    axes_backward(axes, rotate_transposed(view.R, ctu), rotate_transposed(view.R, ctv),
                  rotate_transposed(view.R, ctw) + gnormal, gq);
    for (int k = 0; k < 4; ++k) scatter(out.rotations + 4 * i + k, 4, lanes, keep(gq[k]));

    // pose: camera = R world + t for the centre, R alone for the axes, and the projection centre -R^T t for the view
    auto outer = [&](Vec3<f8> left, Vec3<f8> right) {
      const f8 l[3] = {left.x, left.y, left.z}, r[3] = {right.x, right.y, right.z};
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) gR[3 * a + b] += keep(l[a] * r[b]);
    };
    outer(gp, surfel.center), outer(ctu, axes.tu), outer(ctv, axes.tv), outer(ctw, axes.tw);
    gt[0] += gp.x, gt[1] += gp.y, gt[2] += gp.z;
    const Vec3<f8> gt_view = rotate(view.R, gview);
    gt[0] += gt_view.x, gt[1] += gt_view.y, gt[2] += gt_view.z;
    outer({splat(view.t[0]), splat(view.t[1]), splat(view.t[2])}, gview);
  }
  for (int k = 0; k < 9; ++k) pose->R[k] = hsum(gR[k]);
  for (int k = 0; k < 3; ++k) pose->t[k] = hsum(gt[k]);
}

}  // namespace

room2dgs::Kernels blend_kernels();

room2dgs::Kernels raster_kernels() {
  room2dgs::Kernels k = blend_kernels();
  k.project = &project;
  k.project_backward = &project_backward;
  return k;
}

}  // namespace R2_ISA
