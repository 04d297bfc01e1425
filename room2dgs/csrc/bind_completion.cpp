// Binds the completion of depth between anchors, what other views say of it, and what they look through.
#include <algorithm>
#include <memory>
#include <new>
#include <vector>

#include "arrays.h"
#include "completion.h"
#include "free_space.h"
#include "other_views.h"
#include "parallel.h"

namespace room2dgs {
namespace {

constexpr int64_t kMostPixels = int64_t(1) << 22;  // of an image: the elimination's memory grows faster than its pixels

struct Aligned {  // a vector's worth of bytes for AVX
  alignas(32) double lanes[kCompletionLanes];
};

void complete(const Input& distance, const Input& anchor, const Input& prior, const Input& right, const Input& down,
              const Input& step_right, const Input& step_down, int64_t reweightings, double least, double anchor_width,
              double tie_width, const Output& result) {
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
  job.step_right = check.input<double>("step_right", step_right, {n, h, w - 1});
  job.step_down = check.input<double>("step_down", step_down, {n, h - 1, w});
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

constexpr int64_t kMostVotes = int64_t(1) << 26;  // of a view: a gigabyte of a worker's scratch

// The places of the views in arrays that hold all of them one after the other, and the largest view.
std::vector<int64_t> first_pixels(const int64_t* size, int64_t views, int64_t total, int64_t& most) {
  std::vector<int64_t> first;
  int64_t pixels = most = 0;
  for (int64_t view = 0; view < views; ++view) {
    const int64_t height = size[2 * view], width = size[2 * view + 1];
    require(height >= 1 && width >= 1 && height <= kMostPixels / width, "images are not of 1 to 2^22 pixels");
    first.push_back(pixels);
    pixels += height * width;
    most = std::max(most, height * width);
  }
  require(pixels == total, "depth has " + std::to_string(total) + " pixels, the views " + std::to_string(pixels));
  return first;
}

void depth_of_other_views(const Input& depth, const Input& sure, const Input& size, const Input& near, const Input& warp,
                          double least, double same, const Output& result, const Output& trust) {
  Arguments check;
  OtherViewsJob job = {};
  const int64_t total = lengths("depth", depth, 1)[0];
  const auto shape = lengths("near", near, 2);
  job.views = shape[0], job.neighbours = shape[1];
  job.depth = check.input<float>("depth", depth, {total});
  job.sure = check.input<float>("sure", sure, {total});
  job.size = check.input<int64_t>("size", size, {job.views, 2});
  job.near = check.input<int64_t>("near", near, {job.views, job.neighbours});
  job.warp = check.input<double>("warp", warp, {job.views, job.neighbours, 3, 4});
  job.result = check.output<float>("result", result, {total});
  job.trust = check.output<float>("trust", trust, {total});
  require(least >= 0 && same > 0, "least is below 0 or same not above it");
  job.least = least, job.same = same;
  int64_t most = 0;
  const std::vector<int64_t> first = first_pixels(job.size, job.views, total, most);
  job.first = first.data();
  for (int64_t k = 0; k < job.views * job.neighbours; ++k)
    require(job.near[k] >= -1 && job.near[k] < job.views, "near names a view that is not there");
  require(job.neighbours <= kMostVotes / std::max<int64_t>(most, 1), "near has too many views for images of this size");
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(depth_of_other_views);
  struct Buffers {
    std::unique_ptr<Vote[]> votes;
    std::vector<int32_t> count, met;
    std::vector<double> sum, sums;
  };
  Region region;
  std::vector<Buffers> scratch(region.workers());
  region.parallel_for(job.views, [&](int64_t view, int worker) {
    Buffers& mine = scratch[worker];
    if (!mine.votes) {
      mine.votes.reset(new Vote[most * job.neighbours]);
      mine.count.resize(most), mine.met.resize(most), mine.sum.resize(most), mine.sums.resize(most);
    }
    kernel(job, view, {mine.votes.get(), mine.count.data(), mine.sum.data(), mine.sums.data(), mine.met.data()});
  });
}

constexpr int64_t kMostCells = int64_t(1) << 31, kPointsPerTask = 4096;

// Corner and side of the cells, and their number along each axis: the shape of `through`.
Cells cells_of(Arguments& check, const Input& corner, double side, const int64_t* shape) {
  Cells cells = {};
  std::copy_n(check.input<double>("corner", corner, {3}), 3, cells.corner);
  cells.side = side;
  require(side > 0, "side is not above 0");
  require(shape[0] > 0 && shape[1] > 0 && shape[2] > 0 && shape[0] <= kMostCells / shape[1] &&
              shape[0] * shape[1] <= kMostCells / shape[2],
          "through is not of 1 to 2^31 cells");
  std::copy_n(shape, 3, cells.shape);
  return cells;
}

void count_rays(const Input& corner, double side, const Input& centres, const Input& first, const Input& ends, double from,
                double up_to, const Output& through, const Output& ended) {
  Arguments check;
  RaysJob job = {};
  const auto shape = lengths("through", through, 3);
  job.cells = cells_of(check, corner, side, shape.data());
  job.views = lengths("centres", centres, 2)[0];
  const int64_t count = lengths("ends", ends, 2)[0];
  job.centre = check.input<double>("centres", centres, {job.views, 3});
  job.first = check.input<int64_t>("first", first, {job.views + 1});
  job.ends = check.input<double>("ends", ends, {count, 3});
  job.through = check.output<int32_t>("through", through, {shape[0], shape[1], shape[2]});
  job.ended = check.output<int32_t>("ended", ended, {shape[0], shape[1], shape[2]});
  require(from >= 0 && up_to >= 0 && up_to <= 1, "from is below 0 or up_to not in 0..1");
  job.from = from, job.up_to = up_to;
  require(job.first[0] == 0 && job.first[job.views] == count, "first does not begin with 0 and end with the number of ends");
  for (int64_t view = 0; view < job.views; ++view) require(job.first[view] <= job.first[view + 1], "first falls");
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(count_rays);
  Region region;
  std::vector<std::vector<uint8_t>> marks(region.workers());
  region.parallel_for(job.views, [&](int64_t view, int worker) {
    if (marks[worker].empty()) marks[worker].resize(shape[0] * shape[1] * shape[2]);
    kernel(job, view, marks[worker].data());
  });
}

void seen_through(const Input& corner, double side, const Input& through, const Input& ended, const Input& xyz, double doubt,
                  const Output& share) {
  Arguments check;
  SeenThroughJob job = {};
  const auto shape = lengths("through", through, 3);
  job.cells = cells_of(check, corner, side, shape.data());
  const int64_t points = lengths("xyz", xyz, 2)[0];
  job.through = check.input<int32_t>("through", through, {shape[0], shape[1], shape[2]});
  job.ended = check.input<int32_t>("ended", ended, {shape[0], shape[1], shape[2]});
  job.xyz = check.input<double>("xyz", xyz, {points, 3});
  job.share = check.output<double>("share", share, {points});
  require(doubt > 0, "doubt is not above 0");
  job.doubt = doubt;
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(seen_through);
  parallel_for((points + kPointsPerTask - 1) / kPointsPerTask, [&](int64_t task, int) {
    kernel(job, task * kPointsPerTask, std::min((task + 1) * kPointsPerTask, points));
  });
}

}  // namespace

void bind_completion(nb::module_& m) {
  m.def("complete", &complete, as_is("distance"), as_is("anchor"), as_is("prior"), as_is("right"), as_is("down"),
        as_is("step_right"), as_is("step_down"), nb::arg("reweightings"), nb::arg("least"), nb::arg("anchor_width"),
        nb::arg("tie_width"), as_is("result"),
        "Reweighted least squares of images (n, h, w) between anchors; see priors/completion/solve.py.");
  m.def("depth_of_other_views", &depth_of_other_views, as_is("depth"), as_is("sure"), as_is("size"), as_is("near"),
        as_is("warp"), nb::arg("least"), nb::arg("same"), as_is("result"), as_is("trust"),
        "Depth of each view that its neighbours' makes, and the trust in it; see priors/completion/other_views.py.");
  m.def("count_rays", &count_rays, as_is("corner"), nb::arg("side"), as_is("centres"), as_is("first"), as_is("ends"),
        nb::arg("from_m"), nb::arg("up_to"), as_is("through"), as_is("ended"),
        "Adds how many views look through each cell, and end in it; see priors/completion/free_space.py.");
  m.def("seen_through", &seen_through, as_is("corner"), nb::arg("side"), as_is("through"), as_is("ended"), as_is("xyz"),
        nb::arg("doubt"), as_is("share"),
        "Share of the views' word that there is nothing at points; see priors/completion/free_space.py.");
}

}  // namespace room2dgs
