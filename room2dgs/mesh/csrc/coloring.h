// Faces drawn into a depth map, and what photos say of points of a surface.
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

constexpr int kBandRows = 16;      // rows of the depth map that are drawn by one task
constexpr int kPointChunk = 4096;  // points that are looked up by one task
constexpr int kBest = 5;           // views kept of each point: the best ones, and one more, from which weights count

struct DrawJob {
  const float* vertices;  // (vertices, 3), camera frame
  const int32_t* faces;   // (count, 3)
  int64_t count;
  double fx, fy, cx, cy, near;
  int64_t height, width;
  int32_t* box;   // (count, 4): first and last column and row that a face may cover; scratch
  float* depth;   // (height, width) z of the nearest face, 0 where there is none
  int32_t* face;  // (height, width) its index, -1 where there is none
};

struct LookJob {
  const float *points, *normals;  // (count, 3), world
  const float* spacing;           // (count) metres between a point and its neighbours: finer detail is averaged
  int64_t count;
  const float* depth;  // (rows, columns) of the surface, 0 where nothing is
  int64_t rows, columns;
  const uint8_t* photo;  // (height, width, 3)
  const uint8_t* soft;   // (soft_height, soft_width, 3), the same photo, blurred and smaller
  const uint8_t* usable; // (height, width), 0 where the photo may not be used; null: everywhere
  int64_t height, width, soft_height, soft_width;
  double fx, fy, cx, cy;        // of the photo
  double cam_from_world[12];    // 3 x 4
  float gain[3];                // how much brighter the photo is than the others
  float sharpness;              // factor of its quality
  float softness_px;            // of `soft`, in the photo's pixels
  float* quality;               // (count, kBest), falling; 0 = no view
  uint8_t *sharp, *low;         // (count, kBest, 3), of `photo` and `soft`, levelled by the gain
};

struct BlendJob {
  const float* quality;
  const uint8_t *sharp, *low;  // as in LookJob
  int64_t count;
  float* color;  // (count, 3) 0..255
  float* share;  // (count) quality of the best view; 0 = no view
};

}  // namespace room2dgs

#define R2_COLORING_KERNELS(isa)                                 \
  namespace isa {                                                \
  void bound_faces(const room2dgs::DrawJob& job, int64_t chunk); \
  void draw_band(const room2dgs::DrawJob& job, int64_t band);    \
  void look_up(const room2dgs::LookJob& job, int64_t chunk);     \
  void blend(const room2dgs::BlendJob& job, int64_t chunk);      \
  }
R2_EACH_ISA(R2_COLORING_KERNELS)
#undef R2_COLORING_KERNELS
