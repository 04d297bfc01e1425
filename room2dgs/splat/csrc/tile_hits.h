// What both directions of blending do with a record in a tile: which vectors of eight pixels it reaches, and the hits
// there. The hits of all vectors come first, in a loop without branches; what depends on the pixels' state follows.
#pragma once

#include "simd.h"  // first: pixel.h's templates see what stands before them

#include "pixel.h"
#include "raster.h"

namespace R2_ISA {

using room2dgs::kTile;
using room2dgs::kTilePixels;
using room2dgs::Record;

constexpr int kVectors = kTilePixels / kLanes;  // of a tile; two a row
constexpr int kPrefetch = 8;  // list positions ahead: records lie scattered in memory

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

// The row terms of a record for all rows of a tile.
struct alignas(32) TileRows {
  float dy[kTile], den[kTile], u[kTile], v[kTile], filter[kTile];
};
R2_INLINE TileRows tile_rows(const Record& r, float oy) {
  TileRows rows;
  for (int row = 0; row < kTile; row += kLanes) {
    const f8 dy = iota() + static_cast<float>(row) + oy;
    const RowTerms<f8> t = row_terms(r, dy);
    store(rows.dy + row, dy), store(rows.den + row, t.den), store(rows.u + row, t.u), store(rows.v + row, t.v);
    store(rows.filter + row, t.filter);
  }
  return rows;
}
R2_INLINE RowTerms<f8> terms_at(const TileRows& rows, int row) {
  return {splat(rows.den[row]), splat(rows.u[row]), splat(rows.v[row]), splat(rows.filter[row])};
}

R2_INLINE i8 load_i(const int32_t* p) {
  i8 r;
  __builtin_memcpy(&r, p, sizeof r);
  return r;
}
R2_INLINE void store_i(int32_t* p, i8 x) { __builtin_memcpy(p, &x, sizeof x); }

// A record in a tile: the offsets of its columns and rows from its projected centre, and the vectors that it reaches.
struct InTile {
  f8 dx[2];  // of the two halves of a row
  TileRows rows;
  uint32_t reach;  // a bit a vector
};
R2_INLINE InTile in_tile(const Record& r, int x, int y, uint32_t alive) {
  const f8 dx = iota() + offset(x, r.cx, r.cx_rest);
  return {{dx, dx + static_cast<float>(kLanes)}, tile_rows(r, offset(y, r.cy, r.cy_rest)), reach_of(r, x, y) & alive};
}
R2_INLINE Hit<f8> hit_at(const Record& r, const InTile& t, int v) {
  return intersect(r, t.dx[v >> 4], terms_at(t.rows, v & 15));
}

// Calls visit(k, v) for the k-th of the vectors whose bits are set.
template <class Visit>
R2_INLINE void for_vectors(uint32_t vectors, const Visit& visit) {
  for (int k = 0; vectors; ++k, vectors &= vectors - 1) visit(k, __builtin_ctz(vectors));
}

}  // namespace R2_ISA
