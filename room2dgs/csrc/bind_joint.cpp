// Binds the joint depth optimisation: the gradient of its energy at random samples, and Adam.
#include <cmath>
#include <memory>
#include <vector>

#include "arrays.h"
#include "joint.h"
#include "parallel.h"

namespace room2dgs {
namespace {

constexpr int64_t kMostNumbers = int64_t(1) << 31;  // of a map: kernels index with int32
constexpr int64_t kViewsPerTask = 8;
constexpr int64_t kNumbersPerTask = 4096;

int64_t tasks_of(int64_t count, int64_t size) { return (count + size - 1) / size; }

double joint_gradient(const Input& depth, const Input& depth_confidence, const Input& normal,
                      const Input& normal_confidence, const Input& region, const Input& region_normal,
                      const Input& view_table, const Input& pair_views, const Input& pair_table, const Input& point_place,
                      const Input& point_off, const OptionalInput& axes, const Input& grid, const Input& stiffness, const Input& draws,
                      const Input& weights, const Input& widths, int64_t step, double smoothness, double magnitude,
                      const Output& gradient) {
  Arguments check;
  JointJob job = {};
  const auto map = lengths("depth", depth, 3), knots = lengths("grid", grid, 3);
  const int64_t n = job.views = map[0], h = job.height = map[1], w = job.width = map[2];
  job.depth = check.input<float>("depth", depth, {n, h, w});
  job.depth_confidence = check.input<float>("depth_confidence", depth_confidence, {n, h, w});
  job.normal = check.input<float>("normal", normal, {n, h, w, 3});
  job.normal_confidence = check.input<float>("normal_confidence", normal_confidence, {n, h, w});
  job.region = check.input<int32_t>("region", region, {n, h, w});
  job.region_normal = check.input<float>("region_normal", region_normal, {n, h, w, 3});
  job.view_table = check.input<float>("view_table", view_table, {kJointViewRows, n});
  job.pairs = lengths("pair_views", pair_views, 2)[1];
  job.pair_views = check.input<int32_t>("pair_views", pair_views, {2, job.pairs});
  job.pair_table = check.input<float>("pair_table", pair_table, {kJointPairRows, job.pairs});
  job.point_count = lengths("point_place", point_place, 2)[0];
  job.point_place = check.input<float>("point_place", point_place, {job.point_count, 2});
  job.point_off = check.input<float>("point_off", point_off, {job.point_count});
  job.axis_count = axes ? lengths("axes", *axes, 3)[0] : 0;
  job.axes = check.input<float>("axes", axes, {job.axis_count, 3, n});
  job.rows = knots[1], job.columns = knots[2];
  job.grid = check.input<float>("grid", grid, {n, job.rows, job.columns});
  job.stiffness = check.input<float>("stiffness", stiffness, {n, job.rows, job.columns});
  job.samples = lengths("draws", draws, 2)[1];
  job.draws = check.input<int32_t>("draws", draws, {kJointFirstDraw[kJointTerms], job.samples});
  const float* weight = check.input<float>("weights", weights, {kJointTerms});
  const float* width = check.input<float>("widths", widths, {kJointTerms});
  job.gradient = check.output<float>("gradient", gradient, {n, job.rows, job.columns});
  require(h >= 2 && w >= 2, "depth has fewer than 2 x 2 samples");
  require(job.rows >= 2 && job.columns >= 2, "grid has fewer than 2 x 2 knots");
  require(n < kMostNumbers / (3 * h * w) && n < kMostNumbers / (job.rows * job.columns) &&
              job.point_count < kMostNumbers / 2 && job.pairs < kMostNumbers,
          "there are more views, pairs or points than the kernels can count");
  require(!axes || job.axis_count == 1 || job.axis_count == 3, "axes are 1 or 3, or None");
  require(step >= 1 && step <= (1 << 20), "step is not in 1..2^20");
  for (int term = 0; term < kJointTerms; ++term) job.weight[term] = weight[term], job.width_of[term] = width[term];
  job.step = step, job.smoothness = static_cast<float>(smoothness), job.magnitude = static_cast<float>(magnitude);
  job.stride = tasks_of(job.samples, kJointChunk) * kJointChunk;

  const bool wanted[kJointTerms] = {job.point_count > 0, job.pairs > 0, std::min(h, w) > kJointSlopeStep, true,
                                    job.axis_count > 0};
  std::vector<int> terms;  // that have something to draw from
  for (int term : {kJointViews, kJointSlopes, kJointAxes, kJointPlanes, kJointPoints})
    if (wanted[term] && n > 0) terms.push_back(term);
  int64_t strange = 0;
  double energy = 0.0;
  {
    nb::gil_scoped_release unlocked;
    constexpr int kPlaces = kJointFirstPlace[kJointTerms];
    const std::unique_ptr<int32_t[]> knot(new int32_t[kPlaces * job.stride]);
    const std::unique_ptr<float[]> kept(new float[3 * kPlaces * job.stride]);
    job.knot = knot.get(), job.right = kept.get();
    job.lower = job.right + kPlaces * job.stride, job.pull = job.lower + kPlaces * job.stride;
    const int64_t chunks = job.stride / kJointChunk;
    std::vector<JointSum> sums(terms.size() * chunks);
    Region region;
    const auto samples = R2_BEST(joint_samples);
    region.parallel_for(sums.size(), [&](int64_t task, int) {
      sums[task] = samples(job, terms[task / chunks], task % chunks * kJointChunk);
    });
    for (const JointSum& sum : sums) strange += sum.strange;
    if (!strange) {
      std::fill(job.gradient, job.gradient + n * job.rows * job.columns, 0.0f);
      const auto scatter = R2_BEST(joint_scatter);
      for (size_t k = 0; k < terms.size(); ++k) {
        double cost = 0.0;
        int64_t count = 0;
        for (int64_t chunk = 0; chunk < chunks; ++chunk)
          cost += sums[k * chunks + chunk].cost, count += sums[k * chunks + chunk].count;
        if (!count) continue;
        const double scale = job.weight[terms[k]] / static_cast<double>(count);
        energy += scale * cost;
        scatter(job, terms[k], static_cast<float>(scale));
      }
      const int64_t scratch_size = joint_scratch(job.rows, job.columns);
      const std::unique_ptr<float[]> scratch(new float[scratch_size * region.workers()]);
      std::vector<double> costs(n);
      const auto regulariser = R2_BEST(joint_regulariser);
      region.parallel_for(tasks_of(n, kViewsPerTask), [&](int64_t task, int worker) {
        for (int64_t view = task * kViewsPerTask; view < n && view < (task + 1) * kViewsPerTask; ++view)
          costs[view] = regulariser(job, view, scratch.get() + worker * scratch_size);
      });
      for (double cost : costs) energy += cost;
    }
  }
  require(!strange, "draws or pair_views name a view, sample, point or pair that is not there");
  return energy;
}

void adam(const Output& values, const Input& gradient, const Output& first, const Output& second, double rate,
          int64_t step) {
  Arguments check;
  const int64_t count = lengths("values", values, 1)[0];
  AdamStep job;
  job.values = check.output<float>("values", values, {count});
  job.gradient = check.input<float>("gradient", gradient, {count});
  job.first = check.output<float>("first", first, {count});
  job.second = check.output<float>("second", second, {count});
  require(std::isfinite(rate) && rate >= 0, "rate is not a number of 0 or more");
  require(step >= 1 && step <= (1 << 24), "step is not in 1..2^24");
  job.size = static_cast<float>(rate / (1.0 - std::pow(kAdamFirst, step)));
  job.per_root = static_cast<float>(1.0 / std::sqrt(1.0 - std::pow(kAdamSecond, step)));
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(adam_step);
  parallel_for(tasks_of(count, kNumbersPerTask), [&](int64_t task, int) {
    const int64_t at = task * kNumbersPerTask;
    kernel(job, at, std::min(count, at + kNumbersPerTask));
  });
}

}  // namespace

void bind_joint(nb::module_& m) {
  m.def("joint_gradient", &joint_gradient, as_is("depth"), as_is("depth_confidence"), as_is("normal"),
        as_is("normal_confidence"), as_is("region"), as_is("region_normal"), as_is("view_table"), as_is("pair_views"),
        as_is("pair_table"), as_is("point_place"), as_is("point_off"), or_none("axes"), as_is("grid"),
        as_is("stiffness"), as_is("draws"), as_is("weights"), as_is("widths"), nb::arg("step"), nb::arg("smoothness"),
        nb::arg("magnitude"), as_is("gradient"), "The energy of the joint depth optimisation at these draws; its gradient is written.");
  m.def("adam", &adam, as_is("values"), as_is("gradient"), as_is("first"), as_is("second"), nb::arg("rate"),
        nb::arg("step"), "One step of Adam; `first` and `second` are its moments.");
}

}  // namespace room2dgs
