#include <cmath>
#include <vector>

#include "arrays.h"
#include "fusion.h"
#include "parallel.h"

namespace room2dgs {
namespace {

void fuse_depth(const Input& block, const Input& row, const Output& distance, const Output& weight, const Output& views,
                const Output& color, const Input& depth, const Input& trust, const Input& photo,
                const Input& pixel_from_voxel, double truncation) {
  Arguments check;
  const int64_t blocks = lengths("block", block, 2)[0], rows = lengths("distance", distance, 2)[0];
  const auto size = lengths("depth", depth, 2);
  FusionJob job;
  job.block = check.input<int32_t>("block", block, {blocks, 3});
  job.row = check.input<int64_t>("row", row, {blocks});
  job.distance = check.output<float>("distance", distance, {rows, kBlockVoxels});
  job.weight = check.output<float>("weight", weight, {rows, kBlockVoxels});
  job.views = check.output<float>("views", views, {rows, kBlockVoxels});
  job.color = check.output<float>("color", color, {rows, 3 * kBlockVoxels});
  job.height = size[0], job.width = size[1];
  job.depth = check.input<float>("depth", depth, {size[0], size[1]});
  job.trust = check.input<float>("trust", trust, {size[0], size[1]});
  job.photo = check.input<float>("photo", photo, {size[0], size[1], 3});
  const double* matrix = check.input<double>("pixel_from_voxel", pixel_from_voxel, {3, 4});
  for (int k = 0; k < 12; ++k) job.pixel_from_voxel[k] = matrix[k];
  require(std::isfinite(truncation) && truncation > 0, "truncation is not above 0");
  job.truncation = static_cast<float>(truncation);
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

}  // namespace

void bind_mesh(nb::module_& m) {
  m.def("fuse_depth", &fuse_depth, as_is("block"), as_is("row"), as_is("distance"), as_is("weight"), as_is("views"),
        as_is("color"), as_is("depth"), as_is("trust"), as_is("photo"), as_is("pixel_from_voxel"),
        nb::arg("truncation"), "Takes one depth map into the blocks of a signed distance volume.");
}

}  // namespace room2dgs
