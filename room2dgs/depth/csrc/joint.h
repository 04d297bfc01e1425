// The energy of the joint depth optimisation at random samples, and its gradient (depth/joint/reference.py has it in
// plain torch).
//
// Each view's depth map is multiplied by exp of a grid of knots, bilinear over the image. A sample's residual depends on
// the grid at up to three places, and a place on four knots. Samples are computed eight at a time and kept; then what
// they do to the knots is added up in the order of the samples, whoever computed them.
#pragma once

#include <cstdint>

#include "isa.h"
#include "scalar.h"

namespace room2dgs {

enum JointTerm { kJointPoints, kJointViews, kJointSlopes, kJointPlanes, kJointAxes, kJointTerms };

// Rows of the draws that a term's samples are made of.
constexpr int kJointFirstDraw[kJointTerms + 1] = {
    0,   // points: view, point
    2,   // views: pair, row, column
    5,   // slopes: view, row, column, 1 if the segment goes down and 0 if right
    9,   // planes: view, row, column of the middle, steps down and right to one end
    14,  // axes: view, row, column of the first point, steps down and right to the second
    19,
};
// Places in the grids that a term's residuals depend on, counted through all terms.
constexpr int kJointFirstPlace[kJointTerms + 1] = {0, 1, 3, 5, 8, 11};

// Rows of the table of the views, pixels of the whole image.
enum JointView { kJointCentre = 0, kJointPerFocal = 2, kJointPerSize = 4, kJointViewRows = 6 };
// Rows of the table of the pairs: 3 x 4 from the first view's camera frame to the second's, focal length and principal
// point of the second, and its size.
enum JointPair { kJointThere = 0, kJointFocal = 12, kJointPrincipal = 14, kJointSize = 16, kJointPairRows = 18 };

constexpr int64_t kJointChunk = 512;  // samples of one task
constexpr int kJointSlopeStep = 4;  // samples between the ends of a slope

struct JointJob {
  int64_t views, height, width;  // the maps, subsampled
  int64_t step;                  // pixels of the whole image between samples
  const float *depth, *depth_confidence, *normal_confidence;  // (views, height, width); depth 0 = invalid
  const float *normal, *region_normal;                        // (views, height, width, 3), camera frame
  const int32_t* region;                                      // (views, height, width), 0 = textured
  const float* view_table;                                    // (kJointViewRows, views)
  int64_t pairs;
  const int32_t* pair_views;  // (2, pairs)
  const float* pair_table;    // (kJointPairRows, pairs)
  int64_t point_count;
  const float* point_place;  // (point_count, 2) as shares of the image
  const float* point_off;    // (point_count) log of the map's depth over the point's
  int64_t axis_count;
  const float* axes;  // (axis_count, 3, views): the room's axes in the views' frames
  int64_t rows, columns;
  const float* grid;       // (views, rows, columns) log-scale at the knots
  const float* stiffness;  // likewise: weight of the regularisers
  int64_t samples;         // of each term
  const int32_t* draws;    // (19, samples)
  float weight[kJointTerms], width_of[kJointTerms];  // of the robust means; a residual as large as this costs 1/2
  float smoothness, magnitude;
  float* gradient;  // (views, rows, columns)
  // What the samples leave: by place in the grids, `stride` samples each.
  int64_t stride;
  int32_t* knot;              // first of the four
  float *right, *lower;       // shares of the knots to the right and below
  float* pull;                // the cost's derivative with respect to the log-scale there
};

// Sums over the samples of one task.
struct JointSum {
  double cost;
  int64_t count, strange;  // samples with a residual; draws of things that are not there
};

// A step of Adam (Kingma and Ba 2015).
constexpr double kAdamFirst = 0.9, kAdamSecond = 0.999;
struct AdamStep {
  float* values;
  const float* gradient;
  float *first, *second;  // moments
  float size, per_root;   // the rate and the second moment's root, freed of the moments' start at 0
};

// Floats of scratch that `joint_regulariser` needs.
R2_HD int64_t joint_row(int64_t columns) { return (columns + 7) / 8 * 8 + 16; }
R2_HD int64_t joint_scratch(int64_t rows, int64_t columns) { return 5 * (rows + 2) * joint_row(columns); }

}  // namespace room2dgs

#define R2_JOINT_KERNELS(isa)                                                                                     \
  namespace isa {                                                                                                 \
  /* Samples of a term from `first` on, kJointChunk of them or up to the last. */                                 \
  room2dgs::JointSum joint_samples(const room2dgs::JointJob& job, int term, int64_t first);                       \
  /* Adds the pulls of a term's samples, each times `scale`, to the gradient. */                                  \
  void joint_scatter(const room2dgs::JointJob& job, int term, float scale);                                       \
  /* Energy of one view's grid, weighted; its gradient is added. */                                               \
  double joint_regulariser(const room2dgs::JointJob& job, int64_t view, float* scratch);                          \
  /* Numbers from `first` up to `last`. */                                                                        \
  void adam_step(const room2dgs::AdamStep& step, int64_t first, int64_t last);                                    \
  }
R2_EACH_ISA(R2_JOINT_KERNELS)
#undef R2_JOINT_KERNELS
