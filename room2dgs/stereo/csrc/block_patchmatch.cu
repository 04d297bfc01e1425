// See block_patchmatch.h. A thread a pixel; a sweep writes the pixels of one colour and reads planes of the other.
#include "block_patchmatch.h"

#include "patchmatch_maths.h"

namespace R2_ISA {
namespace {

constexpr int kThreadsOfMatch = 128;

// The threads' pixels of one colour, rows one after another: f(row, index in the row).
template <class F>
R2_KERNEL void pixels_of(const Block<kThreadsOfMatch>& block, const StereoJob& job, int colour, const F& f) {
  block.threads([&](int thread) {
    const int64_t half = room2dgs::stereo_half(job.width), place = block.place(thread);
    const int64_t row = place / half, index = place % half;
    if (row < job.height && 2 * index + ((row + colour) & 1) < job.width) f(row, index);
  });
}

struct StartPlanes {
  static constexpr int kThreads = kThreadsOfMatch;
  struct Shared {};
  const StereoJob* job;
  int colour;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    pixels_of(block, *job, colour, [&](int64_t row, int64_t i) { stereo_start<float>(*job, colour, row, i); });
  }
};

struct SweepPlanes {
  static constexpr int kThreads = kThreadsOfMatch;
  struct Shared {};
  const StereoJob* job;
  StereoSweep how;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    pixels_of(block, *job, how.colour, [&](int64_t row, int64_t i) { stereo_sweep<float>(*job, how, row, i); });
  }
};

struct CostOfPlanes {
  static constexpr int kThreads = kThreadsOfMatch;
  struct Shared {};
  const StereoJob* job;
  int colour;
  float *cost, *variance;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    pixels_of(block, *job, colour,
              [&](int64_t row, int64_t i) { stereo_cost<float>(*job, colour, row, i, cost, variance); });
  }
};

int64_t blocks_of(const StereoJob& job) {
  return blocks_for(room2dgs::stereo_half(job.width) * job.height, kThreadsOfMatch);
}

template <class T>
T* moved(const Queue& queue, DeviceBuffer<T>& to, const T* from, int64_t count) {
  from_host(queue, to.grow(queue, count), from, count);
  return to.data();
}

}  // namespace

BlockMatch::BlockMatch(const StereoJob& job, uint64_t queue)
    : job_(job), queue_(queue), current_(queue_), plane_(room2dgs::stereo_plane_size(job.width, job.height)), there_(job) {
  const int64_t wide = job.width + 2 * kStereoMargin, tall = job.height + 2 * kStereoMargin;
  const int64_t fields = room2dgs::kStereoFields * room2dgs::kStereoMaxViews;
  there_.grey = moved(queue_, grey_, job.grey, wide * tall);
  there_.table = moved(queue_, table_, job.table, fields);
  there_.quads = moved(queue_, quads_, job.quads, job.words);
  if (job.inverse_depth) there_.inverse_depth = moved(queue_, depths_, job.inverse_depth, job.depths);
  there_.judges = moved(queue_, judges_, static_cast<const int32_t*>(job.judges), plane_);
  float* planes = planes_.grow(queue_, 7 * plane_);
  const float* from[7] = {job.w, job.gx, job.gy, job.cost, job.hint_w, job.hint_gx, job.hint_gy};
  for (int k = 0; k < 7; ++k)
    if (from[k]) from_host(queue_, planes + k * plane_, from[k], plane_);
  there_.w = planes, there_.gx = planes + plane_, there_.gy = planes + 2 * plane_, there_.cost = planes + 3 * plane_;
  if (job.hint_w)
    there_.hint_w = planes + 4 * plane_, there_.hint_gx = planes + 5 * plane_, there_.hint_gy = planes + 6 * plane_;
  moved(queue_, argument_, static_cast<const StereoJob*>(&there_), 1);
}

void BlockMatch::start() {
  for (int colour = 0; colour < 2; ++colour)
    launch(queue_, blocks_of(job_), StartPlanes{argument_.data(), colour});
}

void BlockMatch::sweep(const StereoSweep& how) { launch(queue_, blocks_of(job_), SweepPlanes{argument_.data(), how}); }

void BlockMatch::costs(float* cost, float* variance) {
  const int64_t pixels = job_.width * job_.height;
  float* maps = maps_.grow(queue_, 2 * pixels);
  for (int colour = 0; colour < 2; ++colour)
    launch(queue_, blocks_of(job_), CostOfPlanes{argument_.data(), colour, maps, maps + pixels});
  to_host(queue_, cost, maps, pixels), to_host(queue_, variance, maps + pixels, pixels);
}

void BlockMatch::give_back() {
  float* to[4] = {job_.w, job_.gx, job_.gy, job_.cost};
  for (int k = 0; k < 4; ++k) to_host(queue_, to[k], planes_.data() + k * plane_, plane_);
  to_host(queue_, job_.judges, judges_.data(), plane_);
}

}  // namespace R2_ISA
