// What the primitive of block code promises, as small kernels. Compiled as plain C++ by test_block.py, and by nvcc where
// there is one. Prints a line for each fact that does not hold.
#include <cmath>
#include <cstdio>
#include <vector>

#include "launch.h"
#include "sort_scan.h"

using namespace R2_ISA;

// Each thread's numbers summed over warps and over the block; 20 sums, as a surfel has.
struct SumKernel {
  static constexpr int kThreads = 128, kSums = 20;
  struct Shared {
    float parts[kThreads / kWarp][kSums], total[kSums];
  };
  const float* values;  // (blocks * kThreads, kSums)
  float* sums;          // (blocks, kSums)
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    Own<Sums<float, kSums>, kThreads> mine;
    block.threads([&](int thread) {
      for (int k = 0; k < kSums; ++k) mine[thread].value[k] = values[block.place(thread) * kSums + k];
    });
    block.sums(mine, s.parts, s.total);
    block.threads([&](int thread) {
      if (thread < kSums) sums[block.index() * kSums + thread] = s.total[thread];
    });
  }
};

// A phase hands numbers to the next through shared memory; `race` reads them before the barrier.
struct TurnKernel {
  static constexpr int kThreads = 64;
  struct Shared {
    int numbers[kThreads];
  };
  int* out;
  bool race;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    block.threads([&](int thread) {
      s.numbers[thread] = static_cast<int>(block.place(thread));
      if (race) out[block.place(thread)] = s.numbers[thread ^ 1];
    });
    block.threads([&](int thread) {
      if (!race) out[block.place(thread)] = s.numbers[thread ^ 1];
    });
  }
};

// Votes of a warp and of a block.
struct VoteKernel {
  static constexpr int kThreads = 64;
  struct Shared {};
  const int* numbers;
  uint32_t* odd;  // a word a warp
  int* largest;   // of a warp
  bool* any;      // of a block: a number above 1000
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    block.warps([&](const Warp& warp) {
      Own<bool, kWarp> is_odd;
      Own<int, kWarp> number;
      warp.lanes([&](int lane) {
        number[lane] = numbers[block.place(warp.thread(lane))];
        is_odd[lane] = number[lane] & 1;
      });
      const uint32_t bits = warp.ballot(is_odd);
      const int most = warp.largest(number);
      const int64_t place = block.index() * (kThreads / kWarp) + warp.index;
      warp.lanes([&](int lane) {
        if (lane == 0) odd[place] = bits, largest[place] = most;
      });
    });
    Own<bool, kThreads> high;
    block.threads([&](int thread) { high[thread] = numbers[block.place(thread)] > 1000; });
    const bool found = block.any(high);
    block.threads([&](int thread) {
      if (thread == 0) any[block.index()] = found;
    });
  }
};

#if !defined(R2_CUDA)

int failed = 0;
void require(bool holds, const char* fact) {
  if (!holds) ++failed, std::printf("%s\n", fact);
}

int main() {
  constexpr int kBlocks = 37, kSums = SumKernel::kSums, kThreads = SumKernel::kThreads;
  std::vector<float> values(kBlocks * kThreads * kSums), sums(kBlocks * kSums), again(sums);
  for (size_t k = 0; k < values.size(); ++k) values[k] = std::sin(static_cast<float>(k)) * static_cast<float>(1 + k % 7);
  launch(Queue(0), kBlocks, SumKernel{values.data(), sums.data()});
  for (uint64_t seed = 1; seed < 6; ++seed) {
    launch(Queue(seed), kBlocks, SumKernel{values.data(), again.data()});
    require(sums == again, "sums have the same bits in any order of blocks and threads");
  }
  for (int block = 0; block < kBlocks; ++block)
    for (int k = 0; k < kSums; ++k) {
      double sum = 0;
      for (int t = 0; t < kThreads; ++t) sum += values[(block * kThreads + t) * kSums + k];
      require(std::fabs(sum - sums[block * kSums + k]) < 1e-3, "each sum is that of its numbers");
    }
  for (int n = 1; n <= 40; ++n) {
    std::vector<int> found(n);
    for (int lane = 0; lane < kWarp; ++lane)
      if (const int k = sum_of_lane(lane, n); k >= 0 && n <= kWarp) ++found[k];
    for (int k = 0; k < n && n <= kWarp; ++k) require(found[k] == 1, "every sum is with one lane");
  }

  constexpr int kTurns = 8 * TurnKernel::kThreads;
  std::vector<int> in_order(kTurns), scrambled(kTurns);
  launch(Queue(0), 8, TurnKernel{in_order.data(), false});
  launch(Queue(3), 8, TurnKernel{scrambled.data(), false});
  require(in_order == scrambled && in_order[6] == 7, "a barrier makes what was written visible");
  bool differs = false;
  launch(Queue(0), 8, TurnKernel{in_order.data(), true});
  for (uint64_t seed = 1; seed < 6; ++seed) {
    launch(Queue(seed), 8, TurnKernel{scrambled.data(), true});
    differs |= in_order != scrambled;
  }
  require(differs, "a missing barrier is seen in a scrambled order");

  std::vector<int> numbers(4 * VoteKernel::kThreads), largest(8);
  std::vector<uint32_t> odd(8);
  bool any[4];
  for (size_t k = 0; k < numbers.size(); ++k) numbers[k] = static_cast<int>(k * k % 301);
  numbers[130] = 2001;
  launch(Queue(5), 4, VoteKernel{numbers.data(), odd.data(), largest.data(), any});
  for (int warp = 0; warp < 8; ++warp) {
    uint32_t bits = 0;
    int most = -1;
    for (int lane = 0; lane < kWarp; ++lane) {
      const int x = numbers[warp * kWarp + lane];
      bits |= static_cast<uint32_t>(x & 1) << lane, most = x > most ? x : most;
    }
    require(odd[warp] == bits && largest[warp] == most, "votes are those of all lanes");
  }
  require(!any[0] && !any[1] && any[2] && !any[3], "a block's vote is that of all its threads");

  Scratch scratch;
  const Queue queue(1);
  const uint32_t keys[] = {7 + 8, 2, 7, 0, 2 + 8, 5}, counts[] = {3, 0, 2, 5};
  const uint64_t values64[] = {0, 1, 2, 3, 4, 5};
  uint32_t sorted[6], begins[4];
  uint64_t moved[6];
  sort_pairs(queue, scratch, keys, sorted, values64, moved, 6, 3);
  const uint64_t expected[] = {3, 1, 4, 5, 0, 2};
  for (int k = 0; k < 6; ++k) require(moved[k] == expected[k] && sorted[k] == keys[expected[k]], "a stable sort by low bits");
  exclusive_sum(queue, scratch, counts, begins, 4);
  require(begins[0] == 0 && begins[1] == 3 && begins[2] == 3 && begins[3] == 5, "sums of all before");
  return failed != 0;
}

#else

template void R2_ISA::launch(const Queue&, int64_t, const SumKernel&);
template void R2_ISA::launch(const Queue&, int64_t, const TurnKernel&);
template void R2_ISA::launch(const Queue&, int64_t, const VoteKernel&);

#endif
