// See completion.h. A vector holds the same number of four images, which share nothing but the order of elimination.
#include "completion.h"

#include <algorithm>
#include <cstring>

#include "simd.h"

namespace R2_ISA {

using room2dgs::CompletionJob;
using room2dgs::Dissection;
using room2dgs::Front;
using room2dgs::FrontEntry;
using room2dgs::kCompletionLanes;
using room2dgs::kCompletionPanel;

namespace {

typedef double d4 __attribute__((vector_size(32)));

R2_INLINE d4 all(double x) { return d4{x, x, x, x}; }
R2_INLINE d4 fma(d4 a, d4 b, d4 c) {
#if defined(__AVX2__) && defined(__FMA__)
  return _mm256_fmadd_pd(a, b, c);
#else
  return a * b + c;
#endif
}

// Rows and columns of a front from `row` and `column` on: adds sum over the panel of scaled[row] * front[column].
template <int kRows, int kColumns>
R2_INLINE void tile(d4* front, int64_t stride, const d4* scaled, int64_t row, int64_t column, int64_t first, int64_t count) {
  d4 sum[kRows][kColumns];
  for (int i = 0; i < kRows; ++i)
    for (int j = 0; j < kColumns; ++j) sum[i][j] = front[(row + i) * stride + column + j];
  for (int64_t k = 0; k < count; ++k) {
    d4 a[kRows], b[kColumns];
    for (int i = 0; i < kRows; ++i) a[i] = scaled[(row + i) * kCompletionPanel + k];
    for (int j = 0; j < kColumns; ++j) b[j] = front[(column + j) * stride + first + k];
    for (int i = 0; i < kRows; ++i)
      for (int j = 0; j < kColumns; ++j) sum[i][j] = fma(a[i], b[j], sum[i][j]);
  }
  for (int i = 0; i < kRows; ++i)
    for (int j = 0; j < kColumns; ++j) front[(row + i) * stride + column + j] = sum[i][j];
}

template <int kRows>
void tiles(d4* front, int64_t stride, const d4* scaled, int64_t row, int64_t columns, int64_t first, int64_t count) {
  int64_t column = first + count;
  for (; column + 3 <= columns; column += 3) tile<kRows, 3>(front, stride, scaled, row, column, first, count);
  for (; column < columns; ++column) tile<kRows, 1>(front, stride, scaled, row, column, first, count);
}

// Eliminates the first `own` of `size` pixels. Row `size` is the right-hand side. What stays in the columns of the
// eliminated ones is the matrix as it was met, not divided by its diagonal; the diagonal is inverted.
void eliminate(d4* front, int64_t own, int64_t size, d4* scaled) {
  const int64_t rows = size + 1, stride = rows;
  for (int64_t first = 0; first < own; first += kCompletionPanel) {
    const int64_t count = std::min(kCompletionPanel, own - first), last = first + count;
    for (int64_t k = first; k < last; ++k) {
      const d4 inverse = front[k * stride + k] = 1.0 / front[k * stride + k];
      for (int64_t row = k + 1; row < rows; ++row) {
        const d4 minus = -front[row * stride + k] * inverse;
        scaled[row * kCompletionPanel + k - first] = minus;
        for (int64_t column = k + 1; column < std::min(last, row + 1); ++column)
          front[row * stride + column] = fma(minus, front[column * stride + k], front[row * stride + column]);
      }
    }
    // The upper half is not read: a tile may spill into it.
    int64_t row = last;
    for (; row + 3 <= rows; row += 3) tiles<3>(front, stride, scaled, row, std::min(row + 3, size), first, count);
    for (; row < rows; ++row) tiles<1>(front, stride, scaled, row, std::min(row + 1, size), first, count);
  }
}

// (A tied to neighbours, one value a pixel) = target.
struct System {
  const d4 *diagonal, *right, *down, *target;  // right, down: minus the tie to the next pixel
  R2_INLINE d4 entry(const FrontEntry& one) const {
    const d4* of[] = {diagonal, right, down};
    return of[one.kind][one.pixel];
  }
};

void solve(const Dissection& order, const System& system, d4* kept, d4* stack, d4* scaled, d4* result) {
  d4* top = stack;       // above what the fronts have left over
  d4* keep = kept;
  for (const Front& one : order.fronts) {
    const int64_t rows = one.size + 1;
    d4* front = top;
    std::memset(static_cast<void*>(front), 0, sizeof(d4) * rows * rows);
    for (const FrontEntry& entry : one.entries) front[entry.row * rows + entry.column] = system.entry(entry);
    for (int64_t k = 0; k < one.own; ++k) front[one.size * rows + k] = system.target[one.pixels[k]];
    d4* bottom = top;
    for (int child = one.children - 1; child >= 0; --child) {
      const auto& places = one.places[child];
      const int64_t count = static_cast<int64_t>(places.size());
      bottom -= (count + 1) * count;
      const d4* left = bottom;
      for (int64_t i = 0; i < count; ++i)
        for (int64_t j = 0; j <= i; ++j) {
          const int64_t a = std::max(places[i], places[j]), b = std::min(places[i], places[j]);
          front[a * rows + b] += left[i * count + j];
        }
      for (int64_t j = 0; j < count; ++j) front[one.size * rows + places[j]] += left[count * count + j];
    }
    eliminate(front, one.own, one.size, scaled);
    for (int64_t row = 0; row < rows; ++row, keep += one.own)
      std::memcpy(static_cast<void*>(keep), front + row * rows, sizeof(d4) * one.own);
    const int64_t rest = one.size - one.own;
    for (int64_t row = 0; row <= rest; ++row)
      std::memmove(static_cast<void*>(bottom + row * rest), front + (row + one.own) * rows + one.own, sizeof(d4) * rest);
    top = bottom + (rest + 1) * rest;
  }
  for (auto one = order.fronts.rbegin(); one != order.fronts.rend(); ++one) {
    const int64_t own = one->own;
    keep -= own * (one->size + 1);
    for (int64_t k = own - 1; k >= 0; --k) {
      d4 value = keep[one->size * own + k];
      for (int64_t row = k + 1; row < one->size; ++row) value = fma(-keep[row * own + k], result[one->pixels[row]], value);
      result[one->pixels[k]] = value * keep[k * own + k];
    }
  }
}

R2_INLINE d4 share(d4 residual, double width) {
  const d4 off = residual / width;
  return 1.0 / fma(off, off, all(1.0));
}

}  // namespace

void complete_images(const CompletionJob& job, int64_t first, double* scratch) {
  const Dissection& order = *job.order;
  const int64_t height = order.height, width = order.width, count = height * width;
  d4* at = reinterpret_cast<d4*>(scratch);
  const auto take = [&](int64_t numbers) { return at += numbers, at - numbers; };
  d4 *distance = take(count), *anchor = take(count), *prior = take(count), *right = take(count), *down = take(count);
  d4 *step_right = take(count), *step_down = take(count);
  d4 *diagonal = take(count), *target = take(count), *pull_right = take(count), *pull_down = take(count);
  d4 *result = take(count), *kept = take(order.kept), *stack = take(order.stack), *scaled = take((order.widest + 1) * kCompletionPanel);
  int64_t image[kCompletionLanes];  // the last ones again where there are fewer
  for (int lane = 0; lane < kCompletionLanes; ++lane) image[lane] = std::min(first + lane, job.images - 1);
  const auto gather = [&](d4* to, const double* from, int64_t rows, int64_t columns) {
    for (int64_t row = 0; row < rows; ++row)
      for (int64_t column = 0; column < columns; ++column)
        for (int lane = 0; lane < kCompletionLanes; ++lane)
          to[row * width + column][lane] = from[(image[lane] * rows + row) * columns + column];
  };
  gather(distance, job.distance, height, width);
  gather(anchor, job.anchor, height, width);
  gather(prior, job.prior, height, width);
  gather(right, job.right, height, width - 1);
  gather(down, job.down, height - 1, width);
  gather(step_right, job.step_right, height, width - 1);
  gather(step_down, job.step_down, height - 1, width);
  for (int64_t step = 0; step < job.reweightings; ++step) {
    for (int64_t row = 0; row < height; ++row)
      for (int64_t column = 0; column < width; ++column) {
        const int64_t k = row * width + column;
        const d4 r = step ? result[k] : all(0.0);
        const d4 sure = step ? anchor[k] * share(r - distance[k], job.anchor_width) : anchor[k];
        const d4 trusted = step ? prior[k] * share(r, job.anchor_width) : prior[k];
        d4 x = all(0.0), y = all(0.0);
        if (column + 1 < width) x = step ? right[k] * share(result[k + 1] - r - step_right[k], job.tie_width) : right[k];
        if (row + 1 < height) y = step ? down[k] * share(result[k + width] - r - step_down[k], job.tie_width) : down[k];
        d4 sum = sure + trusted + job.least + x + y, pull = sure * distance[k];
        if (column + 1 < width) pull -= x * step_right[k];
        if (row + 1 < height) pull -= y * step_down[k];
        if (column > 0) sum -= pull_right[k - 1], pull -= pull_right[k - 1] * step_right[k - 1];
        if (row > 0) sum -= pull_down[k - width], pull -= pull_down[k - width] * step_down[k - width];
        diagonal[k] = sum, target[k] = pull, pull_right[k] = -x, pull_down[k] = -y;
      }
    solve(order, {diagonal, pull_right, pull_down, target}, kept, stack, scaled, result);
  }
  for (int lane = 0; lane < kCompletionLanes && first + lane < job.images; ++lane)
    for (int64_t k = 0; k < count; ++k) job.result[(first + lane) * count + k] = result[k][lane];
}

}  // namespace R2_ISA
