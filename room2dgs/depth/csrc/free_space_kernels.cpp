// See free_space.h.
#include "free_space.h"

#include <cmath>
#include <cstring>

#include "simd.h"

namespace R2_ISA {

using room2dgs::Cells;
using room2dgs::RaysJob;
using room2dgs::SeenThroughJob;

namespace {

constexpr uint8_t kPassed = 1, kMet = 2;

// Index of the cell, -1 outside. Comparisons are written so that NaN fails them.
R2_INLINE int64_t cell_at(const Cells& cells, double x, double y, double z) {
  if (!(x >= 0 && x < double(cells.shape[0]) && y >= 0 && y < double(cells.shape[1]) && z >= 0 &&
        z < double(cells.shape[2])))
    return -1;
  return (int64_t(x) * cells.shape[1] + int64_t(y)) * cells.shape[2] + int64_t(z);
}

void mark(const RaysJob& job, const double* centre, const double* end, uint8_t* marks) {
  const Cells& cells = job.cells;
  const int64_t met = cell_at(cells, (end[0] - cells.corner[0]) / cells.side, (end[1] - cells.corner[1]) / cells.side,
                              (end[2] - cells.corner[2]) / cells.side);
  if (met >= 0) marks[met] |= kMet;
  const double x = (end[0] - centre[0]) / cells.side, y = (end[1] - centre[1]) / cells.side,
               z = (end[2] - centre[2]) / cells.side;
  const double length = std::sqrt(x * x + y * y + z * z);
  if (!(length > 0 && std::isfinite(length))) return;
  const double dx = x / length, dy = y / length, dz = z / length;
  const double sx = (centre[0] - cells.corner[0]) / cells.side, sy = (centre[1] - cells.corner[1]) / cells.side,
               sz = (centre[2] - cells.corner[2]) / cells.side;
  // What lies beyond the box is not walked through: a ray may end a kilometre away.
  const double most = double(cells.shape[0] + cells.shape[1] + cells.shape[2]);
  const double from = job.from / cells.side, stop = job.up_to * length;
  for (int64_t k = 0;; ++k) {
    const double step = from + double(k);
    if (!(stop > step) || step > most) break;
    const int64_t cell = cell_at(cells, sx + step * dx, sy + step * dy, sz + step * dz);
    if (cell >= 0) marks[cell] |= kPassed;
  }
}

}  // namespace

void count_rays(const RaysJob& job, int64_t view, uint8_t* marks) {
  const double* centre = job.centre + 3 * view;
  for (int64_t k = job.first[view]; k < job.first[view + 1]; ++k) mark(job, centre, job.ends + 3 * k, marks);
  const int64_t count = job.cells.shape[0] * job.cells.shape[1] * job.cells.shape[2];
  for (int64_t first = 0; first < count; first += 8) {
    const int64_t last = first + 8 < count ? first + 8 : count;
    uint64_t eight = 0;
    std::memcpy(&eight, marks + first, size_t(last - first));
    if (!eight) continue;
    for (int64_t cell = first; cell < last; ++cell) {
      // Other views are counted by other threads; sums of integers do not depend on their order.
      if (marks[cell] & kPassed) __atomic_fetch_add(job.through + cell, 1, __ATOMIC_RELAXED);
      if (marks[cell] & kMet) __atomic_fetch_add(job.ended + cell, 1, __ATOMIC_RELAXED);
      marks[cell] = 0;
    }
  }
}

void seen_through(const SeenThroughJob& job, int64_t first, int64_t last) {
  const Cells& cells = job.cells;
  for (int64_t k = first; k < last; ++k) {
    const double* p = job.xyz + 3 * k;
    const int64_t cell = cell_at(cells, (p[0] - cells.corner[0]) / cells.side, (p[1] - cells.corner[1]) / cells.side,
                                 (p[2] - cells.corner[2]) / cells.side);
    const double ended = cell < 0 ? 0 : job.ended[cell];
    const double through = cell < 0 ? 0 : job.through[cell];
    const double against = through > ended ? through - ended : 0;
    job.share[k] = against / (against + job.doubt + ended);
  }
}

}  // namespace R2_ISA
