// Binds fusion by block code. The depth map and the volume lie on the device, the camera's numbers with the caller.
#include <cmath>

#include "../../mesh/csrc/block_fusion.h"
#include "../fusion_arguments.h"
#include "bind_device.h"

namespace R2_ISA {

using namespace room2dgs;

namespace {

void touched(const Input& depth, const Input& normal, const Input& K, const Input& local_from_cam, double side,
             double truncation, const Output& keys, uint64_t queue) {
  Arguments check = on_device(depth), host;
  const TouchJob job = touch_job(check, host, depth, normal, K, local_from_cam, side, truncation, keys);
  nb::gil_scoped_release unlocked;
  const Queue on(queue, depth.device_id());
  const OnDevice current(on);
  touch_blocks(on, job);
}

void fuse(const Input& block, const Input& row, const Output& distance, const Output& weight, const Output& views,
          const Output& color, const Input& depth, const Input& normal, const Input& trust,
          const Input& photo, const Input& pixel_from_voxel, double voxel, double truncation, uint64_t queue) {
  Arguments check = on_device(depth), host;
  const int64_t blocks = lengths("block", block, 2)[0], rows = lengths("distance", distance, 2)[0];
  const FusionJob job = fusion_job(check, host, block, row, distance, weight, views, color, depth, normal, trust,
                                   photo, pixel_from_voxel, voxel, truncation);
  nb::gil_scoped_release unlocked;
  const Queue on(queue, depth.device_id());
  const OnDevice current(on);
  fuse_blocks(on, job, blocks, rows);
}

}  // namespace

void bind_block_fusion(nb::module_& m) {
  m.def("touched_blocks", &touched, as_is("depth"), as_is("normal"), as_is("K"), as_is("local_from_cam"), nb::arg("side"),
        nb::arg("truncation"), as_is("keys"), nb::arg("queue") = 0,
        "Writes the blocks near a depth map's surface to keys, (pixels of every second row and column, 4) int64: "
        "((x + h) 2h + y + h) 2h + z + h with h = 2^20, or -1; some more than once. K and local_from_cam, (3, 4), are "
        "float64 on the CPU. queue: as in BlockFrame.");
  m.def("fuse_depth", &fuse, as_is("block"), as_is("row"), as_is("distance"), as_is("weight"), as_is("views"),
        as_is("color"), as_is("depth"), as_is("normal"), as_is("trust"), as_is("photo"), as_is("pixel_from_voxel"),
        nb::arg("voxel"), nb::arg("truncation"), nb::arg("queue") = 0,
        "As the CPU's `fuse_depth`; no row may come twice, and one that is not there is passed over. pixel_from_voxel "
        "is on the CPU. queue: as in BlockFrame.");
}

}  // namespace R2_ISA
