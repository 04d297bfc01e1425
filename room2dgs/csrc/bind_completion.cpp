// Binds the completion of depth between anchors.
#include <new>
#include <vector>

#include "arrays.h"
#include "completion.h"
#include "parallel.h"

namespace room2dgs {
namespace {

constexpr int64_t kMostPixels = int64_t(1) << 22;  // of an image: the elimination's memory grows faster than its pixels

struct Aligned {  // a vector's worth of bytes for AVX
  alignas(32) double lanes[kCompletionLanes];
};

void complete(const Input& distance, const Input& anchor, const Input& prior, const Input& right, const Input& down,
              int64_t reweightings, double least, double anchor_width, double tie_width, const Output& result) {
  Arguments check;
  CompletionJob job = {};
  const auto shape = lengths("distance", distance, 3);
  const int64_t n = job.images = shape[0], h = shape[1], w = shape[2];
  require(h >= 1 && w >= 1 && h <= kMostPixels / w, "images are not of 1 to 2^22 pixels");
  job.distance = check.input<double>("distance", distance, {n, h, w});
  job.anchor = check.input<double>("anchor", anchor, {n, h, w});
  job.prior = check.input<double>("prior", prior, {n, h, w});
  job.right = check.input<double>("right", right, {n, h, w - 1});
  job.down = check.input<double>("down", down, {n, h - 1, w});
  job.result = check.output<double>("result", result, {n, h, w});
  require(reweightings >= 1 && reweightings <= 100, "reweightings is not in 1..100");
  require(least > 0 && anchor_width > 0 && tie_width > 0, "least and the widths are not above 0");
  job.reweightings = reweightings;
  job.least = least, job.anchor_width = anchor_width, job.tie_width = tie_width;
  if (n == 0) return;
  nb::gil_scoped_release unlocked;
  const Dissection order = dissection(h, w);
  job.order = &order;
  const auto kernel = R2_BEST(complete_images);
  Region region;
  std::vector<std::vector<Aligned>> scratch(region.workers());
  region.parallel_for((n + kCompletionLanes - 1) / kCompletionLanes, [&](int64_t task, int worker) {
    auto& mine = scratch[worker];
    if (mine.empty()) mine.resize(completion_scratch(order));
    kernel(job, task * kCompletionLanes, mine.data()->lanes);
  });
}

}  // namespace

void bind_completion(nb::module_& m) {
  m.def("complete", &complete, as_is("distance"), as_is("anchor"), as_is("prior"), as_is("right"), as_is("down"),
        nb::arg("reweightings"), nb::arg("least"), nb::arg("anchor_width"), nb::arg("tie_width"), as_is("result"),
        "Reweighted least squares of images (n, h, w) between anchors; see priors/completion/solve.py.");
}

}  // namespace room2dgs
