// Dense stereo for Python, whichever machine does the work: photos, planes and settings on the CPU, checked here by their
// declared types. Each build has a copy of its own (R2_ISA).
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <stdexcept>
#include <vector>

#include "arrays.h"
#include "patchmatch.h"
#include "scalar.h"

namespace R2_ISA {

using namespace room2dgs;

using Bytes = nb::ndarray<const uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Map = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using ConstMap = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Planes = nb::ndarray<float, nb::shape<3, -1, -1>, nb::c_contig, nb::device::cpu>;
using ConstPlanes = nb::ndarray<const float, nb::shape<3, -1, -1>, nb::c_contig, nb::device::cpu>;
using Pose = nb::ndarray<const double, nb::shape<3, 4>, nb::c_contig, nb::device::cpu>;

constexpr int64_t kMostPixelsAside = int64_t(1) << 15;  // positions are fixed point, 16 bits before the point
constexpr int64_t kMostPixels = int64_t(1) << 24;  // kernels index photos with floats

int64_t clamped(int64_t x, int64_t size) { return x < 0 ? 0 : x >= size ? size - 1 : x; }

// A grey photo with a replicated border: bytes, and for one gather a bilinear sample four neighbours in a word.
struct StereoPhoto {
  int64_t width, height;
  std::vector<uint8_t> grey;
  std::vector<uint32_t> quads;

  explicit StereoPhoto(Bytes photo) : width(photo.shape(1)), height(photo.shape(0)) {
    require(width >= 8 && height >= 8, "a photo for stereo has at least 8 x 8 pixels");
    const int64_t wide = width + 2 * kStereoMargin, tall = height + 2 * kStereoMargin;
    require(wide < kMostPixelsAside && tall < kMostPixelsAside && wide * tall < kMostPixels, "a photo for stereo has too many pixels");
    grey.resize(wide * tall), quads.resize(wide * tall);
    for (int64_t y = 0; y < tall; ++y) {
      const uint8_t* row = photo.data() + clamped(y - kStereoMargin, height) * width;
      for (int64_t x = 0; x < wide; ++x) grey[y * wide + x] = row[clamped(x - kStereoMargin, width)];
    }
    for (int64_t y = 0; y < tall; ++y) {
      const uint8_t *row = &grey[y * wide], *below = &grey[clamped(y + 1, tall) * wide];
      for (int64_t x = 0; x < wide; ++x) {
        const int64_t right = clamped(x + 1, wide);
        quads[y * wide + x] = uint32_t(row[x]) | uint32_t(below[x]) << 8 | uint32_t(row[right]) << 16 |
                              uint32_t(below[right]) << 24;
      }
    }
  }
};

// Held by the call that uses an object: a second thread is refused while the first one's kernels run.
class InUse {
 public:
  explicit InUse(std::atomic<bool>& flag) : flag_(flag) {
    if (flag_.exchange(true)) throw std::runtime_error("this PatchMatch is in use by another thread");
  }
  ~InUse() { flag_ = false; }
  InUse(const InUse&) = delete;

 private:
  std::atomic<bool>& flag_;
};

// One reference photo, its neighbours and the planes of its pixels. `Machine` works on a job: start, sweep, costs, and at
// last gives back planes that it had elsewhere.
template <class Machine>
class PatchMatch {
 public:
  PatchMatch(const StereoPhoto& photo, int radius, int step, double sigma_grey, double sigma_px, double variance_floor,
             int best, double w_min, double w_max, double slope_limit, double pixel_slope, uint32_t seed)
      : photo_(photo), size_(stereo_plane_size(photo.width, photo.height)) {
    require(radius >= 1 && radius <= 12 && step >= 1 && step <= radius, "window: 1 <= step <= radius <= 12");
    const int side = 2 * (radius / step) + 1;
    require(side * side <= kStereoMaxSamples, "window: too many samples; give a larger step");
    require(best >= 1 && best <= kStereoMaxBest, "best is 1 to 8");
    require(sigma_grey > 0 && sigma_px > 0 && variance_floor > 0, "sigma_grey, sigma_px and variance_floor are positive");
    require(w_min > 0 && w_max > w_min && w_max < 1e6, "inverse depths: 0 < w_min < w_max");
    require(slope_limit > 0 && pixel_slope > 0, "slope_limit and pixel_slope are positive");
    job_ = {};
    job_.width = photo.width, job_.height = photo.height, job_.grey = photo.grey.data();
    job_.best = best, job_.seed = seed;
    const int reach = radius / step * step;
    job_.side = side, job_.step = step, job_.reach = reach;
    const double log2e = 1.4426950408889634;
    for (int dy = -reach; dy <= reach; dy += step)
      for (int dx = -reach; dx <= reach; dx += step) {
        job_.dx[job_.samples] = static_cast<int16_t>(dx), job_.dy[job_.samples] = static_cast<int16_t>(dy);
        job_.spatial[job_.samples++] = static_cast<float>(-log2e * (dx * dx + dy * dy) / (2 * sigma_px * sigma_px));
      }
    job_.grey_scale = static_cast<float>(-log2e / (2 * sigma_grey * sigma_grey));
    job_.variance_floor = static_cast<float>(variance_floor);
    job_.w_min = static_cast<float>(w_min), job_.w_max = static_cast<float>(w_max);
    job_.slope_limit = static_cast<float>(slope_limit), job_.pixel_slope = static_cast<float>(pixel_slope);
    for (auto* plane : {&w_, &gx_, &gy_}) plane->assign(size_, 0.0f);
    cost_.assign(size_, 1e9f);
    judges_.assign(size_, 0);
    job_.w = w_.data(), job_.gx = gx_.data(), job_.gy = gy_.data(), job_.cost = cost_.data();
    job_.judges = judges_.data();
  }

