#include <vector>

#include "fusion_arguments.h"
#include "parallel.h"

namespace room2dgs {
namespace {

void fuse_depth(const Input& block, const Input& row, const Output& distance, const Output& weight, const Output& views,
                const Output& color, const Input& depth, const Input& trust, const Input& photo,
                const Input& pixel_from_voxel, double truncation) {
  Arguments check;
  const FusionJob job = fusion_job(check, check, block, row, distance, weight, views, color, depth, trust, photo,
                                   pixel_from_voxel, truncation);
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

}  // namespace

void bind_mesh(nb::module_& m) {
  m.def("fuse_depth", &fuse_depth, as_is("block"), as_is("row"), as_is("distance"), as_is("weight"), as_is("views"),
        as_is("color"), as_is("depth"), as_is("trust"), as_is("photo"), as_is("pixel_from_voxel"),
        nb::arg("truncation"), "Takes one depth map into the blocks of a signed distance volume.");
}

}  // namespace room2dgs
