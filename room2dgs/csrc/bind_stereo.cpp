// Binds dense stereo by the CPU's own kernels.
#include "parallel.h"
#include "stereo_match.h"

namespace room2dgs {
namespace {

constexpr int64_t kRowsPerTask = 2;

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

}  // namespace

void bind_stereo(nb::module_& m) { R2_ISA::bind_matching<OnCpu>(m); }

}  // namespace room2dgs
