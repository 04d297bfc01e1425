// Binds the fused losses of block code. Values and gradients are written to the device's arrays; nothing waits for them.
#include "bind_device.h"
#include "block_losses.h"

namespace R2_ISA {

using namespace room2dgs;

namespace {

// Arguments of a call whose first array says where all of them lie and how large the maps are.
struct Call {
  Arguments check;
  int64_t height, width;
  int device;
  Call(const char* name, const Input& first, size_t axes = 2) : check(on_device(first)), device(first.device_id()) {
    const auto shape = lengths(name, first, axes);
    height = shape[0], width = shape[1];
    require(height > 0 && width > 0, std::string(name) + " has no pixels");
  }
  const float* map(const char* name, const Input& array) { return check.input<float>(name, array, {height, width}); }
  const float* colors(const char* name, const Input& array) { return check.input<float>(name, array, {height, width, 3}); }
  // Runs `work` on the queue, other Python threads beside it.
  template <class F>
  void run(uint64_t queue, const F& work) const {
    nb::gil_scoped_release unlocked;
    const Queue on(queue, device);
    const OnDevice current(on);
    work(on);
  }
};

void rgb_loss(BlockLosses& losses, const Input& rendered, const Input& target, double dssim, const Output& values,
              const OptionalOutput& gradient, uint64_t queue) {
  Call c("rendered", rendered, 3);
  const float *x = c.colors("rendered", rendered), *y = c.colors("target", target);
  double* sums = c.check.output<double>("values", values, {2});
  float* to = c.check.output<float>("gradient", gradient, {c.height, c.width, 3});
  require(dssim >= 0 && dssim <= 1, "dssim is not in 0..1");
  c.run(queue, [&](const Queue& on) { losses.rgb_loss(on, x, y, c.height, c.width, dssim, to, sums); });
}

void depth_normals(BlockLosses& losses, const Input& depth, const Input& K, const Input& pose, const Output& normal,
                   uint64_t queue) {
  Call c("depth", depth);
  const float *from = c.map("depth", depth), *pinhole = c.check.input<float>("K", K, {3, 3});
  const float* turned = c.check.input<float>("cam_from_world", pose, {4, 4});
  float* to = c.check.output<float>("normal", normal, {c.height, c.width, 3});
  c.run(queue, [&](const Queue& on) { losses.depth_normals(on, from, pinhole, turned, c.height, c.width, to); });
}

void normal_consistency(BlockLosses& losses, const Input& depth, const Input& alpha, const Input& normal,
                        const Input& K, const Input& pose, const Output& grad_depth, const Output& grad_normal,
                        const Output& values, uint64_t queue) {
  Call c("depth", depth);
  const float *from_depth = c.map("depth", depth), *from_alpha = c.map("alpha", alpha);
  const float *from_normal = c.colors("normal", normal), *pinhole = c.check.input<float>("K", K, {3, 3});
  const float* turned = c.check.input<float>("cam_from_world", pose, {4, 4});
  float* to_depth = c.check.output<float>("grad_depth", grad_depth, {c.height, c.width});
  float* to_normal = c.check.output<float>("grad_normal", grad_normal, {c.height, c.width, 3});
  double* sums = c.check.output<double>("values", values, {10});
  c.run(queue, [&](const Queue& on) {
    losses.normal_consistency(on, from_depth, from_alpha, from_normal, pinhole, turned, c.height, c.width, to_depth,
                              to_normal, sums);
  });
}

void depth_prior(BlockLosses& losses, const Input& depth, const Input& alpha, const Input& prior, const Input& valid,
                 const OptionalInput& confidence, bool disparity, bool align, double gradient_weight, int levels,
                 const Output& gradient, const Output& values, uint64_t queue) {
  Call c("depth", depth);
  const DepthMaps maps = {c.map("depth", depth), c.map("alpha", alpha), c.map("prior", prior),
                          c.check.input<float>("confidence", confidence, {c.height, c.width}),
                          c.check.input<uint8_t>("valid", valid, {c.height, c.width}), c.height, c.width, disparity};
  float* to = c.check.output<float>("gradient", gradient, {c.height, c.width});
  double* sum = c.check.output<double>("values", values, {1});
  require(levels >= 0 && levels <= kDepthLevels, "levels are 0 to " + std::to_string(kDepthLevels));
  c.run(queue, [&](const Queue& on) { losses.depth_prior(on, maps, align, gradient_weight, levels, to, sum); });
}

void normal_prior(BlockLosses& losses, const Input& normal, const Input& alpha, const Input& prior, const Input& valid,
                  const OptionalInput& confidence, double l1, double cosine, int step, const Output& gradient,
                  const Output& values, uint64_t queue) {
  Call c("normal", normal, 3);
  require(step >= 1, "step is 1 or more");
  const int64_t height = (c.height + step - 1) / step, width = (c.width + step - 1) / step;
  const NormalMaps maps = {c.colors("normal", normal), c.map("alpha", alpha), c.height, c.width, step,
                           c.check.input<float>("prior", prior, {height, width, 3}),
                           c.check.input<float>("confidence", confidence, {height, width}),
                           c.check.input<uint8_t>("valid", valid, {height, width}), height, width};
  float* to = c.check.output<float>("gradient", gradient, {c.height, c.width, 3});
  double* sums = c.check.output<double>("values", values, {2});
  c.run(queue, [&](const Queue& on) {
    losses.normal_prior(on, maps, static_cast<float>(l1), static_cast<float>(cosine), to, sums);
  });
}

void multiview(BlockLosses& losses, const Input& depth, const OptionalInput& normal, const Input& pixels,
               const Input& grey, const Input& other_grey, const OptionalInput& usable, const Input& inverse_depth,
               int step, const Input& K, const Input& pose, const Input& other_K, const Input& other_pose, int patch,
               const Output& to_depth, const Output& to_normal, const Output& values, uint64_t queue) {
  Call c("depth", depth);
  const int64_t samples = lengths("pixels", pixels, 1)[0];
  const auto other = lengths("other_grey", other_grey, 2), map = lengths("inverse_depth", inverse_depth, 2);
  require(other[0] > 0 && other[1] > 0 && map[0] > 0 && map[1] > 0, "other_grey or inverse_depth has no pixels");
  require(step >= 1 && patch >= 1 && patch <= 31 && patch % 2, "step is 1 or more, patch an odd number to 31");
  MultiviewPixels job = {};
  job.depth = c.map("depth", depth), job.normal = c.check.input<float>("normal", normal, {c.height, c.width, 3});
  job.height = c.height, job.width = c.width;
  job.pixels = c.check.input<int32_t>("pixels", pixels, {samples}), job.samples = samples;
  job.grey = c.map("grey", grey), job.other_grey = c.check.input<float>("other_grey", other_grey, {other[0], other[1]});
  job.usable = c.check.input<uint8_t>("usable", usable, {other[0], other[1]});
  job.other_height = other[0], job.other_width = other[1];
  job.inverse_depth = c.check.input<float>("inverse_depth", inverse_depth, {map[0], map[1]});
  job.map_height = map[0], job.map_width = map[1], job.step = static_cast<float>(step);
  job.K = c.check.input<float>("K", K, {3, 3}), job.pose = c.check.input<float>("cam_from_world", pose, {4, 4});
  job.other_K = c.check.input<float>("other_K", other_K, {3, 3});
  job.other_pose = c.check.input<float>("other_cam_from_world", other_pose, {4, 4});
  job.patch = patch;
  job.to_depth = c.check.output<float>("to_depth", to_depth, {samples, 2});
  job.to_normal = c.check.output<float>("to_normal", to_normal, {samples, 3});
  double* sums = c.check.output<double>("values", values, {4});
  c.run(queue, [&](const Queue& on) { losses.multiview(on, job, sums); });
}

}  // namespace

void bind_block_losses(nb::module_& m) {
  nb::class_<BlockLosses>(m, "BlockLosses",
                          "The fused losses of training, with the buffers that one queue uses again and again.")
      .def(nb::init<>())
      .def("rgb_loss", &rgb_loss, as_is("rendered"), as_is("target"), nb::arg("dssim"), as_is("values"),
           or_none("gradient"), nb::arg("queue") = 0,
           "Writes (L, D) = (mean |rendered - target|, mean 1 - SSIM) to values, float64, and the gradient of "
           "(1 - dssim) L + dssim D. queue: as in BlockFrame.")
      .def("depth_normals", &depth_normals, as_is("depth"), as_is("K"), as_is("cam_from_world"), as_is("normal"),
           nb::arg("queue") = 0)
      .def("normal_consistency", &normal_consistency, as_is("depth"), as_is("alpha"), as_is("normal"), as_is("K"),
           as_is("cam_from_world"), as_is("grad_depth"), as_is("grad_normal"), as_is("values"), nb::arg("queue") = 0,
           "Writes the loss and the gradient of the rotation to values, (10,) float64.")
      .def("depth_prior", &depth_prior, as_is("depth"), as_is("alpha"), as_is("prior"), as_is("valid"),
           or_none("confidence"), nb::arg("disparity"), nb::arg("align"), nb::arg("gradient_weight"),
           nb::arg("levels"), as_is("gradient"), as_is("values"), nb::arg("queue") = 0,
           "Writes the loss to values, (1,) float64, and its gradient by the depth. valid is uint8.")
      .def("normal_prior", &normal_prior, as_is("normal"), as_is("alpha"), as_is("prior"), as_is("valid"),
           or_none("confidence"), nb::arg("l1"), nb::arg("cosine"), nb::arg("step"), as_is("gradient"),
           as_is("values"), nb::arg("queue") = 0,
           "Writes the loss and 1 / number of its pixels to values, (2,) float64, and the loss's gradient by the "
           "normal, not yet multiplied by that. prior, valid (uint8) and confidence have every `step`-th row and column.")
      .def("multiview", &multiview, as_is("depth"), or_none("normal"), as_is("pixels"), as_is("grey"),
           as_is("other_grey"), or_none("usable"), as_is("inverse_depth"), nb::arg("step"), as_is("K"),
           as_is("cam_from_world"), as_is("other_K"), as_is("other_cam_from_world"), nb::arg("patch"),
           as_is("to_depth"), as_is("to_normal"), as_is("values"), nb::arg("queue") = 0,
           "Writes geometric and photometric mean and the numbers of their pixels to values, (4,) float64, and each "
           "pixel's gradients, not yet divided by these. pixels, int32, are row * width + column, or -1; usable is "
           "uint8. Without a normal there is no photometric term.");
}

}  // namespace R2_ISA
