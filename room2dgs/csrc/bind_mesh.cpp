#include <vector>

#include "fusion_arguments.h"
#include "parallel.h"

namespace room2dgs {
namespace {

void fuse_depth(const Input& block, const Input& row, const Output& distance, const Output& weight, const Output& views,
                const Output& color, const Input& depth, const Input& normal, const Input& trust,
                const Input& photo, const Input& pixel_from_voxel, double voxel, double truncation) {
  Arguments check;
  const FusionJob job = fusion_job(check, check, block, row, distance, weight, views, color, depth, normal, trust,
                                   photo, pixel_from_voxel, voxel, truncation);
  const int64_t blocks = lengths("block", block, 2)[0], rows = lengths("distance", distance, 2)[0];
  std::vector<bool> taken(rows);
  for (int64_t k = 0; k < blocks; ++k) {
    require(job.row[k] >= 0 && job.row[k] < rows, "row names a block that is not there");
    require(!taken[job.row[k]], "row names a block twice");
    taken[job.row[k]] = true;
  }
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(fuse_block);
  parallel_for(blocks, [&](int64_t index, int) { kernel(job, index); });
}

void touched_blocks(const Input& depth, const Input& normal, const Input& K, const Input& local_from_cam, double side,
                    double truncation, const Output& keys) {
  Arguments check;
  const TouchJob job = touch_job(check, check, depth, normal, K, local_from_cam, side, truncation, keys);
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(touch_row);
  parallel_for(job.height / kTouchStride, [&](int64_t row, int) { kernel(job, row); });
}

}  // namespace

void bind_mesh(nb::module_& m) {
  m.def("touched_blocks", &touched_blocks, as_is("depth"), as_is("normal"), as_is("K"), as_is("local_from_cam"),
        nb::arg("side"), nb::arg("truncation"), as_is("keys"),
        "Writes the blocks near a depth map's surface to keys, (pixels of every second row and column, 4) int64: "
        "((x + h) 2h + y + h) 2h + z + h with h = 2^20, or -1; some more than once.");
  m.def("fuse_depth", &fuse_depth, as_is("block"), as_is("row"), as_is("distance"), as_is("weight"), as_is("views"),
        as_is("color"), as_is("depth"), as_is("normal"), as_is("trust"), as_is("photo"), as_is("pixel_from_voxel"),
        nb::arg("voxel"), nb::arg("truncation"), "Takes one depth map into the blocks of a signed distance volume.");
}

}  // namespace room2dgs
