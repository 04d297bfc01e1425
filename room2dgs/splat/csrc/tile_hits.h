// What both directions of blending do with a record in a tile: which vectors of pixels it reaches, and the hits there.
// The hits of all vectors come first, in a loop without branches; what depends on the pixels' state follows.
#pragma once

#include "tile_pixels.h"  // first: pixel.h's templates see what stands before them

#include "pixel.h"

namespace R2_ISA {

using room2dgs::Record;

constexpr int kPrefetch = 8;  // list positions ahead: records lie scattered in memory

// A record spans two cache lines.
R2_INLINE void prefetch(const Record* r) {
  __builtin_prefetch(r);
  __builtin_prefetch(reinterpret_cast<const char*>(r) + sizeof(Record) - 1);
}

// Columns of the tile that a record reaches in rows [y, y + kWide) of the image.
R2_INLINE Columns<fw> columns_reached(const Record& r, int x, int y) {
  const fw row = wide_iota() + static_cast<float>(y);
  if (r.half_width >= 0) return columns_of<fw>(r, x, row + 0.5f);
  const auto all = [](float value) { return Lanes<fw>::all(value); };
  const iw rows = (row >= static_cast<float>(r.y0)) & (row <= static_cast<float>(r.y1));
  return {select(rows, all(static_cast<float>(r.x0 - x)), all(1e30f)), all(static_cast<float>(r.x1 - x))};
}

// A bit for every vector of the tile that a record can reach.
R2_INLINE uint32_t reach_of(const Record& r, int x, int y) {
  fw left[kTile / kWide], right[kTile / kWide];
  for (int k = 0; k < kTile / kWide; ++k) {
    const Columns<fw> columns = columns_reached(r, x, y + k * kWide);
    left[k] = columns.left, right[k] = columns.right;
  }
  return vectors_reached(left, right);
}

// The row terms of a record for all rows of a tile.
struct alignas(64) TileRows {
  float dy[kTile], den[kTile], u[kTile], v[kTile], filter[kTile];
};
R2_INLINE void fill_rows(const Record& r, float oy, TileRows& rows) {
  for (int row = 0; row < kTile; row += kWide) {
    const fw dy = wide_iota() + static_cast<float>(row) + oy;
    const RowTerms<fw> t = row_terms(r, dy);
    store_wide(rows.dy + row, dy), store_wide(rows.den + row, t.den), store_wide(rows.u + row, t.u);
    store_wide(rows.v + row, t.v), store_wide(rows.filter + row, t.filter);
  }
}

// A record in a tile: the offsets of its columns and rows from its projected centre, and the vectors that it reaches.
struct InTile {
  fw columns[kAcross];
  TileRows rows;
  uint32_t reach;  // a bit a vector
  R2_INLINE fw dx(int v) const { return columns[column_group_of(v)]; }
  R2_INLINE fw dy(int v) const { return of_rows(rows.dy + first_row_of(v)); }
};
R2_INLINE InTile in_tile(const Record& r, int x, int y, uint32_t alive) {
  InTile t;
  const float ox = offset(x, r.cx, r.cx_rest);
  for (int k = 0; k < kAcross; ++k) {  // rounded as block code does it, by halves of a row
    const int column = k * kColumns, half = column / kLanes * kLanes;
    t.columns[k] = (column_of_lane() + static_cast<float>(column - half) + ox) + static_cast<float>(half);
  }
  fill_rows(r, offset(y, r.cy, r.cy_rest), t.rows);
  t.reach = reach_of(r, x, y) & alive;
  return t;
}
template <class Kind>
R2_INLINE Hit<fw> hit_at(const Record& r, const InTile& t, int v) {
  const int row = first_row_of(v);
  return Kind::hit(r, t.dx(v), RowTerms<fw>{of_rows(t.rows.den + row), of_rows(t.rows.u + row), of_rows(t.rows.v + row),
                                            of_rows(t.rows.filter + row)});
}

// Calls visit(k, v) for the k-th of the vectors whose bits are set.
template <class Visit>
R2_INLINE void for_vectors(uint32_t vectors, const Visit& visit) {
  for (int k = 0; vectors; ++k, vectors &= vectors - 1) visit(k, __builtin_ctz(vectors));
}

}  // namespace R2_ISA
