// Binds dense stereo by the CPU's own kernels.
#include "agreement.h"
#include "arrays.h"
#include "parallel.h"
#include "stereo_match.h"

namespace room2dgs {
namespace {

constexpr int64_t kRowsPerTask = 2, kRowsOfAgreement = 32;
constexpr int64_t kMostPixels = 1 << 30;

class OnCpu {
 public:
  OnCpu(const StereoJob& job, uint64_t) : job_(job) {}
  void start() const {
    const auto kernel = R2_BEST(stereo_start_row);
    rows([&](int64_t row) { kernel(job_, row); });
  }
  void sweep(const StereoSweep& sweep) const {
    const auto kernel = R2_BEST(stereo_sweep_row);
    rows([&](int64_t row) { kernel(job_, sweep, row); });
  }
  void costs(float* cost, float* variance) const {
    const auto kernel = R2_BEST(stereo_cost_row);
    rows([&](int64_t row) { kernel(job_, row, cost, variance); });
  }
  void give_back() const {}

 private:
  template <class Body>
  void rows(const Body& body) const {
    const int64_t tasks = (job_.height + kRowsPerTask - 1) / kRowsPerTask;
    parallel_for(tasks, [&](int64_t task, int) {
      for (int64_t row = task * kRowsPerTask; row < job_.height && row < (task + 1) * kRowsPerTask; ++row) body(row);
    });
  }

  const StereoJob& job_;
};

void agree(const Input& own, const Input& theirs, const Input& there, const Input& back, double max_px,
           double max_relative, const Output& count, const Output& through, const Output& hidden, const Output& total,
           const Output& squares) {
  Arguments check;
  AgreementJob job = {};
  const auto size = lengths("own", own, 2), other = lengths("theirs", theirs, 2);
  job.height = size[0], job.width = size[1], job.rows = other[0], job.columns = other[1];
  require(job.rows > 0 && job.columns > 0 && job.rows <= kMostPixels / job.columns, "theirs is not of 1 to 2^30 pixels");
  require(std::max({job.height, job.width, job.rows, job.columns}) < 1 << 22, "an image has a side of 2^22 pixels or more");
  job.own = check.input<float>("own", own, {job.height, job.width});
  job.theirs = check.input<float>("theirs", theirs, {job.rows, job.columns});
  std::copy_n(check.input<double>("there", there, {3, 4}), 12, job.there);
  std::copy_n(check.input<double>("back", back, {3, 4}), 12, job.back);
  job.max_px = static_cast<float>(max_px), job.max_relative = static_cast<float>(max_relative);
  job.count = check.output<uint8_t>("count", count, {job.height, job.width});
  job.through = check.output<uint8_t>("through", through, {job.height, job.width});
  job.hidden = check.output<uint8_t>("hidden", hidden, {job.height, job.width});
  job.total = check.output<float>("total", total, {job.height, job.width});
  job.squares = check.output<float>("squares", squares, {job.height, job.width});
  nb::gil_scoped_release unlocked;
  const auto kernel = R2_BEST(agree_row);
  const int64_t tasks = (job.height + kRowsOfAgreement - 1) / kRowsOfAgreement;
  parallel_for(tasks, [&](int64_t task, int) {
    for (int64_t row = task * kRowsOfAgreement; row < job.height && row < (task + 1) * kRowsOfAgreement; ++row) kernel(job, row);
  });
}

}  // namespace

void bind_stereo(nb::module_& m) {
  R2_ISA::bind_matching<OnCpu>(m);
  m.def("agree", &agree, as_is("own"), as_is("theirs"), as_is("there"), as_is("back"), nb::arg("max_px"),
        nb::arg("max_relative"), as_is("count"), as_is("through"), as_is("hidden"), as_is("total"), as_is("squares"),
        "Adds what one neighbour says of a view's inverse depths; see stereo/agreement.py.");
}

}  // namespace room2dgs