  void add_view(const StereoPhoto& photo, Pose view_from_reference, Pose reference_from_view,
                std::optional<ConstMap> inverse_depth) {
    const InUse use(in_use_);
    const int n = job_.view_count;
    require(n < kStereoMaxViews, "too many neighbouring views");
    require(!inverse_depth || (int64_t(inverse_depth->shape(0)) == photo.height &&
                               int64_t(inverse_depth->shape(1)) == photo.width),
            "inverse_depth differs from its photo in size");
    require(n == 0 || inverse_depth.has_value() == !depths_.empty(), "all neighbouring views have an inverse_depth, or none");
    const auto set = [&](int field, float value) { table_[field * kStereoMaxViews + n] = value; };
    const auto set_whole = [&](int field, int32_t value) {
      std::memcpy(&table_[field * kStereoMaxViews + n], &value, sizeof value);
    };
    for (int k = 0; k < 12; ++k) {
      const double there = view_from_reference.data()[k], back = reference_from_view.data()[k];
      require(std::isfinite(there) && std::isfinite(back), "a view's warp is not finite");
      set(kStereoThere + k, static_cast<float>(there)), set(kStereoBack + k, static_cast<float>(back));
    }
    set(kStereoWidth, static_cast<float>(photo.width)), set(kStereoHeight, static_cast<float>(photo.height));
    set_whole(kStereoOffset, static_cast<int32_t>(quads_.size()));
    set_whole(kStereoStrides, static_cast<int32_t>((photo.width + 2 * kStereoMargin) << 16 | 1));
    set_whole(kStereoDepth, static_cast<int32_t>(depths_.size()));
    quads_.insert(quads_.end(), photo.quads.begin(), photo.quads.end());
    if (inverse_depth) depths_.insert(depths_.end(), inverse_depth->data(), inverse_depth->data() + photo.width * photo.height);
    job_.view_count = n + 1;
  }

  void set_planes(ConstPlanes planes) {
    const InUse use(in_use_);
    pack(planes, {&w_, &gx_, &gy_});
    std::fill(cost_.begin(), cost_.end(), 1e9f);
  }
  void set_hints(ConstPlanes planes) {
    const InUse use(in_use_);
    for (auto* plane : {&hint_w_, &hint_gx_, &hint_gy_}) plane->assign(size_, 0.0f);
    pack(planes, {&hint_w_, &hint_gx_, &hint_gy_});
    job_.hint_w = hint_w_.data(), job_.hint_gx = hint_gx_.data(), job_.hint_gy = hint_gy_.data();
  }

  void run(int iterations, double perturbation, int random_depths, double geometric_weight, uint32_t first_draw,
           bool thrifty, uint64_t queue) {
    const InUse use(in_use_);
    ready();
    require(iterations >= 0 && iterations <= 1000, "iterations are 0 to 1000");
    require(perturbation >= 0 && perturbation <= 10 && geometric_weight >= 0 && geometric_weight <= 100,
            "perturbation and geometric_weight are not negative");
    job_.geometric_weight = static_cast<float>(geometric_weight);
    nb::gil_scoped_release unlocked;
    Machine machine(job_, queue);
    machine.start();
    for (int k = 0; k < iterations; ++k) {
      const bool settled = k > 0 && k >= random_depths;
      for (int colour = 0; colour < 2; ++colour)
        machine.sweep({colour, first_draw + uint32_t(k) + 1, static_cast<float>(perturbation * std::pow(0.5, k)),
                       k < random_depths, settled, settled && thrifty});
    }
    machine.give_back();
  }

