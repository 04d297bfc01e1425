// What the stages of the rasterizer hand to one another. Plain data, the same for every instruction set.
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

constexpr int kTile = 16;               // pixels
constexpr int kTilePixels = kTile * kTile;
constexpr int kGradients = 20;          // floats that one (surfel, tile) entry gives back; 19 used
// What they are: u, v and den each with the moments (1, dx, dy), depth, filter (dx, dy), opacity, colour, normal.
enum : int { kSumU = 0, kSumV = 3, kSumDen = 6, kSumZ = 9, kSumFilter = 10, kSumOpacity = 12, kSumColor = 13, kSumNormal = 16 };
constexpr int64_t kProjectBlock = 1024;  // surfels a task; fixed, so that results do not depend on threads

struct Camera {
  double R[9], t[3];  // camera = R world + t, row-major
  double fx, fy, cx, cy;
  double near;
  float opacity_floor;  // fainter hits are skipped
  int width, height;
  int tiles_x() const { return (width + kTile - 1) / kTile; }
  int tiles_y() const { return (height + kTile - 1) / kTile; }
  // of 3D Gaussians alone: variance of a pixel's own filter, and whether opacity makes good what it adds (gaussian.h)
  double filter_px2 = 0;
  bool compensated = false;
};

// Parameters of all surfels, or 3D Gaussians, whose scales are three: contiguous float32, see splat/types.py.
struct SurfelArrays {
  int64_t count;
  const float *centers, *rotations, *scales, *opacities, *sh;
  int sh_count;
};
struct SurfelGradients {
  float *centers, *rotations, *scales, *opacities, *sh, *center_px;
};

// Of one visible surfel, or of several.
template <class F>
struct RecordNumbers {
  F cx, cy, cx_rest, cy_rest;  // projected centre, and what its rounding to float left
  F z;
  F aux, auy, avx, avy, bx, by;
  F den_max;  // hits nearer than the near plane have a larger `den`
  F log2_opacity;
  F color[3], normal[3];
  // which pixels of a row it can reach: those of an ellipse and those of the filter's circle, a little enlarged;
  // a disc that crosses the near plane has no ellipse (`half_width` < 0) and takes its box
  F ellipse_x, ellipse_y, inverse_half_height, shear, half_width, margin, filter2;
};

// One visible surfel, ready for blending.
struct Record : RecordNumbers<float> {
  int16_t x0, x1, y0, y1;  // pixels that it can reach, inclusive
};

// Tiles [x0, x1) of one tile row that a surfel reaches.
struct Span {
  uint16_t x0, x1;
};
// Where a surfel goes; `tiles` is 0 when it is not seen.
struct Extent {
  float depth;
  uint32_t tiles;
  uint32_t span;    // index into its block's spans
  uint32_t record;  // visible surfels of a block lie side by side
  uint16_t row, rows;
};

// An element of a tile's list. Entries are numbered surfel by surfel, so that a surfel's gradients lie side by side.
struct Item {
  uint32_t record, entry;
};

// Gives room for the spans [first, first + count) of a block, and keeps those before.
struct SpanSink {
  void* context;
  Span* (*room)(void* context, uint32_t first, uint32_t count);
};

// A pixel's state after the forward pass, tile by tile.
struct PixelState {
  float* transmittance;
  int32_t* last;    // 1 + position in the tile's list of the last surfel blended
  int32_t* median;  // position of the surfel at which the transmittance crossed a half, or -1
  float *first_z, *m1, *m2;  // shifted moments for the distortion
};

struct Images {
  float *color, *alpha, *depth, *median, *normal, *distortion;  // row-major; normal, distortion may be null
};
struct ImageGradients {
  const float *color, *alpha, *depth, *median, *normal, *distortion;  // null where nothing flows back
};

struct BlendArgs {
  const Record* records;
  const Item* items;
  const uint32_t* tile_begin;
  int width, height, tiles_x;
  float opacity_floor, background[3];
  PixelState state;
};

// Sums over surfels of the camera's gradient.
template <class T>
struct CameraGradient {
  T R[9], t[3];
  T fx, fy, cx, cy;
};

struct Kernels {
  void (*project)(const Camera&, const SurfelArrays&, int64_t begin, int64_t end, Record*, Extent*, SpanSink);
  void (*blend)(const BlendArgs&, const Images&, int64_t tile);
  int64_t (*count_pairs)(const BlendArgs&, const Images&, int64_t tile);
  void (*blend_backward)(const BlendArgs&, const Images&, const ImageGradients&, int64_t tile, float* entries);
  void (*project_backward)(const Camera&, const SurfelArrays&, const Extent*, const uint32_t* first_entry,
                           const float* entries, int64_t begin, int64_t end, const SurfelGradients&,
                           CameraGradient<double>*);
};

}  // namespace room2dgs

#define R2_RASTER_KERNELS(isa)          \
  namespace isa {                       \
  room2dgs::Kernels raster_kernels();   \
  room2dgs::Kernels gaussian_kernels(); \
  }
R2_EACH_ISA(R2_RASTER_KERNELS)
#undef R2_RASTER_KERNELS
