#include <nanobind/stl/optional.h>

#include <memory>
#include <optional>
#include <vector>

#include "bind.h"
#include "parallel.h"
#include "photometric.h"
#include "surface.h"

#if defined(__x86_64__) || defined(_M_X64)
#define R2_BEST(kernel) (room2dgs::has_avx2() ? &isa_avx2::kernel : &isa_baseline::kernel)
#else
#define R2_BEST(kernel) (&isa_baseline::kernel)
#endif

namespace room2dgs {
namespace {

using Map = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using ConstMap = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Image = nb::ndarray<float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using ConstImage = nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using Matrix3 = nb::ndarray<const double, nb::shape<3, 3>, nb::c_contig, nb::device::cpu>;

void require(bool condition, const char* message) {
  if (!condition) throw nb::value_error(message);
}

template <class A, class B>
bool same_size(const A& a, const B& b) {
  return a.shape(0) == b.shape(0) && a.shape(1) == b.shape(1);
}

std::unique_ptr<float[]> scratch_for_workers(int64_t floats) {
  return std::unique_ptr<float[]>(new float[floats * threads()]);
}

int64_t strips_of(int64_t height, int64_t strip_rows) { return (height + strip_rows - 1) / strip_rows; }

nb::tuple rgb_loss(ConstImage rendered, ConstImage target, double dssim, std::optional<Image> gradient) {
  require(same_size(rendered, target), "rendered and target differ in size");
  require(!gradient || same_size(rendered, *gradient), "rendered and gradient differ in size");
  const int64_t height = rendered.shape(0), row_floats = 3 * rendered.shape(1);
  double l1 = 0.0, one_minus_ssim = 0.0;
  const double values = static_cast<double>(height) * row_floats;
  {
    nb::gil_scoped_release unlocked;
    // A strip repeats 10 rows of its neighbours' maps, so it is as tall as leaves two for each thread. Where it is
    // cut changes no bit: a pixel's arithmetic does not know its strip, and the sums are taken by row.
    const int64_t tall = strips_of(height, 2 * threads()), strip_rows = tall < 16 ? 16 : tall > 120 ? 120 : tall;
    std::vector<float> zeros(row_floats, 0.0f);
    std::vector<double> row_l1(height), row_dssim(height);
    auto scratch = scratch_for_workers(rgb_loss_scratch(row_floats));
    const RgbLossJob job = {rendered.data(), target.data(), zeros.data(), gradient ? gradient->data() : nullptr,
                            row_l1.data(), row_dssim.data(), height, row_floats, strip_rows,
                            static_cast<float>((1.0 - dssim) / values), static_cast<float>(dssim / values),
                            scratch.get()};
    const auto strip_kernel = R2_BEST(rgb_loss_strip);
    parallel_for(strips_of(height, strip_rows), [&](int64_t strip, int worker) { strip_kernel(job, strip, worker); });
    for (int64_t row = 0; row < height; ++row) {
      l1 += row_l1[row];
      one_minus_ssim += row_dssim[row];
    }
  }
  return nb::make_tuple(l1 / values, one_minus_ssim / values);
}

Pinhole pinhole(double fx, double fy, double cx, double cy, const Matrix3& cam_from_world) {
  Pinhole camera = {static_cast<float>(fx), static_cast<float>(fy), static_cast<float>(cx), static_cast<float>(cy), {}};
  for (int k = 0; k < 9; ++k) camera.cam_from_world[k] = static_cast<float>(cam_from_world.data()[k]);
  return camera;
}

constexpr int64_t kSurfaceStripRows = 16;

void depth_normals(ConstMap depth, double fx, double fy, double cx, double cy, Matrix3 cam_from_world, Image normal) {
  require(same_size(depth, normal), "depth and normal differ in size");
  nb::gil_scoped_release unlocked;
  const int64_t height = depth.shape(0), width = depth.shape(1);
  auto scratch = scratch_for_workers(depth_normals_scratch(width, kSurfaceStripRows));
  const DepthNormalsJob job = {depth.data(), normal.data(), pinhole(fx, fy, cx, cy, cam_from_world),
                               height, width, kSurfaceStripRows, scratch.get()};
  const auto strip_kernel = R2_BEST(depth_normals_strip);
  parallel_for(strips_of(height, kSurfaceStripRows),
               [&](int64_t strip, int worker) { strip_kernel(job, strip, worker); });
}

double normal_consistency(ConstMap depth, ConstMap alpha, ConstImage normal, double fx, double fy, double cx, double cy,
                          Matrix3 cam_from_world, Map grad_depth, Image grad_normal,
                          nb::ndarray<double, nb::shape<3, 3>, nb::c_contig, nb::device::cpu> grad_rotation) {
  require(same_size(depth, alpha) && same_size(depth, normal), "depth, alpha and normal differ in size");
  require(same_size(depth, grad_depth) && same_size(depth, grad_normal), "a gradient differs from its map in size");
  nb::gil_scoped_release unlocked;
  const int64_t height = depth.shape(0), width = depth.shape(1);
  const double pixels = static_cast<double>(height) * width;
  std::vector<double> row_sums(10 * height);
  auto scratch = scratch_for_workers(normal_consistency_scratch(width, kSurfaceStripRows));
  const NormalConsistencyJob job = {depth.data(), alpha.data(), normal.data(), grad_depth.data(), grad_normal.data(),
                                    row_sums.data(), pinhole(fx, fy, cx, cy, cam_from_world), height, width,
                                    kSurfaceStripRows, static_cast<float>(1.0 / pixels), scratch.get()};
  const auto strip_kernel = R2_BEST(normal_consistency_strip);
  parallel_for(strips_of(height, kSurfaceStripRows),
               [&](int64_t strip, int worker) { strip_kernel(job, strip, worker); });
  double sums[10] = {};
  for (int64_t row = 0; row < height; ++row)
    for (int k = 0; k < 10; ++k) sums[k] += row_sums[10 * row + k];
  for (int k = 0; k < 9; ++k) grad_rotation.data()[k] = sums[k + 1];
  return sums[0] / pixels;
}

}  // namespace

void bind_losses(nb::module_& m) {
  m.def("rgb_loss", &rgb_loss, nb::arg("rendered"), nb::arg("target"), nb::arg("dssim"),
        nb::arg("gradient") = nb::none(),
        "Returns (L, D) = (mean |rendered - target|, mean 1 - SSIM); writes the gradient of (1 - dssim) L + dssim D.");
  m.def("depth_normals", &depth_normals, nb::arg("depth"), nb::arg("fx"), nb::arg("fy"), nb::arg("cx"), nb::arg("cy"),
        nb::arg("cam_from_world"), nb::arg("normal"));
  m.def("normal_consistency", &normal_consistency, nb::arg("depth"), nb::arg("alpha"), nb::arg("normal"), nb::arg("fx"),
        nb::arg("fy"), nb::arg("cx"), nb::arg("cy"), nb::arg("cam_from_world"), nb::arg("grad_depth"),
        nb::arg("grad_normal"), nb::arg("grad_rotation"));
}

}  // namespace room2dgs
