// Binds the fused losses of block code. Values and gradients are written to the device's arrays; nothing waits for them.
#include "../pinhole_argument.h"
#include "bind_device.h"
#include "block_losses.h"

namespace R2_ISA {

using namespace room2dgs;

namespace {

void rgb_loss(BlockLosses& losses, const Input& rendered, const Input& target, double dssim, const Output& values,
              const OptionalOutput& gradient, uint64_t queue) {
  Arguments check = on_device(rendered);
  const auto shape = lengths("rendered", rendered, 3);
  const int64_t height = shape[0], width = shape[1];
  const float* x = check.input<float>("rendered", rendered, {height, width, 3});
  const float* y = check.input<float>("target", target, {height, width, 3});
  double* sums = check.output<double>("values", values, {2});
  float* to = check.output<float>("gradient", gradient, {height, width, 3});
  require(height > 0 && width > 0, "rendered has no pixels");
  require(dssim >= 0 && dssim <= 1, "dssim is not in 0..1");
  nb::gil_scoped_release unlocked;
  const Queue on(queue, rendered.device_id());
  const OnDevice current(on);
  losses.rgb_loss(on, x, y, height, width, dssim, to, sums);
}

void depth_normals(BlockLosses& losses, const Input& depth, double fx, double fy, double cx, double cy,
                   const Input& cam_from_world, const Output& normal, uint64_t queue) {
  Arguments check = on_device(depth), host;
  const auto shape = lengths("depth", depth, 2);
  const int64_t height = shape[0], width = shape[1];
  const float* from = check.input<float>("depth", depth, {height, width});
  const Pinhole camera = pinhole(host, fx, fy, cx, cy, cam_from_world);
  float* to = check.output<float>("normal", normal, {height, width, 3});
  nb::gil_scoped_release unlocked;
  const Queue on(queue, depth.device_id());
  const OnDevice current(on);
  losses.depth_normals(on, from, camera, height, width, to);
}

void normal_consistency(BlockLosses& losses, const Input& depth, const Input& alpha, const Input& normal, double fx,
                        double fy, double cx, double cy, const Input& cam_from_world, const Output& grad_depth,
                        const Output& grad_normal, const Output& values, uint64_t queue) {
  Arguments check = on_device(depth), host;
  const auto shape = lengths("depth", depth, 2);
  const int64_t height = shape[0], width = shape[1];
  const float* from_depth = check.input<float>("depth", depth, {height, width});
  const float* from_alpha = check.input<float>("alpha", alpha, {height, width});
  const float* from_normal = check.input<float>("normal", normal, {height, width, 3});
  const Pinhole camera = pinhole(host, fx, fy, cx, cy, cam_from_world);
  float* to_depth = check.output<float>("grad_depth", grad_depth, {height, width});
  float* to_normal = check.output<float>("grad_normal", grad_normal, {height, width, 3});
  double* sums = check.output<double>("values", values, {10});
  require(height > 0 && width > 0, "depth has no pixels");
  nb::gil_scoped_release unlocked;
  const Queue on(queue, depth.device_id());
  const OnDevice current(on);
  losses.normal_consistency(on, from_depth, from_alpha, from_normal, camera, height, width, to_depth, to_normal, sums);
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
      .def("depth_normals", &depth_normals, as_is("depth"), nb::arg("fx"), nb::arg("fy"), nb::arg("cx"),
           nb::arg("cy"), as_is("cam_from_world"), as_is("normal"), nb::arg("queue") = 0)
      .def("normal_consistency", &normal_consistency, as_is("depth"), as_is("alpha"), as_is("normal"), nb::arg("fx"),
           nb::arg("fy"), nb::arg("cx"), nb::arg("cy"), as_is("cam_from_world"), as_is("grad_depth"),
           as_is("grad_normal"), as_is("values"), nb::arg("queue") = 0,
           "Writes the loss and the gradient of the rotation to values, (10,) float64. cam_from_world lies on the CPU.");
}

}  // namespace R2_ISA
