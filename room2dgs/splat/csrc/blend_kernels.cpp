// Blending over one tile, forward and backward: splat by splat, eight pixels of a row at a time, the pixels' state in
// the first-level cache. Both directions evaluate a hit by the same code, so they take the same branches.
#include "simd.h"  // first: pixel.h's templates see what stands before them

#include "pixel.h"
#include "raster.h"

namespace R2_ISA {
namespace {

using room2dgs::BlendArgs;
using room2dgs::ImageGradients;
using room2dgs::Images;
using room2dgs::Item;
using room2dgs::kGradients;
using room2dgs::kTile;
using room2dgs::kTilePixels;
using room2dgs::Record;

constexpr int kVectors = kTilePixels / kLanes;  // of a tile; two a row
constexpr int kPrefetch = 8;  // list positions ahead: records lie scattered in memory

template <int n>
struct Count {
  static constexpr int value = n;
};
using One = Count<1>;
using Two = Count<2>;

// A record spans two cache lines.
R2_INLINE void prefetch(const Record* r) {
  __builtin_prefetch(r);
  __builtin_prefetch(reinterpret_cast<const char*>(r) + sizeof(Record) - 1);
}

// A tile's vectors are numbered by half and row: v = 16 * half + row.
R2_INLINE int first_pixel_of(int v) { return (v & 15) * kTile + (v >> 4) * kLanes; }

// A bit for every vector of the tile that a record can reach.
R2_INLINE uint32_t reach_of(const Record& r, int x, int y) {
  if (r.half_width < 0) {
    const int row0 = r.y0 > y ? r.y0 - y : 0, row1 = r.y1 < y + kTile - 1 ? r.y1 - y : kTile - 1;
    const uint32_t rows = row0 > row1 ? 0 : ((2u << row1) - 1) & ~((1u << row0) - 1);
    return (r.x0 < x + kLanes ? rows : 0) | (r.x1 >= x + kLanes ? rows << 16 : 0);
  }
  uint32_t reach = 0;
  for (int part = 0; part < 2; ++part) {
    const Columns<f8> c = columns_of<f8>(r, x, iota() + static_cast<float>(y + kLanes * part) + 0.5f);
    const uint32_t first = bits((c.left <= 7.0f) & (c.right >= 0.0f)), second = bits((c.left <= 15.0f) & (c.right >= 8.0f));
    reach |= (first | second << 16) << (kLanes * part);
  }
  return reach;
}

// Vectors are worked on two at a time, so that their latencies overlap.
struct Group {
  int v[2], count;
};
template <class Visit>
R2_INLINE void for_groups(uint32_t vectors, const Visit& visit) {
  while (vectors) {
    Group g;
    g.v[0] = g.v[1] = __builtin_ctz(vectors);
    g.count = 1;
    vectors &= vectors - 1;
    if (vectors) {
      g.v[1] = __builtin_ctz(vectors);
      g.count = 2;
      vectors &= vectors - 1;
    }
    visit(g);
  }
}

R2_INLINE i8 load_i(const int32_t* p) {
  i8 r;
  __builtin_memcpy(&r, p, sizeof r);
  return r;
}
R2_INLINE void store_i(int32_t* p, i8 x) { __builtin_memcpy(p, &x, sizeof x); }

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
  const int columns = a.width - x < kTile ? a.width - x : kTile, rows = a.height - y < kTile ? a.height - y : kTile;
  ForwardTile s;
  for (int v = 0; v < kVectors; ++v) {
    const int p = first_pixel_of(v);
    const f8 column = iota() + static_cast<float>((v >> 4) * kLanes);
    // pixels beyond the image are finished before they start
    const i8 inside = (column < static_cast<float>(columns)) & splat_i((v & 15) < rows ? -1 : 0);
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
  uint32_t alive = (1u << rows) - 1;  // a bit a vector
  if (columns > kLanes) alive |= alive << 16;
  int64_t evaluated = 0;

  for (int j = 0; j < count && alive; ++j) {
    if (j + kPrefetch < count) prefetch(a.records + items[j + kPrefetch].record);
    const Record& r = a.records[items[j].record];
    const float ox = offset(x, r.cx, r.cx_rest), oy = offset(y, r.cy, r.cy_rest);
    const f8 x0 = iota() + ox;
    auto step = [&](auto lanes, const Group& g) __attribute__((always_inline)) {
      constexpr int kCount = decltype(lanes)::value;
      Hit<f8> h[kCount];
      i8 keep[kCount];
      int p[kCount];
      f8 T[kCount];
      for (int k = 0; k < kCount; ++k) {
        p[k] = first_pixel_of(g.v[k]);
        h[k] = intersect(r, x0 + static_cast<float>((g.v[k] >> 4) * kLanes), oy + static_cast<float>(g.v[k] & 15));
        T[k] = load(s.T + p[k]);
        keep[k] = (h[k].raw >= kAlphaMin) & (T[k] >= kTransmittanceMin);
      }
      if (!any(kCount == 2 ? keep[0] | keep[kCount - 1] : keep[0])) return;
      i8 crossing[kCount];
      for (int k = 0; k < kCount; ++k) {
        const int q = p[k];
        const f8 alpha = alpha_of(h[k], keep[k]);
        const f8 weight = T[k] * alpha, after = T[k] * (1.0f - alpha);
        store(s.T + q, after);
        const f8 in_front = load(s.covered + q);
        store(s.covered + q, in_front + weight);
        store(s.red + q, fma(weight, splat(r.color[0]), load(s.red + q)));
        store(s.green + q, fma(weight, splat(r.color[1]), load(s.green + q)));
        store(s.blue + q, fma(weight, splat(r.color[2]), load(s.blue + q)));
        store(s.depth + q, fma(weight, h[k].z, load(s.depth + q)));
        store_i(s.last + q, select(keep[k], splat_i(j + 1), load_i(s.last + q)));
        crossing[k] = (T[k] > 0.5f) & (after <= 0.5f);
        if (kNormal) {
          store(s.nx + q, fma(weight, splat(r.normal[0]), load(s.nx + q)));
          store(s.ny + q, fma(weight, splat(r.normal[1]), load(s.ny + q)));
          store(s.nz + q, fma(weight, splat(r.normal[2]), load(s.nz + q)));
        }
        if (kDistortion) {
          f8 first = load(s.first_z + q);
          first = select(keep[k] & (first == 0.0f), h[k].z, first);
          store(s.first_z + q, first);
          const f8 mu = masked(keep[k], shifted_depth(h[k].z, first));
          const f8 m1 = load(s.m1 + q), m2 = load(s.m2 + q), wmu = weight * mu;
          // about those in front
          store(s.distortion + q, fma(weight, vmax(spread(mu, in_front, m1, m2), splat(0)), load(s.distortion + q)));
          store(s.m1 + q, m1 + wmu);
          store(s.m2 + q, fma(wmu, mu, m2));
        }
      }
      if (any(kCount == 2 ? crossing[0] | crossing[kCount - 1] : crossing[0])) {
        for (int k = 0; k < kCount; ++k) {
          store(s.median + p[k], select(crossing[k], h[k].z, load(s.median + p[k])));
          store_i(s.median_item + p[k], select(crossing[k], splat_i(j), load_i(s.median_item + p[k])));
        }
      }
    };
    const uint32_t reach = reach_of(r, x, y) & alive;
    if (pairs) evaluated += kLanes * __builtin_popcount(reach);
    for_groups(reach, [&](const Group& g) __attribute__((always_inline)) {
      if (g.count == 2) step(Two(), g);
      else step(One(), g);
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
  for (int row = 0; row < rows; ++row) {
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

struct alignas(32) BackwardTile {
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
  for (int row = 0; row < kTile; ++row) {
    for (int column = 0; column < kTile; ++column) {
      const int p = row * kTile + column;
      const bool inside = x + column < a.width && y + row < a.height;
      const int64_t q = inside ? static_cast<int64_t>(y + row) * a.width + x + column : 0;
      const float on = inside ? 1.0f : 0.0f;
      const float covered = inside ? out.alpha[q] : 0.0f;
      s.T[p] = a.state.transmittance[base + p];
      s.last[p] = inside ? a.state.last[base + p] : 0;
      s.median_item[p] = a.state.median[base + p];
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
        s.first_z[p] = a.state.first_z[base + p];
        s.m1[p] = a.state.m1[base + p], s.m2[p] = a.state.m2[base + p];
        s.covered[p] = covered;
      }
      const int v = (column / kLanes) * kTile + row;
      if (column % kLanes == 0) s.vector_last[v] = 0;
      if (s.last[p] > s.vector_last[v]) s.vector_last[v] = s.last[p];
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

template <bool kNormal, bool kDistortion>
void blend_tile_backward(const BlendArgs& a, const Images& out, const ImageGradients& g, int64_t tile, float* entries) {
  const int x = static_cast<int>(tile % a.tiles_x) * kTile, y = static_cast<int>(tile / a.tiles_x) * kTile;
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
  for (int j = tile_last - 1; j >= 0; --j) {
    if (j >= kPrefetch) prefetch(a.records + items[j - kPrefetch].record);
    const Record& r = a.records[items[j].record];
    const float ox = offset(x, r.cx, r.cx_rest), oy = offset(y, r.cy, r.cy_rest);
    const f8 x0 = iota() + ox;
    // in the order of raster.h's kSum...
    f8 sum[24];
    for (f8& v : sum) v = splat(0);
    auto step = [&](auto lanes, const Group& group) __attribute__((always_inline)) {
      constexpr int kCount = decltype(lanes)::value;
      Hit<f8> h[kCount];
      i8 keep[kCount];
      int p[kCount];
      f8 dx[kCount];
      float dy[kCount];
      for (int k = 0; k < kCount; ++k) {
        p[k] = first_pixel_of(group.v[k]);
        dx[k] = x0 + static_cast<float>((group.v[k] >> 4) * kLanes);
        dy[k] = oy + static_cast<float>(group.v[k] & 15);
        h[k] = intersect(r, dx[k], dy[k]);
        keep[k] = (h[k].raw >= kAlphaMin) & (load_i(s.last + p[k]) > j);
      }
      if (!any(kCount == 2 ? keep[0] | keep[kCount - 1] : keep[0])) return;
      for (int k = 0; k < kCount; ++k) {
        const int q = p[k];
        const Hit<f8>& hit = h[k];
        const f8 alpha = alpha_of(hit, keep[k]);
        const f8 T = load(s.T + q) / (1.0f - alpha);
        store(s.T + q, T);
        const f8 weight = T * alpha;
        const f8 red = load(s.red + q), green = load(s.green + q), blue = load(s.blue + q), depth = load(s.depth + q);
        // what this hit is worth, per unit of its weight
        f8 worth = fma(red, splat(r.color[0]),
                       fma(green, splat(r.color[1]), fma(blue, splat(r.color[2]), load(s.alpha + q))));
        worth = fma(depth, hit.z - load(s.expected + q), worth);
        f8 gz = weight * depth;
        if (kNormal) {
          const f8 nx = load(s.nx + q), ny = load(s.ny + q), nz = load(s.nz + q);
          worth = fma(nx, splat(r.normal[0]), fma(ny, splat(r.normal[1]), fma(nz, splat(r.normal[2]), worth)));
          sum[16] = fma(weight, nx, sum[16]), sum[17] = fma(weight, ny, sum[17]), sum[18] = fma(weight, nz, sum[18]);
        }
        if (kDistortion) {
          const f8 gd = load(s.distortion + q), m1 = load(s.m1 + q), A = load(s.covered + q);
          const f8 mu = masked(keep[k], shifted_depth(hit.z, load(s.first_z + q)));
          worth = fma(gd, spread(mu, A, m1, load(s.m2 + q)), worth);
          gz = fma(2.0f * kDistortionScale * gd * weight, fma(mu, A, -m1) / (hit.z * hit.z), gz);
        }
        const f8 behind = load(s.behind + q);
        const f8 galpha = T * (worth - behind);
        store(s.behind + q, fma(alpha, worth - behind, behind));
        gz += masked(load_i(s.median_item + q) == splat_i(j), load(s.median + q));
        const HitGradient<f8> grad = hit_backward(hit, keep[k], galpha, gz);
        const f8 vdy = splat(dy[k]);
        sum[0] += grad.u, sum[1] = fma(grad.u, dx[k], sum[1]), sum[2] = fma(grad.u, vdy, sum[2]);
        sum[3] += grad.v, sum[4] = fma(grad.v, dx[k], sum[4]), sum[5] = fma(grad.v, vdy, sum[5]);
        sum[6] += grad.den, sum[7] = fma(grad.den, dx[k], sum[7]), sum[8] = fma(grad.den, vdy, sum[8]);
        sum[9] += grad.z;
        sum[10] = fma(grad.filter, dx[k], sum[10]), sum[11] = fma(grad.filter, vdy, sum[11]);
        sum[12] += grad.opacity;
        sum[13] = fma(weight, red, sum[13]), sum[14] = fma(weight, green, sum[14]), sum[15] = fma(weight, blue, sum[15]);
      }
    };
    while (reached < kVectors && j < by_last[reached] >> 5) alive |= 1u << (by_last[reached++] & 31);
    for_groups(reach_of(r, x, y) & alive, [&](const Group& group) __attribute__((always_inline)) {
      if (group.count == 2) step(Two(), group);
      else step(One(), group);
    });
    float* entry = entries + static_cast<int64_t>(items[j].entry) * kGradients;
    store(entry, hsum8(sum)), store(entry + 8, hsum8(sum + 8));
    if (kNormal) {
      const f8 normal = hsum8(sum + 16);
      for (int k = 0; k < 4; ++k) entry[16 + k] = normal[k];
    } else {
      for (int k = 0; k < 4; ++k) entry[16 + k] = 0;
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

void blend_backward(const BlendArgs& a, const Images& out, const ImageGradients& g, int64_t tile, float* entries) {
  if (g.distortion) {
    if (g.normal) return blend_tile_backward<true, true>(a, out, g, tile, entries);
    return blend_tile_backward<false, true>(a, out, g, tile, entries);
  }
  if (g.normal) return blend_tile_backward<true, false>(a, out, g, tile, entries);
  blend_tile_backward<false, false>(a, out, g, tile, entries);
}

}  // namespace

room2dgs::Kernels blend_kernels() {
  room2dgs::Kernels k{};
  k.blend = &blend;
  k.count_pairs = &count_pairs;
  k.blend_backward = &blend_backward;
  return k;
}

}  // namespace R2_ISA
