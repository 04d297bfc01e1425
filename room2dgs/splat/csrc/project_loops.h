// Surfels, or 3D Gaussians, to records, bounds and tile spans; and the way back from their pixel sums to their parameters.
// Several at once, as many as a vector has doubles; which tiles one reaches is found one by one. Below a surfel stands for
// either kind.
//
// What differs is found by `Kind`: SurfelKind (stages.h) or GaussianKind (gaussian_stages.h) with
//   Splat                         the parameters of several, Surfel<Doubles> or Gaussian<Doubles>
//   of(center, w, x, y, z, scale) a Splat; scale(n) gives the n-th scale
#pragma once

#include "doubles.h"  // first: the templates of stages.h see what stands before them

#include "raster.h"
#include "stages.h"

namespace R2_ISA {
namespace {

using room2dgs::Extent;
using room2dgs::kProjectBlock;
using room2dgs::Span;
using room2dgs::SpanSink;

// Some of a block's surfels, in their order. The last group of `kDoubles` is filled up with the last surfel.
struct Chosen {
  int64_t index[kProjectBlock + kDoubles];
  int count = 0;
  void add(int64_t i) { index[count++] = i; }
  void fill_up() {
    for (int k = 0; k < kDoubles; ++k) index[count + k] = count ? index[count - 1] : 0;
  }
};

// A bit for each of eight surfels that may be seen.
template <class Kind>
R2_INLINE uint32_t maybe_seen_of(const SurfelArrays& s, const Frustum& f, int64_t i, int lanes) {
  // by way of memory: with UBSan's checks GCC loses the index of a vector's element in a loop
  float x[kLanes] = {}, y[kLanes] = {}, z[kLanes] = {}, scale[kLanes] = {}, opacity[kLanes] = {};
  for (int k = 0; k < lanes; ++k) {
    const float *c = s.centers + 3 * (i + k), *e = s.scales + Kind::kScales * (i + k);
    x[k] = c[0], y[k] = c[1], z[k] = c[2];
    scale[k] = Kind::largest(e);
    opacity[k] = s.opacities[i + k];
  }
  const i8 seen = maybe_seen<f8>(f, load(x), load(y), load(z), load(scale), load(opacity));
  return bits(seen) & ((1u << lanes) - 1);
}

// The surfels of `index`, a lane each.
template <class Kind>
struct Group {
  const SurfelArrays& s;
  int64_t centers[kDoubles], rotations[kDoubles], scales[kDoubles], sh[kDoubles];
  const int64_t* index;

