#include <memory>
#include <vector>

#include "arrays.h"
#include "parallel.h"
#include "photometric.h"
#include "pinhole_argument.h"
#include "surface.h"

namespace room2dgs {
namespace {

int64_t strips_of(int64_t height, int64_t strip_rows) { return (height + strip_rows - 1) / strip_rows; }

// Room for every worker of the region, so the region is opened first.
std::unique_ptr<float[]> scratch_for(const Region& region, int64_t floats) {
  return std::unique_ptr<float[]>(new float[floats * region.workers()]);
}

nb::tuple rgb_loss(const Input& rendered, const Input& target, double dssim, const OptionalOutput& gradient) {
  Arguments check;
  const auto shape = lengths("rendered", rendered, 3);
  const int64_t height = shape[0], width = shape[1], row_floats = 3 * width;
  const float* x = check.input<float>("rendered", rendered, {height, width, 3});
  const float* y = check.input<float>("target", target, {height, width, 3});
  float* to = check.output<float>("gradient", gradient, {height, width, 3});
  require(height > 0 && width > 0, "rendered has no pixels");
  require(dssim >= 0 && dssim <= 1, "dssim is not in 0..1");
  double l1 = 0.0, one_minus_ssim = 0.0;
  const double values = static_cast<double>(height) * row_floats;
  {
    nb::gil_scoped_release unlocked;
    Region region;
    // A strip repeats 10 rows of its neighbours' maps, so it is as tall as leaves two for each thread. Where it is
    // cut changes no bit: a pixel's arithmetic does not know its strip, and the sums are taken by row.
    const int64_t tall = strips_of(height, 2 * region.workers()), strip_rows = tall < 16 ? 16 : tall > 120 ? 120 : tall;
    std::vector<float> zeros(row_floats, 0.0f);
    std::vector<double> row_l1(height), row_dssim(height);
    auto scratch = scratch_for(region, rgb_loss_scratch(row_floats));
    const RgbLossJob job = {x, y, zeros.data(), to, row_l1.data(), row_dssim.data(), height, row_floats, strip_rows,
                            static_cast<float>((1.0 - dssim) / values), static_cast<float>(dssim / values),
                            scratch.get()};
    const auto strip_kernel = R2_BEST(rgb_loss_strip);
    region.parallel_for(strips_of(height, strip_rows),
                        [&](int64_t strip, int worker) { strip_kernel(job, strip, worker); });
    for (int64_t row = 0; row < height; ++row) {
      l1 += row_l1[row];
      one_minus_ssim += row_dssim[row];
    }
  }
  return nb::make_tuple(l1 / values, one_minus_ssim / values);
}

constexpr int64_t kSurfaceStripRows = 16;

void depth_normals(const Input& depth, double fx, double fy, double cx, double cy, const Input& cam_from_world,
                   const Output& normal) {
  Arguments check;
  const auto shape = lengths("depth", depth, 2);
  const int64_t height = shape[0], width = shape[1];
  const float* from = check.input<float>("depth", depth, {height, width});
  const Pinhole camera = pinhole(check, fx, fy, cx, cy, cam_from_world);
  float* to = check.output<float>("normal", normal, {height, width, 3});
  nb::gil_scoped_release unlocked;
  Region region;
  auto scratch = scratch_for(region, depth_normals_scratch(width, kSurfaceStripRows));
  const DepthNormalsJob job = {from, to, camera, height, width, kSurfaceStripRows, scratch.get()};
  const auto strip_kernel = R2_BEST(depth_normals_strip);
  region.parallel_for(strips_of(height, kSurfaceStripRows),
                      [&](int64_t strip, int worker) { strip_kernel(job, strip, worker); });
}

double normal_consistency(const Input& depth, const Input& alpha, const Input& normal, double fx, double fy, double cx,
                          double cy, const Input& cam_from_world, const Output& grad_depth, const Output& grad_normal,
                          const Output& grad_rotation) {
  Arguments check;
  const auto shape = lengths("depth", depth, 2);
  const int64_t height = shape[0], width = shape[1];
  const float* from_depth = check.input<float>("depth", depth, {height, width});
  const float* from_alpha = check.input<float>("alpha", alpha, {height, width});
  const float* from_normal = check.input<float>("normal", normal, {height, width, 3});
  const Pinhole camera = pinhole(check, fx, fy, cx, cy, cam_from_world);
  float* to_depth = check.output<float>("grad_depth", grad_depth, {height, width});
  float* to_normal = check.output<float>("grad_normal", grad_normal, {height, width, 3});
  double* to_rotation = check.output<double>("grad_rotation", grad_rotation, {3, 3});
  require(height > 0 && width > 0, "depth has no pixels");
  nb::gil_scoped_release unlocked;
  Region region;
  const double pixels = static_cast<double>(height) * width;
  std::vector<double> row_sums(10 * height);
  auto scratch = scratch_for(region, normal_consistency_scratch(width, kSurfaceStripRows));
  const NormalConsistencyJob job = {from_depth, from_alpha, from_normal, to_depth, to_normal, row_sums.data(), camera,
                                    height, width, kSurfaceStripRows, static_cast<float>(1.0 / pixels), scratch.get()};
  const auto strip_kernel = R2_BEST(normal_consistency_strip);
  region.parallel_for(strips_of(height, kSurfaceStripRows),
                      [&](int64_t strip, int worker) { strip_kernel(job, strip, worker); });
  double sums[10] = {};
  for (int64_t row = 0; row < height; ++row)
    for (int k = 0; k < 10; ++k) sums[k] += row_sums[10 * row + k];
  for (int k = 0; k < 9; ++k) to_rotation[k] = sums[k + 1];
  return sums[0] / pixels;
}

}  // namespace

void bind_losses(nb::module_& m) {
  m.def("rgb_loss", &rgb_loss, as_is("rendered"), as_is("target"), nb::arg("dssim"),
        nb::arg("gradient").noconvert() = nb::none(),
        "Returns (L, D) = (mean |rendered - target|, mean 1 - SSIM); writes the gradient of (1 - dssim) L + dssim D.");
  m.def("depth_normals", &depth_normals, as_is("depth"), nb::arg("fx"), nb::arg("fy"), nb::arg("cx"), nb::arg("cy"),
        as_is("cam_from_world"), as_is("normal"));
  m.def("normal_consistency", &normal_consistency, as_is("depth"), as_is("alpha"), as_is("normal"), nb::arg("fx"),
        nb::arg("fy"), nb::arg("cx"), nb::arg("cy"), as_is("cam_from_world"), as_is("grad_depth"),
        as_is("grad_normal"), as_is("grad_rotation"));
}

}  // namespace room2dgs
