// In which order the unknowns of a grid are eliminated, where each is tied to its four neighbours: nested dissection
// (George 1973). A line of pixels cuts a rectangle in two; both halves are eliminated before it, and know nothing of
// each other. The order depends on the size of the grid alone: it is made once for all images of that size.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace room2dgs {

// An entry of the matrix that a front takes over: the row and column in the front, the later one first, and which entry.
struct FrontEntry {
  enum Kind : int32_t { kDiagonal, kRight, kDown };
  int32_t row, column;
  Kind kind;
  int32_t pixel;  // its diagonal, or the tie to the pixel right of it or below it
};

// A dense symmetric matrix: the pixels that are eliminated in it, then those around them that come later.
struct Front {
  int64_t own, size;               // pixels eliminated, and all
  std::vector<int32_t> pixels;     // (size)
  std::vector<FrontEntry> entries;
  int children;                    // 0..2, which came just before
  std::vector<int32_t> places[2];  // where each one's left-over pixels are in this front
};

struct Dissection {
  int64_t height, width;
  std::vector<Front> fronts;  // children before parents, the last one has no pixels left over
  int64_t kept;               // numbers of all fronts that the way back needs
  int64_t stack;              // numbers that are on the stack at most
  int64_t widest;             // pixels of the largest front
};

constexpr int64_t kSquare = 9;  // rectangles of so many pixels are not cut any more

class Dissecting {
 public:
  explicit Dissecting(Dissection& result) : result_(result), place_(result.height * result.width, -1) {
    cut(0, result.height, 0, result.width, 0);
  }

 private:
  Dissection& result_;
  std::vector<int32_t> place_;  // in the front at hand

  // Pixels around a rectangle that lie in the grid.
  std::vector<int32_t> around(int64_t top, int64_t bottom, int64_t left, int64_t right) const {
    std::vector<int32_t> found;
    const int64_t w = result_.width;
    const auto add = [&](int64_t row, int64_t column) { found.push_back(static_cast<int32_t>(row * w + column)); };
    if (top > 0) for (int64_t c = left; c < right; ++c) add(top - 1, c);
    if (bottom < result_.height) for (int64_t c = left; c < right; ++c) add(bottom, c);
    if (left > 0) for (int64_t r = top; r < bottom; ++r) add(r, left - 1);
    if (right < w) for (int64_t r = top; r < bottom; ++r) add(r, right);
    return found;
  }

  // Gives what is left over, with `base` numbers on the stack below it.
  std::vector<int32_t> cut(int64_t top, int64_t bottom, int64_t left, int64_t right, int64_t base) {
    const int64_t rows = bottom - top, columns = right - left;
    Front front = {};
    std::vector<int32_t> left_over[2];
    int64_t below = base;
    const auto child = [&](int64_t t, int64_t b, int64_t l, int64_t r) {
      if (t >= b || l >= r) return;
      left_over[front.children] = cut(t, b, l, r, below);
      below += numbers_left(left_over[front.children].size());
      ++front.children;
    };
    const auto own = [&](int64_t t, int64_t b, int64_t l, int64_t r) {
      for (int64_t row = t; row < b; ++row)
        for (int64_t column = l; column < r; ++column)
          front.pixels.push_back(static_cast<int32_t>(row * result_.width + column));
    };
    if (rows * columns <= kSquare) {
      own(top, bottom, left, right);
    } else if (rows > columns) {
      const int64_t middle = top + rows / 2;
      child(top, middle, left, right), child(middle + 1, bottom, left, right), own(middle, middle + 1, left, right);
    } else {
      const int64_t middle = left + columns / 2;
      child(top, bottom, left, middle), child(top, bottom, middle + 1, right), own(top, bottom, middle, middle + 1);
    }
    front.own = static_cast<int64_t>(front.pixels.size());
    std::vector<int32_t> rest = around(top, bottom, left, right);
    front.pixels.insert(front.pixels.end(), rest.begin(), rest.end());
    front.size = static_cast<int64_t>(front.pixels.size());
    for (int64_t k = 0; k < front.size; ++k) place_[front.pixels[k]] = static_cast<int32_t>(k);
    for (int k = 0; k < front.children; ++k)
      for (int32_t pixel : left_over[k]) front.places[k].push_back(place_[pixel]);
    enter(front);
    for (int32_t pixel : front.pixels) place_[pixel] = -1;
    result_.kept += front.own * (front.size + 1);
    result_.widest = std::max(result_.widest, front.size);
    result_.stack = std::max(result_.stack, below + (front.size + 1) * (front.size + 1));
    result_.fronts.push_back(std::move(front));
    return rest;
  }

  // The pixels' diagonals, and their ties to pixels that are not eliminated yet.
  void enter(Front& front) const {
    const int64_t w = result_.width;
    const auto tie = [&](int32_t k, int32_t pixel, FrontEntry::Kind kind, int64_t other) {
      const int32_t there = place_[other];
      if (there < 0 || (there < front.own && there < k)) return;  // gone, or entered from there
      front.entries.push_back({there, k, kind, pixel});
    };
    for (int32_t k = 0; k < front.own; ++k) {
      const int32_t pixel = front.pixels[k];
      const int64_t row = pixel / w, column = pixel % w;
      front.entries.push_back({k, k, FrontEntry::kDiagonal, pixel});
      if (column + 1 < w) tie(k, pixel, FrontEntry::kRight, pixel + 1);
      if (row + 1 < result_.height) tie(k, pixel, FrontEntry::kDown, pixel + w);
      if (column > 0) tie(k, pixel - 1, FrontEntry::kRight, pixel - 1);
      if (row > 0) tie(k, static_cast<int32_t>(pixel - w), FrontEntry::kDown, pixel - w);
    }
  }

 public:
  // Of a front's left-over pixels: their matrix, and a row for the right-hand side.
  static int64_t numbers_left(int64_t pixels) { return (pixels + 1) * pixels; }
};

inline Dissection dissection(int64_t height, int64_t width) {
  Dissection result = {height, width, {}, 0, 0, 0};
  Dissecting cut(result);
  return result;
}

}  // namespace room2dgs
