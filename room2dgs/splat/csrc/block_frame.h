// One view rendered by block code, on a GPU or, for tests, on the CPU: what RasterFrame (raster_frame.h) is to the CPU's
// own kernels. Its buffers are used again for the next view; everything that depends on numbers stays on the device but
// for two counts. A surfel stands for a 3D Gaussian too, but where a kernel takes `Kind`: SurfelKind or GaussianKind.
#pragma once

#include <cstdint>

#include "gaussian_stages.h"
#include "launch.h"
#include "raster.h"
#include "sort_scan.h"
#include "stages.h"

namespace R2_ISA {

// What the surfel kernels read of a view.
struct BlockView {
  View camera;
  Frustum frustum;
  float background[3];
};

// The tiles of a surfel that reaches few rows of them; those of taller ones are found anew when they are listed.
constexpr int kKeptRows = 7;
struct KeptRows {
  uint16_t first, count;
  room2dgs::Span spans[kKeptRows];
};

// What the host learns of a view: how many surfels and (surfel, tile) pairs it has, how many projected centres somebody
// tried to move, and the camera as it was read.
struct ViewFacts {
  uint64_t visible, entries, moved;
  double cam_from_world[16], K[9];
  float background[3];
  float unused;  // what is copied to the host is all written
};

// A view's camera, on the device; float64, and (3,) float32.
struct ViewInput {
  const double *cam_from_world, *K;
  const float* background;
  double near;
  float opacity_floor;
  int width, height;
  double filter_px2 = 0;  // as Camera has them (raster.h)
  bool compensated = false;
  int tiles_x() const { return (width + kTile - 1) / kTile; }
  int tiles_y() const { return (height + kTile - 1) / kTile; }
  int64_t tiles() const { return static_cast<int64_t>(tiles_x()) * tiles_y(); }
};

// An element of a tile's list: the surfel, whose record has its number, and its entry above.
R2_HD uint64_t item_of(uint32_t surfel, uint32_t entry) { return surfel | static_cast<uint64_t>(entry) << 32; }
R2_HD uint32_t surfel_of(uint64_t item) { return static_cast<uint32_t>(item); }
R2_HD uint32_t entry_of(uint64_t item) { return static_cast<uint32_t>(item >> 32); }

// What blending reads and leaves, on the device.
struct BlockTiles {
  const Record* records;    // of every surfel; those of hidden ones are not written
  const uint64_t* items;
  const uint32_t* begin;    // of a tile's list, and the end of the last one
  uint8_t* reach;           // of each item, a bit for each patch of its tile that it can reach
  const float* background;
  float opacity_floor;
  int width, height, tiles_x;
  room2dgs::PixelState state;  // tile by tile, by thread
};

class BlockFrame {
 public:
  explicit BlockFrame(bool gaussians) : gaussians_(gaussians) {}

  uint64_t view = 0, views = 0;  // as RasterFrame's
  bool has_normal = false, has_distortion = false;
  int device = -1;  // whose memory this is; -1: nobody's yet
  int64_t count = 0;
  ViewInput input{};
  ViewFacts facts{};

  // Draws the surfels into `out`. Leaves the camera in `facts`; gives false where it has no focal length or is not
  // finite: nothing is drawn then. `center_px`, (count, 2) or null, is looked at for numbers that are not 0.
  // Raises std::length_error where the (surfel, tile) pairs outnumber their index.
  bool forward(const Queue& queue, const ViewInput& in, const SurfelArrays& surfels, const float* center_px,
               const room2dgs::Images& out);
  // to_pose (4, 4) and to_K (3, 3); to_background (3,) or null; all float64 on the device.
  void backward(const Queue& queue, const SurfelArrays& surfels, const room2dgs::Images& out,
                const room2dgs::ImageGradients& g, const room2dgs::SurfelGradients& to, double* to_pose, double* to_K,
                double* to_background);
  int64_t bytes() const;

 private:
  // The stages of `forward`, in order.
  void project(const Queue& queue, const SurfelArrays& surfels, const float* center_px);  // block_project.cu
  void sort_by_depth(const Queue& queue);                                                 // block_lists.cu
  void list_tiles(const Queue& queue, const SurfelArrays& surfels);
  void blend(const Queue& queue, const room2dgs::Images& out);                            // block_blend.cu
  // and of `backward`
  void blend_backward(const Queue& queue, const room2dgs::Images& out, const room2dgs::ImageGradients& g);
  void background_backward(const Queue& queue, const float* g_color, double* to);
  void project_backward(const Queue& queue, const SurfelArrays& surfels, const room2dgs::SurfelGradients& to,
                        double* to_pose, double* to_K);
  BlockTiles tiles(const Queue& queue);
  // Calls launch_of(Kind{}) with what the frame draws.
  template <class LaunchOf>
  void with_kind(const LaunchOf& launch_of) const {
    if (gaussians_) launch_of(GaussianKind{});
    else launch_of(SurfelKind{});
  }

  const bool gaussians_;
  Turn turn_;
  Scratch scratch_;
  DeviceBuffer<BlockView> view_;
  DeviceBuffer<ViewFacts> facts_;
  HostCopy<ViewFacts> facts_copy_;
  DeviceBuffer<Record> records_;
  DeviceBuffer<KeptRows> rows_;
  DeviceBuffer<uint64_t> counts_;  // partial sums of ViewFacts' two
  // of each surfel: tiles, its first entry, its depth as bits; and by depth: surfel, its tiles, their place in the lists
  DeviceBuffer<uint32_t> tiles_, first_entry_, depth_, sorted_depth_, number_, order_, ordered_tiles_, place_;
  DeviceBuffer<uint32_t> tile_, sorted_tile_, tile_begin_;  // of each pair; of each tile
  DeviceBuffer<uint64_t> unsorted_items_, items_;
  DeviceBuffer<uint8_t> reach_;
  DeviceBuffer<float> transmittance_, first_z_, m1_, m2_, entry_sums_;
  DeviceBuffer<int32_t> last_, median_;
  DeviceBuffer<double> camera_parts_, background_parts_;
};

}  // namespace R2_ISA
