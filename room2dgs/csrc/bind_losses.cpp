#include <algorithm>
#include <memory>
#include <vector>

#include "arrays.h"
#include "depth_prior_maths.h"
#include "parallel.h"
#include "photometric.h"
#include "pinhole_argument.h"
#include "priors.h"
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

constexpr int64_t kPriorStripRows = 8;
static_assert(kPriorMoments + kPriorPairs == isa_baseline::kDepthSums && kPriorLevels == isa_baseline::kDepthLevels,
              "depth_fit takes the sums that the kernels leave");

// Runs `kernel(strip, worker)` over all strips of rows.
template <class Kernel>
void over_strips(Region& region, int64_t height, const Kernel& kernel) {
  region.parallel_for(strips_of(height, kPriorStripRows), kernel);
}

Rendered rendered_maps(const std::vector<int64_t>& shape, int64_t step) {
  require(shape[0] > 0 && shape[1] > 0, "the rendering has no pixels");
  require(step >= 1, "step is not 1 or more");
  return {shape[0], shape[1], step};
}
int64_t rows_compared(int64_t rows, int64_t step) { return (rows + step - 1) / step; }

double depth_prior(const Input& depth, const Input& alpha, const Input& prior, const Input& valid,
                   const OptionalInput& confidence, bool disparity, bool align, double gradient_weight, int levels,
                   int64_t step, const Output& gradient) {
  Arguments check;
  DepthPriorJob job = {};
  job.rendered = rendered_maps(lengths("depth", depth, 2), step);
  const auto [tall, wide, every] = job.rendered;
  const int64_t height = rows_compared(tall, every), width = rows_compared(wide, every);
  job.depth = check.input<float>("depth", depth, {tall, wide});
  job.alpha = check.input<float>("alpha", alpha, {tall, wide});
  job.prior = check.input<float>("prior", prior, {height, width});
  job.valid = check.input<uint8_t>("valid", valid, {height, width});
  job.confidence = check.input<float>("confidence", confidence, {height, width});
  job.gradient = check.output<float>("gradient", gradient, {tall, wide});
  require(levels >= 0 && levels <= kPriorLevels, "levels are 0 to " + std::to_string(kPriorLevels));
  job.height = height, job.width = width, job.strip_rows = kPriorStripRows;
  job.disparity = disparity, job.align = align, job.levels = levels;
  nb::gil_scoped_release unlocked;
  Region region;
  std::vector<double> moments(kPriorMoments * height), values(height);
  std::vector<int64_t> pairs(kPriorPairs * height);
  std::unique_ptr<float[]> maps(new float[2 * height * width]);
  auto scratch = scratch_for(region, depth_prior_scratch(width));
  job.weight = maps.get(), job.residual = maps.get() + height * width, job.scratch = scratch.get();
  job.row_moments = moments.data(), job.row_pairs = pairs.data(), job.row_values = values.data();

  const auto look = R2_BEST(depth_prior_moments);
  over_strips(region, height, [&](int64_t strip, int) { look(job, strip); });
  double sums[isa_baseline::kDepthSums] = {};
  for (int64_t row = 0; row < height; ++row)
    for (int k = 0; k < kPriorMoments; ++k) sums[k] += moments[kPriorMoments * row + k];
  const auto alignment = isa_baseline::depth_fit(sums, align, gradient_weight, 0).alignment;
  if (alignment.mean == 0) {
    std::fill_n(job.gradient, tall * wide, 0.0f);
    return 0.0;
  }
  job.scale = alignment.scale, job.shift = alignment.shift, job.inverse_unit = alignment.inverse_unit;
  job.mean = alignment.mean;

  const auto compare = R2_BEST(depth_prior_residuals);
  over_strips(region, height, [&](int64_t strip, int) { compare(job, strip); });
  for (int64_t row = 0; row < height; ++row)
    for (int k = 0; k < kPriorPairs; ++k) sums[kPriorMoments + k] += static_cast<double>(pairs[kPriorPairs * row + k]);
  const auto fit = isa_baseline::depth_fit(sums, align, gradient_weight, levels);
  for (int level = 0; level < levels; ++level)
    for (int along = 0; along < 2; ++along) job.shares[level][along] = fit.shares[level][along];

  const auto descend = R2_BEST(depth_prior_gradient);
  over_strips(region, height, [&](int64_t strip, int worker) { descend(job, strip, worker); });
  double total = 0;
  for (const double value : values) total += value;
  return total;
}

double normal_prior(const Input& normal, const Input& alpha, const Input& prior, const Input& valid,
                    const OptionalInput& confidence, double l1, double cosine, int64_t step, const Output& gradient) {
  Arguments check;
  NormalPriorJob job = {};
  job.rendered = rendered_maps(lengths("normal", normal, 3), step);
  const auto [tall, wide, every] = job.rendered;
  const int64_t height = rows_compared(tall, every), width = rows_compared(wide, every);
  job.normal = check.input<float>("normal", normal, {tall, wide, 3});
  job.alpha = check.input<float>("alpha", alpha, {tall, wide});
  job.prior = check.input<float>("prior", prior, {height, width, 3});
  job.valid = check.input<uint8_t>("valid", valid, {height, width});
  job.confidence = check.input<float>("confidence", confidence, {height, width});
  job.gradient = check.output<float>("gradient", gradient, {tall, wide, 3});
  job.height = height, job.width = width, job.strip_rows = kPriorStripRows;
  nb::gil_scoped_release unlocked;
  Region region;
  std::vector<int64_t> counts(height);
  std::vector<double> values(height);
  auto scratch = scratch_for(region, normal_prior_scratch(width));
  job.row_counts = counts.data(), job.row_values = values.data(), job.scratch = scratch.get();
  const auto count = R2_BEST(normal_prior_count);
  over_strips(region, height, [&](int64_t strip, int) { count(job, strip); });
  int64_t compared = 0;
  for (const int64_t of_row : counts) compared += of_row;
  const double pixels = static_cast<double>(compared > 1 ? compared : 1);
  job.l1 = static_cast<float>(l1 / pixels), job.cosine = static_cast<float>(cosine / pixels);
  const auto descend = R2_BEST(normal_prior_gradient);
  over_strips(region, height, [&](int64_t strip, int worker) { descend(job, strip, worker); });
  double total = 0;
  for (const double value : values) total += value;
  return total;
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
  m.def("depth_prior", &depth_prior, as_is("depth"), as_is("alpha"), as_is("prior"), as_is("valid"),
        or_none("confidence"), nb::arg("disparity"), nb::arg("align"), nb::arg("gradient_weight"), nb::arg("levels"),
        nb::arg("step"), as_is("gradient"),
        "Returns the loss and writes its gradient by the depth. Compared are every `step`-th row and column of depth and "
        "alpha, which are all that the other maps have. valid is uint8.");
  m.def("normal_prior", &normal_prior, as_is("normal"), as_is("alpha"), as_is("prior"), as_is("valid"),
        or_none("confidence"), nb::arg("l1"), nb::arg("cosine"), nb::arg("step"), as_is("gradient"),
        "Returns the loss and writes its gradient by the normal; maps as in depth_prior.");
}

}  // namespace room2dgs
