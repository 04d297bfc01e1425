// Blending over one tile, forward: splat by splat, a vector of pixels at a time, the pixels' state in the first-level cache.
// `Kind` says what a splat's pixels are: SurfelHits (pixel.h) or GaussianHits (gaussian_pixel.h).
#pragma once

#include "tile_hits.h"

#include <type_traits>

namespace R2_ISA {
namespace {

using room2dgs::BlendArgs;
using room2dgs::Images;
using room2dgs::Item;

// x0 y0 z0 x1 y1 z1 ... of eight pixels.
R2_INLINE void store_triples(float* p, f8 x, f8 y, f8 z) {
  const f8 first = R2_PICKED(x, y, 0, 8, 0, 1, 9, 0, 2, 10), second = R2_PICKED(x, y, 0, 3, 11, 0, 4, 12, 0, 5);
  const f8 third = R2_PICKED(x, y, 13, 0, 6, 14, 0, 7, 15, 0);
  store(p, R2_PICKED(first, z, 0, 1, 8, 3, 4, 9, 6, 7));
  store(p + 8, R2_PICKED(second, z, 10, 1, 2, 11, 4, 5, 12, 7));
  store(p + 16, R2_PICKED(third, z, 0, 13, 2, 3, 14, 5, 6, 15));
}

struct alignas(64) ForwardTile {
  float T[kTilePixels], covered[kTilePixels];  // kept apart: 1 - T has few digits where little is covered
  float red[kTilePixels], green[kTilePixels], blue[kTilePixels], depth[kTilePixels];
  float median[kTilePixels];
  int32_t last[kTilePixels], median_item[kTilePixels];
  float nx[kTilePixels], ny[kTilePixels], nz[kTilePixels];
  float distortion[kTilePixels], first_z[kTilePixels], m1[kTilePixels], m2[kTilePixels];
};

template <class Kind, bool kNormal, bool kDistortion>
void blend_tile(const BlendArgs& a, const Images& out, int64_t tile, int64_t* pairs) {
  const int x = static_cast<int>(tile % a.tiles_x) * kTile, y = static_cast<int>(tile / a.tiles_x) * kTile;
  const int columns = a.width - x < kTile ? a.width - x : kTile, height = a.height - y < kTile ? a.height - y : kTile;
  const auto all = [](float value) { return Lanes<fw>::all(value); };
  const float floor = a.opacity_floor;
  ForwardTile s;
  uint32_t alive = 0;  // a bit a vector
  for (int v = 0; v < kVectors; ++v) {
    const int p = kWide * v, first_column = first_column_of(v), first_row = first_row_of(v);
    const fw column = column_of_lane() + static_cast<float>(first_column), row = row_of_lane() + static_cast<float>(first_row);
    // pixels beyond the image are finished before they start
    const iw inside = (column < static_cast<float>(columns)) & (row < static_cast<float>(height));
    if (first_column < columns && first_row < height) alive |= 1u << v;
    store_wide(s.T + p, masked(inside, all(1.0f)));
    const fw zero = all(0);
    store_wide(s.red + p, zero), store_wide(s.green + p, zero), store_wide(s.blue + p, zero);
    store_wide(s.covered + p, zero), store_wide(s.depth + p, zero), store_wide(s.median + p, zero);
    store_wide(s.last + p, all_wide(0)), store_wide(s.median_item + p, all_wide(-1));
    if (kNormal) store_wide(s.nx + p, zero), store_wide(s.ny + p, zero), store_wide(s.nz + p, zero);
    if (kDistortion) {
      store_wide(s.distortion + p, zero), store_wide(s.first_z + p, zero);
      store_wide(s.m1 + p, zero), store_wide(s.m2 + p, zero);
    }
  }
  const Item* items = a.items + a.tile_begin[tile];
  const int count = static_cast<int>(a.tile_begin[tile + 1] - a.tile_begin[tile]);
  int64_t evaluated = 0;
  fw raw_of[kVectors], z_of[kVectors];

  for (int j = 0; j < count && alive; ++j) {
    if (j + kPrefetch < count) prefetch(a.records + items[j + kPrefetch].record);
    const Record& r = a.records[items[j].record];
    const InTile t = in_tile(r, x, y, alive);
    if (pairs) evaluated += kWide * __builtin_popcount(t.reach);
    for_vectors(t.reach, [&](int k, int v) {
      const Hit<fw> h = hit_at<Kind>(r, t, v);
      raw_of[k] = h.raw, z_of[k] = h.z;
    });
    for_vectors(t.reach, [&](int k, int v) {
      const int q = kWide * v;
      const fw raw = raw_of[k], z = z_of[k], T = load_wide(s.T + q);
      const iw keep = (raw >= floor) & (T >= kTransmittanceMin);
      const fw alpha = alpha_of(raw, keep);
      const fw weight = T * alpha, after = T * (1.0f - alpha);
      store_wide(s.T + q, after);
      const fw in_front = load_wide(s.covered + q);
      store_wide(s.covered + q, in_front + weight);
      store_wide(s.red + q, fma(weight, all(r.color[0]), load_wide(s.red + q)));
      store_wide(s.green + q, fma(weight, all(r.color[1]), load_wide(s.green + q)));
      store_wide(s.blue + q, fma(weight, all(r.color[2]), load_wide(s.blue + q)));
      store_wide(s.depth + q, fma(weight, z, load_wide(s.depth + q)));
      store_wide(s.last + q, select(keep, all_wide(j + 1), load_wide(s.last + q)));
      const iw crossing = (T > 0.5f) & (after <= 0.5f);
      if (kNormal) {
        store_wide(s.nx + q, fma(weight, all(r.normal[0]), load_wide(s.nx + q)));
        store_wide(s.ny + q, fma(weight, all(r.normal[1]), load_wide(s.ny + q)));
        store_wide(s.nz + q, fma(weight, all(r.normal[2]), load_wide(s.nz + q)));
      }
      if (kDistortion) {
        fw first = load_wide(s.first_z + q);
        first = select(keep & (first == 0.0f), z, first);
        store_wide(s.first_z + q, first);
        const fw mu = masked(keep, shifted_depth(z, first));
        const fw m1 = load_wide(s.m1 + q), m2 = load_wide(s.m2 + q), wmu = weight * mu;
        // about those in front
        store_wide(s.distortion + q, fma(weight, vmax(spread(mu, in_front, m1, m2), all(0)), load_wide(s.distortion + q)));
        store_wide(s.m1 + q, m1 + wmu);
        store_wide(s.m2 + q, fma(wmu, mu, m2));
      }
      if (any(crossing)) {
        store_wide(s.median + q, select(crossing, z, load_wide(s.median + q)));
        store_wide(s.median_item + q, select(crossing, all_wide(j), load_wide(s.median_item + q)));
      }
    });
    if ((j & 7) == 7) {  // which vectors still let light through
      for (uint32_t left = alive; left; left &= left - 1) {
        const int v = __builtin_ctz(left);
        if (!any(load_wide(s.T + kWide * v) >= kTransmittanceMin)) alive &= ~(1u << v);
      }
    }
  }
  if (pairs) *pairs = evaluated;

  const int64_t base = tile * kTilePixels;
  for (int row = 0; row < kTile; ++row)
    for (int column = 0; column < kTile; column += kLanes) {
      const int64_t q = base + row * kTile + column;
      const auto put = [&](auto* state, const auto* pixels) {
        const auto eight = in_row<std::conditional_t<std::is_same_v<decltype(state), float*>, f8, i8>>(pixels, row, column);
        std::memcpy(state + q, &eight, sizeof eight);
      };
      put(a.state.transmittance, s.T), put(a.state.last, s.last), put(a.state.median, s.median_item);
      if (kDistortion) put(a.state.first_z, s.first_z), put(a.state.m1, s.m1), put(a.state.m2, s.m2);
    }
  if (columns == kTile) {
    for (int row = 0; row < height; ++row)
      for (int column = 0; column < kTile; column += kLanes) {
        const int64_t q = static_cast<int64_t>(y + row) * a.width + x + column;
        const auto of = [&](const float* values) { return in_row<f8>(values, row, column); };
        const f8 T = of(s.T), covered = of(s.covered);
        store_triples(out.color + 3 * q, of(s.red) + T * a.background[0], of(s.green) + T * a.background[1],
                      of(s.blue) + T * a.background[2]);
        store(out.alpha + q, covered);
        store(out.depth + q, masked(covered > 0.0f, of(s.depth) / covered));
        store(out.median + q, of(s.median));
        if (kNormal) store_triples(out.normal + 3 * q, of(s.nx), of(s.ny), of(s.nz));
        if (kDistortion) store(out.distortion + q, of(s.distortion));
      }
    return;
  }
  for (int row = 0; row < height; ++row) {
    const int64_t first = static_cast<int64_t>(y + row) * a.width + x;
    for (int column = 0; column < columns; ++column) {
      const int p = pixel_at(row, column);
      const int64_t q = first + column;
      const float T = s.T[p], covered = s.covered[p];
      out.color[3 * q] = s.red[p] + T * a.background[0];
      out.color[3 * q + 1] = s.green[p] + T * a.background[1];
      out.color[3 * q + 2] = s.blue[p] + T * a.background[2];
      out.alpha[q] = covered;
      out.depth[q] = covered > 0 ? s.depth[p] / covered : 0.0f;
      out.median[q] = s.median[p];
      if (kNormal) out.normal[3 * q] = s.nx[p], out.normal[3 * q + 1] = s.ny[p], out.normal[3 * q + 2] = s.nz[p];
      if (kDistortion) out.distortion[q] = s.distortion[p];
    }
  }
}

template <class Kind>
void blend(const BlendArgs& a, const Images& out, int64_t tile) {
  if (out.distortion) return blend_tile<Kind, true, true>(a, out, tile, nullptr);
  if (out.normal) return blend_tile<Kind, true, false>(a, out, tile, nullptr);
  blend_tile<Kind, false, false>(a, out, tile, nullptr);
}

template <class Kind>
int64_t count_pairs(const BlendArgs& a, const Images& out, int64_t tile) {
  int64_t pairs = 0;
  blend_tile<Kind, true, false>(a, out, tile, &pairs);
  return pairs;
}

}  // namespace
}  // namespace R2_ISA
