// PatchMatch stereo of one reference photo against its neighbours, a row of pixels at a time.
//
// A pixel's plane is (w, gx, gy): inverse depth at the pixel and its gradient over the image. A plane in space is
// linear in inverse depth, so a neighbour's plane is carried over by w - gx dx - gy dy, and where a neighbouring view
// sees pixel (x, y) is M (x, y, 1) + t w in homogeneous pixels.
//
// Pixels are kept by the colour of a checkerboard. In a row of one colour, pixel i has x = 2 i + (row + colour) % 2, so
// that eight pixels of one colour and the neighbours that they ask, all of the other colour, are contiguous.
// Pixel coordinates here count centres at integers.
#pragma once

#include <cstdint>

#include "isa.h"
#include "scalar.h"

namespace room2dgs {

constexpr int kStereoReach = 24;      // the farthest neighbour that a pixel asks, rounded up
constexpr int kStereoMargin = 24;     // replicated pixels round a packed photo
constexpr int kStereoMaxSamples = 128;
constexpr int kStereoMaxViews = 32;
constexpr int kStereoMaxBest = 8;
constexpr float kStereoWorst = 2.0f;  // cost of a plane that a view cannot judge
constexpr float kStereoMaxReprojectionPx = 3.0f;

// What is known of the neighbouring views, a table with a row of kStereoMaxViews numbers for each field: so that eight
// pixels can ask eight different views.
enum StereoField {
  kStereoThere = 0,     // 12: rows of [M | t], reference to view, homogeneous pixels
  kStereoBack = 12,     // 12: view to reference
  kStereoWidth = 24,    // of the photo, pixels
  kStereoHeight = 25,
  kStereoOffset = 26,   // int32: of its first packed pixel
  kStereoStrides = 27,  // int32: 1, and in the upper half the pixels of a packed row
  kStereoDepth = 28,    // int32: of its first inverse depth
  kStereoFields = 29,
};

// One map over all pixels of a colour, with a border so that no neighbour lies outside.
struct StereoPlane {
  float* data;  // [colour][row + kStereoReach][index + kStereoReach / 2]
};

struct StereoJob {
  int64_t width, height;
  const uint8_t* grey;  // (height + 2 margin, width + 2 margin), replicated border
  const float* table;          // [StereoField][kStereoMaxViews]
  // of all views: (height + 2 margin, width + 2 margin) words of a pixel, the one below, its right one, the one below it
  const uint32_t* quads;
  const float* inverse_depth;  // of all views: (height, width), 0 = unknown; null without geometric consistency
  int64_t words, depths;  // numbers of both
  int view_count, best;
  int samples, side, step, reach;  // side^2 samples, `step` pixels apart and up to `reach` from the centre
  int16_t dx[kStereoMaxSamples], dy[kStereoMaxSamples];
  float spatial[kStereoMaxSamples];  // log2 of the weight that the distance from the centre gives
  float grey_scale;                  // log2 of the weight is grey_scale * (difference of grey levels)^2
  float variance_floor;              // of windows, grey levels^2: blank windows correlate by chance
  float w_min, w_max, slope_limit;   // |gx|, |gy| <= slope_limit w
  float pixel_slope;                 // 1 / focal length: the gradient of a plane that recedes by its depth a radian
  float geometric_weight;            // of the forward-backward reprojection error, 1 / pixel; 0: none
  uint32_t seed;
  float *w, *gx, *gy, *cost;         // planes by colour, see `stereo_plane_size`
  int32_t* judges;                   // likewise: a bit for each view that the cost is the mean over
  const float *hint_w, *hint_gx, *hint_gy;  // likewise: a plane to try at each pixel, w = 0 where there is none; or null
};

R2_HD int64_t stereo_half(int64_t width) { return (width + 1) / 2; }
// Floats of a row of one colour: a border to both sides, and whole vectors.
R2_HD int64_t stereo_stride(int64_t width) { return (stereo_half(width) + 7) / 8 * 8 + 2 * kStereoReach; }
R2_HD int64_t stereo_rows(int64_t height) { return height + 2 * kStereoReach; }
R2_HD int64_t stereo_plane_size(int64_t width, int64_t height) {
  return 2 * stereo_rows(height) * stereo_stride(width);
}
// Where pixel `index` of a colour in a row is kept.
R2_HD int64_t stereo_at(int64_t width, int64_t height, int colour, int64_t row, int64_t index) {
  return (colour * stereo_rows(height) + row + kStereoReach) * stereo_stride(width) + kStereoReach + index;
}

// What one sweep over the pixels of a colour tries beside the neighbours' planes.
struct StereoSweep {
  int colour;
  uint32_t draw;       // number of the sweep, for its random draws
  float perturbation;  // size of random changes; 1 at the start
  bool random_depth;   // also try a depth from anywhere in the range
  bool near_only;      // of the neighbours, far ones lend no planes
  bool judges_only;    // a plane is shown to the views alone that its owner's cost is the mean over
};

}  // namespace room2dgs

#define R2_STEREO_KERNELS(isa)                                                                                   \
  namespace isa {                                                                                                \
  /* Costs of the planes as they are; w <= 0 draws one at random first. */                                       \
  void stereo_start_row(const room2dgs::StereoJob& job, int64_t row);                                            \
  void stereo_sweep_row(const room2dgs::StereoJob& job, const room2dgs::StereoSweep& sweep, int64_t row);        \
  /* Photometric cost of the planes, and variance of the windows, into (height, width) maps. */                  \
  void stereo_cost_row(const room2dgs::StereoJob& job, int64_t row, float* cost, float* variance);               \
  }
R2_EACH_ISA(R2_STEREO_KERNELS)
#undef R2_STEREO_KERNELS
