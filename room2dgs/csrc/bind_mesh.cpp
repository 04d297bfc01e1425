#include <vector>

#include "../mesh/csrc/regularise.h"
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

constexpr int64_t kTogether = 32;  // blocks of a task

void regularise(const Input& data, const Input& weight, const Input& neighbour, const Output& value, const Output& ahead,
                const Output& dual, int side, double share, double soft, int steps) {
  require(side == 1 || side == 2 || side == 4 || side == kMostSide, "side is not 1, 2, 4 or 8");
  require(std::isfinite(share) && share > 0 && std::isfinite(soft) && soft >= 0, "share or soft is out of range");
  const int64_t blocks = lengths("data", data, 2)[0], count = int64_t{side} * side * side;
  Arguments check;
  RegulariseJob job{};
  job.data = check.input<float>("data", data, {blocks, count});
  job.weight = check.input<float>("weight", weight, {blocks, count});
  job.neighbour = check.input<int32_t>("neighbour", neighbour, {blocks, 6});
  job.value = check.output<float>("value", value, {blocks, count});
  job.ahead = check.output<float>("ahead", ahead, {blocks, count});
  job.dual = check.output<float>("dual", dual, {blocks, 3, count});
  job.side = side, job.share = static_cast<float>(share), job.soft = static_cast<float>(soft);
  for (int64_t k = 0; k < 6 * blocks; ++k)
    require(job.neighbour[k] >= -1 && job.neighbour[k] < blocks, "neighbour names a block that is not there");
  nb::gil_scoped_release unlocked;
  const auto up = R2_BEST(regularise_dual), down = R2_BEST(regularise_primal);
  const int64_t tasks = (blocks + kTogether - 1) / kTogether;
  for (int step = 0; step < steps; ++step)
    for (const auto kernel : {up, down})
      parallel_for(tasks, [&](int64_t task, int) {
        const int64_t end = std::min(blocks, (task + 1) * kTogether);
        for (int64_t block = task * kTogether; block < end; ++block) kernel(job, block);
      });
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
  m.def("regularise", &regularise, as_is("data"), as_is("weight"), as_is("neighbour"), as_is("value"), as_is("ahead"),
        as_is("dual"), nb::arg("side"), nb::arg("share"), nb::arg("soft"), nb::arg("steps"),
        "Steps of the primal-dual method of regularise.h on value, ahead and dual, which it changes.");
}

}  // namespace room2dgs
