// Blending over one tile, backward: from the last surfel to the first, by the hits of the forward pass. `Kind` as in
// blend_forward.h.
#pragma once

#include "tile_hits.h"

namespace R2_ISA {
namespace {

using room2dgs::BlendArgs;
using room2dgs::ImageGradients;
using room2dgs::Images;
using room2dgs::Item;
using room2dgs::kGradients;

struct alignas(64) BackwardTile {
  float T[kTilePixels], behind[kTilePixels];  // `behind`: what the rest of the ray is worth, per unit of light
  float red[kTilePixels], green[kTilePixels], blue[kTilePixels], alpha[kTilePixels];
  float depth[kTilePixels], expected[kTilePixels];  // gradient of sum w z, and the expected depth itself
  float median[kTilePixels];
  int32_t last[kTilePixels], median_item[kTilePixels];
  float nx[kTilePixels], ny[kTilePixels], nz[kTilePixels];
  float distortion[kTilePixels], first_z[kTilePixels], m1[kTilePixels], m2[kTilePixels], covered[kTilePixels];
  int32_t vector_last[kVectors];
};

template <bool kNormal, bool kDistortion>
int load_gradients(const BlendArgs& a, const Images& out, const ImageGradients& g, int64_t tile, BackwardTile& s) {
  const int x = static_cast<int>(tile % a.tiles_x) * kTile, y = static_cast<int>(tile / a.tiles_x) * kTile;
  const int64_t base = tile * kTilePixels;
  int tile_last = 0;
  for (int32_t& last : s.vector_last) last = 0;
  for (int row = 0; row < kTile; ++row) {
    for (int column = 0; column < kTile; ++column) {
      const int p = pixel_at(row, column);
      const int64_t k = base + row * kTile + column;
      const bool inside = x + column < a.width && y + row < a.height;
      const int64_t q = inside ? static_cast<int64_t>(y + row) * a.width + x + column : 0;
      const float on = inside ? 1.0f : 0.0f;
      const float covered = inside ? out.alpha[q] : 0.0f;
      s.T[p] = a.state.transmittance[k];
      s.last[p] = inside ? a.state.last[k] : 0;
      s.median_item[p] = a.state.median[k];
      s.red[p] = g.color ? on * g.color[3 * q] : 0.0f;
      s.green[p] = g.color ? on * g.color[3 * q + 1] : 0.0f;
      s.blue[p] = g.color ? on * g.color[3 * q + 2] : 0.0f;
      // expected = sum w z / covered, so w is worth (z - expected) / covered
      s.depth[p] = g.depth && covered > 0 ? on * g.depth[q] / covered : 0.0f;
      s.expected[p] = inside ? out.depth[q] : 0.0f;
      s.alpha[p] = g.alpha ? on * g.alpha[q] : 0.0f;
      s.median[p] = g.median ? on * g.median[q] : 0.0f;
      s.behind[p] = a.background[0] * s.red[p] + a.background[1] * s.green[p] + a.background[2] * s.blue[p];
      if (kNormal) s.nx[p] = on * g.normal[3 * q], s.ny[p] = on * g.normal[3 * q + 1], s.nz[p] = on * g.normal[3 * q + 2];
      if (kDistortion) {
        s.distortion[p] = on * g.distortion[q];
        s.first_z[p] = a.state.first_z[k];
        s.m1[p] = a.state.m1[k], s.m2[p] = a.state.m2[k];
        s.covered[p] = covered;
      }
      int32_t& vector_last = s.vector_last[p / kWide];
      if (s.last[p] > vector_last) vector_last = s.last[p];
      if (s.last[p] > tile_last) tile_last = s.last[p];
    }
  }
  return tile_last;
}

// Lane sums of eight vectors, one a lane, in one fixed order.
R2_INLINE f8 hsum8(const f8* v) {
  f8 r;
#if defined(__AVX2__)
  const __m256 ab = _mm256_hadd_ps(v[0], v[1]), cd = _mm256_hadd_ps(v[2], v[3]);
  const __m256 ef = _mm256_hadd_ps(v[4], v[5]), gh = _mm256_hadd_ps(v[6], v[7]);
  const __m256 abcd = _mm256_hadd_ps(ab, cd), efgh = _mm256_hadd_ps(ef, gh);
  r = _mm256_add_ps(_mm256_permute2f128_ps(abcd, efgh, 0x20), _mm256_permute2f128_ps(abcd, efgh, 0x31));
#else
  for (int k = 0; k < 8; ++k)
    r[k] = ((v[k][0] + v[k][1]) + (v[k][2] + v[k][3])) + ((v[k][4] + v[k][5]) + (v[k][6] + v[k][7]));
#endif
  return r;
}

// Likewise of eight vectors of as many lanes as there are.
R2_INLINE f8 sums_of_eight(const fw* v) {
#if defined(__AVX512F__)
  f8 halves[8];
  for (int k = 0; k < 8; ++k) halves[k] = _mm512_castps512_ps256(v[k]) + _mm512_extractf32x8_ps(v[k], 1);
  return hsum8(halves);
#else
  return hsum8(v);
#endif
}

template <class Kind, bool kNormal, bool kDistortion>
void blend_tile_backward(const BlendArgs& a, const Images& out, const ImageGradients& g, int64_t tile, float* entries) {
  const int x = static_cast<int>(tile % a.tiles_x) * kTile, y = static_cast<int>(tile / a.tiles_x) * kTile;
  const auto all = [](float value) { return Lanes<fw>::all(value); };
  const float floor = a.opacity_floor;
  BackwardTile s;
  const int tile_last = load_gradients<kNormal, kDistortion>(a, out, g, tile, s);
  const Item* items = a.items + a.tile_begin[tile];
  const int count = static_cast<int>(a.tile_begin[tile + 1] - a.tile_begin[tile]);
  for (int j = count - 1; j >= tile_last; --j) {  // never blended here
    float* entry = entries + static_cast<int64_t>(items[j].entry) * kGradients;
    for (int k = 0; k < kGradients; ++k) entry[k] = 0;
  }
  // vectors come to life, from the back, where their last surfel was blended
  int by_last[kVectors];
  for (int v = 0; v < kVectors; ++v) {
    int at = v;
    const int key = s.vector_last[v] << 5 | v;
    for (; at > 0 && by_last[at - 1] < key; --at) by_last[at] = by_last[at - 1];
    by_last[at] = key;
  }
  uint32_t alive = 0;
  int reached = 0;
  Hit<fw> hits[kVectors];
  HitGradient<fw> grads[kVectors];
  fw weights[kVectors];
  for (int j = tile_last - 1; j >= 0; --j) {
    if (j >= kPrefetch) prefetch(a.records + items[j - kPrefetch].record);
    const Record& r = a.records[items[j].record];
    while (reached < kVectors && j < by_last[reached] >> 5) alive |= 1u << (by_last[reached++] & 31);
    const InTile t = in_tile(r, x, y, alive);
    for_vectors(t.reach, [&](int k, int v) { hits[k] = hit_at<Kind>(r, t, v); });
    for_vectors(t.reach, [&](int k, int v) {
      const int q = kWide * v;
      const Hit<fw>& hit = hits[k];
      const iw keep = (hit.raw >= floor) & (load_wide(s.last + q) > j);
      const fw alpha = alpha_of(hit.raw, keep);
      const fw T = load_wide(s.T + q) / (1.0f - alpha);
      store_wide(s.T + q, T);
      const fw weight = T * alpha;
      const fw depth = load_wide(s.depth + q);
      // what this hit is worth, per unit of its weight
      fw worth = fma(load_wide(s.red + q), all(r.color[0]),
                     fma(load_wide(s.green + q), all(r.color[1]), fma(load_wide(s.blue + q), all(r.color[2]), load_wide(s.alpha + q))));
      worth = fma(depth, hit.z - load_wide(s.expected + q), worth);
      fw gz = weight * depth;
      if (kNormal) {
        worth = fma(load_wide(s.nx + q), all(r.normal[0]),
                    fma(load_wide(s.ny + q), all(r.normal[1]), fma(load_wide(s.nz + q), all(r.normal[2]), worth)));
      }
      if (kDistortion) {
        const fw gd = load_wide(s.distortion + q), m1 = load_wide(s.m1 + q), A = load_wide(s.covered + q);
        const fw mu = masked(keep, shifted_depth(hit.z, load_wide(s.first_z + q)));
        worth = fma(gd, spread(mu, A, m1, load_wide(s.m2 + q)), worth);
        gz = fma(2.0f * kDistortionScale * gd * weight, fma(mu, A, -m1) / (hit.z * hit.z), gz);
      }
      const fw behind = load_wide(s.behind + q);
      const fw galpha = T * (worth - behind);
      store_wide(s.behind + q, fma(alpha, worth - behind, behind));
      gz += masked(load_wide(s.median_item + q) == all_wide(j), load_wide(s.median + q));
      weights[k] = weight;
      grads[k] = Kind::backward(hit, keep, galpha, gz);
    });
    // in the order of raster.h's kSum..., each sum over the vectors in their order; nine or ten at a time fit the registers
    fw sum[24];
    for (fw& one : sum) one = all(0);
    for_vectors(t.reach, [&](int k, int v) {
      const HitGradient<fw>& grad = grads[k];
      const fw dx = t.dx(v), dy = t.dy(v);
      sum[0] += grad.u, sum[1] = fma(grad.u, dx, sum[1]), sum[2] = fma(grad.u, dy, sum[2]);
      sum[3] += grad.v, sum[4] = fma(grad.v, dx, sum[4]), sum[5] = fma(grad.v, dy, sum[5]);
      sum[6] += grad.den, sum[7] = fma(grad.den, dx, sum[7]), sum[8] = fma(grad.den, dy, sum[8]);
    });
    for_vectors(t.reach, [&](int k, int v) {
      const int q = kWide * v;
      const HitGradient<fw>& grad = grads[k];
      const fw weight = weights[k];
      sum[9] += grad.z;
      sum[10] = fma(grad.filter, t.dx(v), sum[10]), sum[11] = fma(grad.filter, t.dy(v), sum[11]);
      sum[12] += grad.opacity;
      sum[13] = fma(weight, load_wide(s.red + q), sum[13]), sum[14] = fma(weight, load_wide(s.green + q), sum[14]);
      sum[15] = fma(weight, load_wide(s.blue + q), sum[15]);
      if (kNormal) {
        sum[16] = fma(weight, load_wide(s.nx + q), sum[16]), sum[17] = fma(weight, load_wide(s.ny + q), sum[17]);
        sum[18] = fma(weight, load_wide(s.nz + q), sum[18]);
      }
    });
    float* entry = entries + static_cast<int64_t>(items[j].entry) * kGradients;
    store(entry, sums_of_eight(sum)), store(entry + 8, sums_of_eight(sum + 8));
    if (kNormal) {
      const f8 normal = sums_of_eight(sum + 16);
      for (int k = 0; k < 4; ++k) entry[16 + k] = normal[k];
    } else {
      for (int k = 0; k < 4; ++k) entry[16 + k] = 0;
    }
  }
}

template <class Kind>
void blend_backward(const BlendArgs& a, const Images& out, const ImageGradients& g, int64_t tile, float* entries) {
  if (g.distortion) {
    if (g.normal) return blend_tile_backward<Kind, true, true>(a, out, g, tile, entries);
    return blend_tile_backward<Kind, false, true>(a, out, g, tile, entries);
  }
  if (g.normal) return blend_tile_backward<Kind, true, false>(a, out, g, tile, entries);
  blend_tile_backward<Kind, false, false>(a, out, g, tile, entries);
}

}  // namespace
}  // namespace R2_ISA