  void costs(double geometric_weight, Map cost, Map variance, uint64_t queue) {
    const InUse use(in_use_);
    ready();
    require(int64_t(cost.shape(0)) == job_.height && int64_t(cost.shape(1)) == job_.width &&
                int64_t(variance.shape(0)) == job_.height && int64_t(variance.shape(1)) == job_.width,
            "cost and variance differ from the photo in size");
    job_.geometric_weight = static_cast<float>(geometric_weight);
    float *to_cost = cost.data(), *to_variance = variance.data();
    nb::gil_scoped_release unlocked;
    Machine(job_, queue).costs(to_cost, to_variance);
  }

  void planes(Planes out) const {
    const InUse use(in_use_);
    require(int64_t(out.shape(1)) == job_.height && int64_t(out.shape(2)) == job_.width, "planes differ from the photo in size");
    const std::vector<float>* from[3] = {&w_, &gx_, &gy_};
    for (int part = 0; part < 3; ++part)
      for_pixels([&](int64_t pixel, int64_t at) { out.data()[part * job_.width * job_.height + pixel] = (*from[part])[at]; });
  }

 private:
  template <class Body>
  void for_pixels(const Body& body) const {
    for (int64_t row = 0; row < job_.height; ++row)
      for (int64_t x = 0; x < job_.width; ++x) {
        const int colour = static_cast<int>((x + row) & 1);
        body(row * job_.width + x, stereo_at(job_.width, job_.height, colour, row, x / 2));
      }
  }

  void pack(const ConstPlanes& planes, std::initializer_list<std::vector<float>*> to) {
    require(int64_t(planes.shape(1)) == job_.height && int64_t(planes.shape(2)) == job_.width,
            "planes differ from the photo in size");
    const float* from = planes.data();
    for (auto* plane : to) {
      for_pixels([&](int64_t pixel, int64_t at) { (*plane)[at] = std::isfinite(from[pixel]) ? from[pixel] : 0.0f; });
      from += job_.width * job_.height;
    }
  }

  void ready() {
    require(job_.view_count > 0, "there is no neighbouring view");
    require(job_.best <= job_.view_count, "best is more than the neighbouring views");
    job_.table = table_.data(), job_.quads = quads_.data(), job_.words = static_cast<int64_t>(quads_.size());
    job_.depths = static_cast<int64_t>(depths_.size());
    job_.inverse_depth = depths_.empty() ? nullptr : depths_.data();
  }

  const StereoPhoto& photo_;
  mutable std::atomic<bool> in_use_{false};
  int64_t size_;
  StereoJob job_;
  std::vector<float> table_ = std::vector<float>(kStereoFields * kStereoMaxViews);
  std::vector<uint32_t> quads_;  // of all views
  std::vector<float> depths_;
  std::vector<float> w_, gx_, gy_, cost_, hint_w_, hint_gx_, hint_gy_;
  std::vector<int32_t> judges_;
};

template <class Machine>
void bind_matching(nb::module_& m) {
  using Match = PatchMatch<Machine>;
  nb::class_<StereoPhoto>(m, "StereoPhoto", "A grey photo, packed for bilinear samples.")
      .def(nb::init<Bytes>(), nb::arg("grey").noconvert())
      .def_ro("width", &StereoPhoto::width)
      .def_ro("height", &StereoPhoto::height);
  nb::class_<Match>(m, "PatchMatch", "PatchMatch stereo of one photo; planes are (inverse depth, d/dx, d/dy).")
      .def(nb::init<const StereoPhoto&, int, int, double, double, double, int, double, double, double, double, uint32_t>(),
           nb::arg("photo"), nb::arg("radius"), nb::arg("step"), nb::arg("sigma_grey"), nb::arg("sigma_px"),
           nb::arg("variance_floor"), nb::arg("best"), nb::arg("w_min"), nb::arg("w_max"), nb::arg("slope_limit"),
           nb::arg("pixel_slope"), nb::arg("seed"), nb::keep_alive<1, 2>())
      .def("add_view", &Match::add_view, nb::arg("photo"), nb::arg("view_from_reference").noconvert(),
           nb::arg("reference_from_view").noconvert(), nb::arg("inverse_depth").noconvert().none())
      .def("set_planes", &Match::set_planes, nb::arg("planes").noconvert())
      .def("set_hints", &Match::set_hints, nb::arg("planes").noconvert())
      .def("run", &Match::run, nb::arg("iterations"), nb::arg("perturbation"), nb::arg("random_depths"),
           nb::arg("geometric_weight"), nb::arg("first_draw"), nb::arg("thrifty"), nb::arg("queue") = 0)
      .def("costs", &Match::costs, nb::arg("geometric_weight"), nb::arg("cost").noconvert(),
           nb::arg("variance").noconvert(), nb::arg("queue") = 0)
      .def("planes", &Match::planes, nb::arg("out").noconvert());
}

}  // namespace R2_ISA
