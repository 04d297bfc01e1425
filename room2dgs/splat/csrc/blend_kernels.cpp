// Blending over one tile, forward: splat by splat, eight pixels of a row at a time, the pixels' state in the first-level
// cache.
#include "tile_hits.h"

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

struct alignas(32) ForwardTile {
  float T[kTilePixels], covered[kTilePixels];  // kept apart: 1 - T has few digits where little is covered
  float red[kTilePixels], green[kTilePixels], blue[kTilePixels], depth[kTilePixels];
  float median[kTilePixels];
  int32_t last[kTilePixels], median_item[kTilePixels];
  float nx[kTilePixels], ny[kTilePixels], nz[kTilePixels];
  float distortion[kTilePixels], first_z[kTilePixels], m1[kTilePixels], m2[kTilePixels];
};

template <bool kNormal, bool kDistortion>
void blend_tile(const BlendArgs& a, const Images& out, int64_t tile, int64_t* pairs) {
  const int x = static_cast<int>(tile % a.tiles_x) * kTile, y = static_cast<int>(tile / a.tiles_x) * kTile;
  const int columns = a.width - x < kTile ? a.width - x : kTile, height = a.height - y < kTile ? a.height - y : kTile;
  ForwardTile s;
  for (int v = 0; v < kVectors; ++v) {
    const int p = first_pixel_of(v);
    const f8 column = iota() + static_cast<float>((v >> 4) * kLanes);
    // pixels beyond the image are finished before they start
    const i8 inside = (column < static_cast<float>(columns)) & splat_i((v & 15) < height ? -1 : 0);
    store(s.T + p, masked(inside, splat(1.0f)));
    const f8 zero = splat(0);
    store(s.red + p, zero), store(s.green + p, zero), store(s.blue + p, zero);
    store(s.covered + p, zero), store(s.depth + p, zero), store(s.median + p, zero);
    store_i(s.last + p, splat_i(0)), store_i(s.median_item + p, splat_i(-1));
    if (kNormal) store(s.nx + p, zero), store(s.ny + p, zero), store(s.nz + p, zero);
    if (kDistortion) store(s.distortion + p, zero), store(s.first_z + p, zero), store(s.m1 + p, zero), store(s.m2 + p, zero);
  }
  const Item* items = a.items + a.tile_begin[tile];
  const int count = static_cast<int>(a.tile_begin[tile + 1] - a.tile_begin[tile]);
  uint32_t alive = (1u << height) - 1;  // a bit a vector
  if (columns > kLanes) alive |= alive << 16;
  int64_t evaluated = 0;
  f8 raw_of[kVectors], z_of[kVectors];

  for (int j = 0; j < count && alive; ++j) {
    if (j + kPrefetch < count) prefetch(a.records + items[j + kPrefetch].record);
    const Record& r = a.records[items[j].record];
    const InTile t = in_tile(r, x, y, alive);
    if (pairs) evaluated += kLanes * __builtin_popcount(t.reach);
    for_vectors(t.reach, [&](int k, int v) {
      const Hit<f8> h = hit_at(r, t, v);
      raw_of[k] = h.raw, z_of[k] = h.z;
    });
    for_vectors(t.reach, [&](int k, int v) {
      const int q = first_pixel_of(v);
      const f8 raw = raw_of[k], z = z_of[k], T = load(s.T + q);
      const i8 keep = (raw >= kAlphaMin) & (T >= kTransmittanceMin);
      const f8 alpha = alpha_of(raw, keep);
      const f8 weight = T * alpha, after = T * (1.0f - alpha);
      store(s.T + q, after);
      const f8 in_front = load(s.covered + q);
      store(s.covered + q, in_front + weight);
      store(s.red + q, fma(weight, splat(r.color[0]), load(s.red + q)));
      store(s.green + q, fma(weight, splat(r.color[1]), load(s.green + q)));
      store(s.blue + q, fma(weight, splat(r.color[2]), load(s.blue + q)));
      store(s.depth + q, fma(weight, z, load(s.depth + q)));
      store_i(s.last + q, select(keep, splat_i(j + 1), load_i(s.last + q)));
      const i8 crossing = (T > 0.5f) & (after <= 0.5f);
      if (kNormal) {
        store(s.nx + q, fma(weight, splat(r.normal[0]), load(s.nx + q)));
        store(s.ny + q, fma(weight, splat(r.normal[1]), load(s.ny + q)));
        store(s.nz + q, fma(weight, splat(r.normal[2]), load(s.nz + q)));
      }
      if (kDistortion) {
        f8 first = load(s.first_z + q);
        first = select(keep & (first == 0.0f), z, first);
        store(s.first_z + q, first);
        const f8 mu = masked(keep, shifted_depth(z, first));
        const f8 m1 = load(s.m1 + q), m2 = load(s.m2 + q), wmu = weight * mu;
        // about those in front
        store(s.distortion + q, fma(weight, vmax(spread(mu, in_front, m1, m2), splat(0)), load(s.distortion + q)));
        store(s.m1 + q, m1 + wmu);
        store(s.m2 + q, fma(wmu, mu, m2));
      }
      if (any(crossing)) {
        store(s.median + q, select(crossing, z, load(s.median + q)));
        store_i(s.median_item + q, select(crossing, splat_i(j), load_i(s.median_item + q)));
      }
    });
    if ((j & 7) == 7) {  // which vectors still let light through
      for (uint32_t left = alive; left; left &= left - 1) {
        const int v = __builtin_ctz(left);
        if (!any(load(s.T + first_pixel_of(v)) >= kTransmittanceMin)) alive &= ~(1u << v);
      }
    }
  }
  if (pairs) *pairs = evaluated;

  const int64_t base = tile * kTilePixels;
  for (int v = 0; v < kVectors; ++v) {
    const int p = v * kLanes;
    store(a.state.transmittance + base + p, load(s.T + p));
    store_i(a.state.last + base + p, load_i(s.last + p));
    store_i(a.state.median + base + p, load_i(s.median_item + p));
    if (kDistortion) {
      store(a.state.first_z + base + p, load(s.first_z + p));
      store(a.state.m1 + base + p, load(s.m1 + p));
      store(a.state.m2 + base + p, load(s.m2 + p));
    }
  }
  if (columns == kTile) {
    for (int row = 0; row < height; ++row)
      for (int column = 0; column < kTile; column += kLanes) {
        const int p = row * kTile + column;
        const int64_t q = static_cast<int64_t>(y + row) * a.width + x + column;
        const f8 T = load(s.T + p), covered = load(s.covered + p);
        store_triples(out.color + 3 * q, load(s.red + p) + T * a.background[0], load(s.green + p) + T * a.background[1],
                      load(s.blue + p) + T * a.background[2]);
        store(out.alpha + q, covered);
        store(out.depth + q, masked(covered > 0.0f, load(s.depth + p) / covered));
        store(out.median + q, load(s.median + p));
        if (kNormal) store_triples(out.normal + 3 * q, load(s.nx + p), load(s.ny + p), load(s.nz + p));
        if (kDistortion) store(out.distortion + q, load(s.distortion + p));
      }
    return;
  }
  for (int row = 0; row < height; ++row) {
    const int64_t first = static_cast<int64_t>(y + row) * a.width + x;
    for (int column = 0; column < columns; ++column) {
      const int p = row * kTile + column;
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

void blend(const BlendArgs& a, const Images& out, int64_t tile) {
  if (out.distortion) return blend_tile<true, true>(a, out, tile, nullptr);
  if (out.normal) return blend_tile<true, false>(a, out, tile, nullptr);
  blend_tile<false, false>(a, out, tile, nullptr);
}

int64_t count_pairs(const BlendArgs& a, const Images& out, int64_t tile) {
  int64_t pairs = 0;
  blend_tile<true, false>(a, out, tile, &pairs);
  return pairs;
}

}  // namespace

void set_blend(room2dgs::Kernels& k) { k.blend = &blend, k.count_pairs = &count_pairs; }

}  // namespace R2_ISA
