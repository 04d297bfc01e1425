// How a tile's pixels lie in vectors: sixteen lanes are four rows of four columns, eight are two rows of four. A disc
// reaches fewer of these than of as many pixels of one row. Lanes go column by column, so that what depends on the row
// alone is one broadcast.
#pragma once

#include "raster.h"
#include "wide.h"

namespace R2_ISA {

using room2dgs::kTile;
using room2dgs::kTilePixels;

constexpr int kColumns = 4, kRows = kWide / kColumns;  // of a vector
constexpr int kVectors = kTilePixels / kWide, kAcross = kTile / kColumns, kDown = kTile / kRows;  // of a tile

// In memory vectors follow one another. With sixteen lanes they are numbered row by row, with eight column by column, as
// their bits come out of `vectors_reached`.
R2_INLINE int first_row_of(int v) { return kWide == 16 ? v / kAcross * kRows : v % kDown * kRows; }
R2_INLINE int column_group_of(int v) { return kWide == 16 ? v % kAcross : v / kDown; }
R2_INLINE int first_column_of(int v) { return column_group_of(v) * kColumns; }
R2_INLINE int pixel_at(int row, int column) {
  const int down = row / kRows, across = column / kColumns;
  const int v = kWide == 16 ? down * kAcross + across : across * kDown + down;
  return v * kWide + column % kColumns * kRows + row % kRows;
}

// What `kRows` rows have, at p, in every column.
R2_INLINE fw of_rows(const float* p) {
#if defined(__AVX512F__)
  return _mm512_broadcast_f32x4(_mm_loadu_ps(p));
#elif defined(__AVX2__)
  double both;
  std::memcpy(&both, p, sizeof both);
  return _mm256_castpd_ps(_mm256_set1_pd(both));
#else
  return fw{p[0], p[1], p[0], p[1], p[0], p[1], p[0], p[1]};
#endif
}
R2_INLINE fw row_of_lane() {
  constexpr float rows[] = {0, 1, 2, 3};
  return of_rows(rows);
}
R2_INLINE fw column_of_lane() { return (wide_iota() - row_of_lane()) * (1.0f / kRows); }

// Eight pixels of a row, side by side, of an array of a tile's pixels (float or int32_t).
template <class V, class T>
R2_INLINE V in_row(const T* pixels, int row, int column) {
  const auto eight = [](const T* p) {
    V x;
    std::memcpy(&x, p, sizeof x);
    return x;
  };
  const T* left = pixels + pixel_at(row / kRows * kRows, column);
  const T* right = pixels + pixel_at(row / kRows * kRows, column + kColumns);
#if defined(__AVX512F__)
  const auto two_rows = [&](const T* p) {  // of a vector's four
    const V a = eight(p), b = eight(p + 8);
    return row & 2 ? R2_PICKED(a, b, 2, 6, 10, 14, 3, 7, 11, 15) : R2_PICKED(a, b, 0, 4, 8, 12, 1, 5, 9, 13);
  };
  const V a = two_rows(left), b = two_rows(right);
  return row & 1 ? R2_PICKED(a, b, 4, 5, 6, 7, 12, 13, 14, 15) : R2_PICKED(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
#else
  const V a = eight(left), b = eight(right);
  return row & 1 ? R2_PICKED(a, b, 1, 3, 5, 7, 9, 11, 13, 15) : R2_PICKED(a, b, 0, 2, 4, 6, 8, 10, 12, 14);
#endif
}

// A bit for every vector that has a pixel between left and right of its row; these are columns, `kWide` rows a vector.
R2_INLINE uint32_t vectors_reached(const fw* left, const fw* right) {
#if defined(__AVX512F__)
  // of every four rows the least and the most, in all four lanes
  const auto folded = [](fw x, auto&& choose) {
    x = choose(x, static_cast<fw>(_mm512_permute_ps(x, 0xb1)));
    return choose(x, static_cast<fw>(_mm512_permute_ps(x, 0x4e)));
  };
  const fw least = folded(*left, [](fw a, fw b) { return vmin(a, b); });
  const fw most = folded(*right, [](fw a, fw b) { return vmax(a, b); });
  const fw column = row_of_lane() * static_cast<float>(kColumns);
  return bits((least <= column + static_cast<float>(kColumns - 1)) & (most >= column));
#else
  // of every two rows, eight pairs of them
  const auto upper = [](const fw* x) { return R2_PICKED(x[0], x[1], 0, 2, 4, 6, 8, 10, 12, 14); };
  const auto lower = [](const fw* x) { return R2_PICKED(x[0], x[1], 1, 3, 5, 7, 9, 11, 13, 15); };
  const fw least = vmin(upper(left), lower(left)), most = vmax(upper(right), lower(right));
  uint32_t reached = 0;
  for (int group = 0; group < kAcross; ++group) {
    const float column = static_cast<float>(group * kColumns);
    reached |= bits((least <= column + (kColumns - 1)) & (most >= column)) << (kDown * group);
  }
  return reached;
#endif
}

}  // namespace R2_ISA
