// Surfels to records, bounds and tile spans; and the way back from a surfel's pixel sums to its parameters.
#include "simd.h"  // first: the templates of stages.h see what stands before them

#include "raster.h"
#include "stages.h"

namespace R2_ISA {
namespace {

using room2dgs::Extent;
using room2dgs::Span;
using room2dgs::SpanSink;

// A bit for each of eight surfels that may be seen.
R2_INLINE uint32_t maybe_seen_of(const SurfelArrays& s, const Frustum& f, int64_t i, int lanes) {
  // by way of memory: with UBSan's checks GCC loses the index of a vector's element in a loop
  float x[kLanes] = {}, y[kLanes] = {}, z[kLanes] = {}, scale[kLanes] = {}, opacity[kLanes] = {};
  for (int k = 0; k < lanes; ++k) {
    const float *c = s.centers + 3 * (i + k), *e = s.scales + 2 * (i + k);
    x[k] = c[0], y[k] = c[1], z[k] = c[2];
    scale[k] = e[0] > e[1] ? e[0] : e[1];
    opacity[k] = s.opacities[i + k];
  }
  const i8 seen = maybe_seen<f8>(f, load(x), load(y), load(z), load(scale), load(opacity));
  return bits(seen) & ((1u << lanes) - 1);
}

// Fills a visible surfel's spans and extent. False when it reaches no pixel.
R2_INLINE bool place(const Disc& d, const Reach& r, const View& view, PixelRange& p, Extent& extent, SpanSink sink) {
  if (!pixels_of(r, view, p)) return false;
  const int ty0 = p.y0 / kTile, ty1 = p.y1 / kTile;
  extent.row = static_cast<uint16_t>(ty0);
  extent.rows = static_cast<uint16_t>(ty1 - ty0 + 1);
  Span* spans = sink.room(sink.context, extent.span, extent.rows);
  uint32_t tiles = 0;
  for_tile_rows(d, r, view, p, [&](int ty, int begin, int end) __attribute__((always_inline)) {
    spans[ty - ty0] = {static_cast<uint16_t>(begin), static_cast<uint16_t>(end)};
    tiles += static_cast<uint32_t>(end - begin);
  });
  extent.tiles = tiles;
  return tiles > 0;
}

void project(const View& view, const SurfelArrays& s, int64_t begin, int64_t end, Record* records, Extent* extents,
             SpanSink sink) {
  const Frustum frustum = frustum_of(view);
  uint32_t span = 0, record = static_cast<uint32_t>(begin);
  for (int64_t first = begin; first < end; first += kLanes) {
    const int lanes = end - first < kLanes ? static_cast<int>(end - first) : kLanes;
    const uint32_t seen = maybe_seen_of(s, frustum, first, lanes);
    for (int k = 0; k < lanes; ++k) {
      const int64_t i = first + k;
      Extent& extent = extents[i];
      extent.tiles = 0;
      if (!(seen >> k & 1)) continue;
      Axes<double> axes;
      Projected<double> o;
      Disc d;
      if (!stand(s, i, view, axes, o, d)) continue;
      const Reach reach = reach_of(d, view);
      extent.span = span, extent.record = record;
      PixelRange pixels;
      if (!place(d, reach, view, pixels, extent, sink)) {
        extent.tiles = 0;
        continue;
      }
      fill_record(s, i, view, axes, o, d, reach, pixels, records[record]);
      extent.depth = records[record].z;
      span += extent.rows, ++record;
    }
  }
}

void project_backward(const View& view, const SurfelArrays& s, const Extent* extents, const uint32_t* first_entry,
                      const float* entries, int64_t begin, int64_t end, const room2dgs::SurfelGradients& out,
                      room2dgs::CameraGradient* camera) {
  room2dgs::CameraGradient total = {};
  for (int64_t i = begin; i < end; ++i) {
    const uint32_t count = extents[i].tiles;
    if (count) surfel_backward(view, s, i, entries + static_cast<int64_t>(first_entry[i]) * kGradients, count, out, total);
    else zero_gradients(out, i, 3 * s.sh_count);
  }
  *camera = total;
}

}  // namespace

void set_blend(room2dgs::Kernels& k);
void set_blend_backward(room2dgs::Kernels& k);

room2dgs::Kernels raster_kernels() {
  room2dgs::Kernels k{};
  set_blend(k), set_blend_backward(k);
  k.project = &project;
  k.project_backward = &project_backward;
  return k;
}

}  // namespace R2_ISA