  R2_INLINE Group(const SurfelArrays& surfels, const int64_t* chosen) : s(surfels), index(chosen) {
    for (int k = 0; k < kDoubles; ++k) {
      centers[k] = 3 * index[k], rotations[k] = 4 * index[k], scales[k] = Kind::kScales * index[k];
      sh[k] = 3 * s.sh_count * index[k];
    }
  }
  R2_INLINE typename Kind::Splat surfels() const {
    const float *c = s.centers, *q = s.rotations, *e = s.scales;
    return Kind::of({picked(c, centers), picked(c + 1, centers), picked(c + 2, centers)}, picked(q, rotations),
                    picked(q + 1, rotations), picked(q + 2, rotations), picked(q + 3, rotations),
                    [&](int n) __attribute__((always_inline)) { return picked(e + n, scales); });
  }
  R2_INLINE Doubles opacities() const { return picked(s.opacities, index); }
  R2_INLINE Doubles operator[](int k) const { return picked(s.sh + k, sh); }  // coefficients, for sh.h
};

// The numbers of one lane, by way of memory.
struct Lane {
  int k;
  R2_INLINE double operator()(const Doubles& x) const { return reinterpret_cast<const double*>(&x)[k]; }
  R2_INLINE bool operator()(const DoublesMask& x) const { return reinterpret_cast<const int64_t*>(&x)[k] != 0; }
  R2_INLINE Vec3<double> operator()(const Vec3<Doubles>& v) const { return {(*this)(v.x), (*this)(v.y), (*this)(v.z)}; }
  R2_INLINE Disc<double> operator()(const Disc<Doubles>& d) const {
    const Lane& of = *this;
    return {of(d.su), of(d.sv), of(d.tu), of(d.tv), of(d.cx), of(d.cy), of(d.dx), of(d.dy), of(d.z), of(d.aux),
            of(d.auy), of(d.avx), of(d.avy), of(d.bx), of(d.by), of(d.plane), of(d.rho)};
  }
  R2_INLINE Reach<double> operator()(const Reach<Doubles>& r) const {
    const Lane& of = *this;
    return {of(r.x0), of(r.x1), of(r.y0), of(r.y1), of(r.crossing), of(r.ex), of(r.ey), of(r.hx), of(r.hy),
            of(r.shear), of(r.lean), of(r.width), of(r.filter)};
  }
  R2_INLINE void operator()(const RecordNumbers<fn>& numbers, Record& r) const {
    constexpr int kNumbers = sizeof(RecordNumbers<float>) / sizeof(float);
    const float* from = reinterpret_cast<const float*>(&numbers) + k;
    float* to = reinterpret_cast<float*>(static_cast<RecordNumbers<float>*>(&r));
    for (int n = 0; n < kNumbers; ++n) to[n] = from[n * kDoubles];
  }
};

// The pixels of several surfels.
struct Ranges {
  in x0, x1, y0, y1;
  R2_INLINE Ranges(const Box<Doubles>& b)
      : x0(whole_numbers(b.x0)), x1(whole_numbers(b.x1)), y0(whole_numbers(b.y0)), y1(whole_numbers(b.y1)) {}
  R2_INLINE PixelRange operator[](int k) const {
    const auto of = [k](const in& x) { return reinterpret_cast<const int32_t*>(&x)[k]; };
    return {of(x0), of(x1), of(y0), of(y1)};
  }
};

// Fills the spans and the extent of a surfel that reaches pixels, and gives its tiles. tiles_of(row) calls row as
// `for_tile_rows` does; it is asked where there is more than one tile.
template <class Tiles>
R2_INLINE uint32_t place(const PixelRange& p, bool crossing, Extent& extent, SpanSink sink, Tiles&& tiles_of) {
  const int tx0 = p.x0 / kTile, tx1 = p.x1 / kTile, ty0 = p.y0 / kTile, ty1 = p.y1 / kTile;
  extent.row = static_cast<uint16_t>(ty0);
  extent.rows = static_cast<uint16_t>(ty1 - ty0 + 1);
  Span* spans = sink.room(sink.context, extent.span, extent.rows);
  if (tx0 == tx1 && ty0 == ty1 && !crossing) {
    *spans = {static_cast<uint16_t>(tx0), static_cast<uint16_t>(tx0 + 1)};
    return 1;
  }
  uint32_t tiles = 0;
  tiles_of([&](int ty, int begin, int end) __attribute__((always_inline)) {
    spans[ty - ty0] = {static_cast<uint16_t>(begin), static_cast<uint16_t>(end)};
    tiles += static_cast<uint32_t>(end - begin);
  });
  return tiles;
}

template <class Kind>
void project(const View& view, const SurfelArrays& s, int64_t begin, int64_t end, Record* records, Extent* extents,
             SpanSink sink) {
  const Frustum frustum = Kind::frustum(view);
  Chosen near;
  for (int64_t first = begin; first < end; first += kLanes) {
    const int lanes = end - first < kLanes ? static_cast<int>(end - first) : kLanes;
    const uint32_t seen = maybe_seen_of<Kind>(s, frustum, first, lanes);
    for (int k = 0; k < lanes; ++k) {
      extents[first + k].tiles = 0;
      if (seen >> k & 1) near.add(first + k);
    }
  }
  near.fill_up();
  uint32_t span = 0, record = static_cast<uint32_t>(begin);
  for (int first = 0; first < near.count; first += kDoubles) {
    const int64_t* index = near.index + first;
    const Group<Kind> group(s, index);
    const auto standing = stand(group.surfels(), group.opacities(), view);
    const Reach<Doubles> reaches = reach_before(standing, view);
    const RecordNumbers<fn> numbers = numbers_of(standing, reaches, view, group, s.sh_count);
    const Box<Doubles> boxes = box_of(reaches, view);
    const Ranges ranges(boxes);
    const uint32_t crossing = bits(reaches.crossing);
    uint32_t seen = bits(standing.seen) & (bits(boxes.some) | crossing);
    if (near.count - first < kDoubles) seen &= (1u << (near.count - first)) - 1;
    for (; seen; seen &= seen - 1) {
      const int k = __builtin_ctz(seen);
      const Lane lane{k};
      const bool crosses = crossing >> k & 1;
      PixelRange pixels = ranges[k];
      if (crosses) {
        Reach<double> reach = lane(reaches);
        add_crossing(lane(standing.disc), view, reach);
        const Box<double> box = box_of(reach, view);
        if (!box.some) continue;
        pixels = range_of(box);
      }
      Extent& extent = extents[index[k]];
      extent.span = span, extent.record = record;
      extent.tiles = place(pixels, crosses, extent, sink, [&](auto&& row) __attribute__((always_inline)) {
        for_tile_rows(lane(standing.disc), lane(reaches), view, pixels, row);
      });
      if (!extent.tiles) continue;
      Record& r = records[record];
      lane(numbers, r);
      put_box(pixels, r);
      extent.depth = r.z;
      span += extent.rows, ++record;
    }
  }
}

template <class Kind>
void project_backward(const View& view, const SurfelArrays& s, const Extent* extents, const uint32_t* first_entry,
                      const float* entries, int64_t begin, int64_t end, const room2dgs::SurfelGradients& out,
                      room2dgs::CameraGradient<double>* camera) {
  Chosen seen;
  for (int64_t i = begin; i < end; ++i) {
    if (extents[i].tiles) seen.add(i);
    else zero_gradients(out, i, Kind::kScales, 3 * s.sh_count);
  }
  seen.fill_up();
  room2dgs::CameraGradient<Doubles> total = {};
  for (int first = 0; first < seen.count; first += kDoubles) {
    const int64_t* index = seen.index + first;
    const int lanes = seen.count - first < kDoubles ? seen.count - first : kDoubles;
    const Group<Kind> group(s, index);
    // lanes that only fill up have sums of 0, so that they add nothing to the camera's gradient
    double sums[kDoubles][kGradients] = {};
    for (int k = 0; k < lanes; ++k)
      sum_entries(entries + static_cast<int64_t>(first_entry[index[k]]) * kGradients, extents[index[k]].tiles, sums[k]);
    Doubles sum[kGradients];
    for (int n = 0; n < kGradients; ++n)
      for (int k = 0; k < kDoubles; ++k) sum[n].lanes[k] = sums[k][n];
    const auto put = [&](float* array, int numbers, int n, Doubles gradient) __attribute__((always_inline)) {
      const fn g = narrow(gradient);
      for (int k = 0; k < lanes; ++k) array[numbers * index[k] + n] = reinterpret_cast<const float*>(&g)[k];
    };
    splat_backward(view, group.surfels(), group.opacities(), sum, group, s.sh_count, out, put, total);
  }
  for (int k = 0; k < 9; ++k) camera->R[k] = hsum(total.R[k]);
  for (int k = 0; k < 3; ++k) camera->t[k] = hsum(total.t[k]);
  camera->fx = hsum(total.fx), camera->fy = hsum(total.fy), camera->cx = hsum(total.cx), camera->cy = hsum(total.cy);
}

}  // namespace
}  // namespace R2_ISA
