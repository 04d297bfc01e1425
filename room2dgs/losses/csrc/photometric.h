// The photometric loss, one strip of rows at a time.
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

// Everything that a strip reads and writes. Images are (height, width, 3), so a row is `row_floats` = 3 width floats.
struct RgbLossJob {
  const float* rendered;
  const float* target;
  const float* zeros;   // a black row, for rows outside the image
  float* gradient;      // d loss / d rendered, or null when only the value is wanted
  double* row_l1;       // one sum of |rendered - target| for each row
  double* row_dssim;    // one sum of 1 - SSIM for each row
  int64_t height;
  int64_t row_floats;
  int64_t strip_rows;
  float l1_scale;       // factor of sign(rendered - target) in the gradient
  float dssim_scale;    // factor of d(1 - SSIM)/d rendered in the gradient
  float* scratch;       // rgb_loss_scratch(row_floats) floats for each worker
};

// Filter rows hold whole vectors, with a margin of 16 floats on both sides: 5 pixels of 3 channels, rounded up.
static inline int64_t rgb_loss_stride(int64_t row_floats) { return (row_floats + 15) / 16 * 16 + 32; }
// Two rows of four images filtered along y, one row of three maps, a ring of twelve rows of three filtered maps.
static inline int64_t rgb_loss_scratch(int64_t row_floats) {
  return (2 * 4 + 3 + 12 * 3) * rgb_loss_stride(row_floats);
}

}  // namespace room2dgs

#define R2_PHOTOMETRIC_KERNELS(isa)                                                \
  namespace isa {                                                                  \
  void rgb_loss_strip(const room2dgs::RgbLossJob& job, int64_t strip, int worker); \
  }
R2_EACH_ISA(R2_PHOTOMETRIC_KERNELS)
#undef R2_PHOTOMETRIC_KERNELS
