// Block code: one source that is a CUDA kernel and, compiled as plain C++, the same steps on the CPU: for tests, and for the
// multi-view terms of training, which have no kernel of their own there.
//
// A kernel is a struct of its arguments with
//
//   static constexpr int kThreads = 256;                       // of a block: a power of two, 32 or more
//   struct Shared { float values[kThreads]; };                 // plain data; undefined at first, and NaN on the CPU
//   R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const;
//
// Its body is a sequence of phases. `block.threads(f)` calls f(thread) for each thread, `block.warps(f)` calls f(warp)
// for each warp, and both end with a barrier; inside `warps`, `warp.lanes(f)` calls f(lane) for each lane and ends with
// a barrier of the warp. CUDA's threads each do their own part of a phase, at once; on the CPU they come one after
// another, in an order that the launcher may scramble. What a thread keeps from one phase to the next is an
// `Own<T, kThreads>`, what a lane keeps between two steps of its warp an `Own<T, kWarp>`; all else that outlives a phase
// must be the same for all threads (of the warp), and is changed between phases, never inside one.
//
// Within a phase no thread reads what another one writes, or the bits depend on the order: that is what the scrambled
// order is for. Sums and votes over the lanes of a warp (`sums`, `ballot`, `largest`) take the same order on both sides.
#pragma once

#include "scalar.h"

#ifdef __CUDACC__
#define R2_KERNEL __device__
#else
#define R2_KERNEL inline
#endif

namespace R2_ISA {

constexpr int kWarp = 32;

R2_HD int lowest_bit(uint32_t x) {
#if defined(__CUDA_ARCH__)
  return __ffs(static_cast<int>(x)) - 1;
#else
  return __builtin_ctz(x);
#endif
}
R2_HD int highest_bit(uint32_t x) {
#if defined(__CUDA_ARCH__)
  return 31 - __clz(static_cast<int>(x));
#else
  return 31 - __builtin_clz(x);
#endif
}

// The k-th 16 bytes of a `T`: one access for all of them where `T`s lie at multiples of 16.
template <class T>
R2_HD void copy_piece(T* to, const T* from, int k) {
#if defined(__CUDA_ARCH__)
  reinterpret_cast<float4*>(to)[k] = reinterpret_cast<const float4*>(from)[k];
#else
  memcpy(reinterpret_cast<char*>(to) + 16 * k, reinterpret_cast<const char*>(from) + 16 * k, 16);
#endif
}
// All of a `T` that a thread has in registers.
template <class T>
R2_HD void store_pieces(T* to, const T& from) {
  static_assert(sizeof(T) % 16 == 0, "whole pieces");
#if defined(__CUDA_ARCH__)
#pragma unroll
  for (int k = 0; k < static_cast<int>(sizeof(T) / 16); ++k) {
    float4 piece;
    memcpy(&piece, reinterpret_cast<const char*>(&from) + 16 * k, 16);
    reinterpret_cast<float4*>(to)[k] = piece;
  }
#else
  *to = from;
#endif
}

// A variable of each of `n` threads or lanes: a register on CUDA, an array here.
template <class T, int n>
class Own {
 public:
#if defined(__CUDA_ARCH__)
  R2_KERNEL T& operator[](int) { return value_; }
  R2_KERNEL const T& operator[](int) const { return value_; }

 private:
  T value_;
#else
  R2_KERNEL T& operator[](int i) { return values_[i]; }
  R2_KERNEL const T& operator[](int i) const { return values_[i]; }

 private:
  T values_[n];
#endif
};

// `n` numbers that are summed over a warp together.
template <class T, int n>
struct Sums {
  T value[n];
};

// Which of `n` sums `Warp::sums` leaves with a lane, or -1. Half of the numbers go to each half of the lanes, and so on.
R2_HD int sum_of_lane(int lane, int n) {
  int first = 0, count = n, room = n;  // `room`: as many numbers as the fuller lanes hold
  for (int offset = kWarp / 2; offset > 0; offset /= 2) {
    const int half = (room + 1) / 2;
    if (lane & offset) first += half, count = count > half ? count - half : 0;
    else count = count < half ? count : half;
    room = half;
  }
  return count > 0 ? first : -1;
}

struct Warp {
  int index;     // in its block
  int scramble;  // lanes come as (k ^ scramble) on the CPU

  R2_KERNEL int thread(int lane) const { return index * kWarp + lane; }

  template <class F>
  R2_KERNEL void lanes(const F& f) const {
#if defined(__CUDA_ARCH__)
    f(static_cast<int>(threadIdx.x) % kWarp);
    __syncwarp();
#else
    for (int k = 0; k < kWarp; ++k) f(k ^ scramble);
#endif
  }

  // A bit for each lane where `x` holds; the same for all lanes.
  R2_KERNEL uint32_t ballot(const Own<bool, kWarp>& x) const {
#if defined(__CUDA_ARCH__)
    return __ballot_sync(0xffffffffu, x[0]);
#else
    uint32_t bits = 0;
    for (int k = 0; k < kWarp; ++k) bits |= (x[k] ? 1u : 0u) << k;
    return bits;
#endif
  }

  // The largest of the lanes' numbers, the same for all lanes.
  R2_KERNEL int largest(const Own<int, kWarp>& x) const {
#if defined(__CUDA_ARCH__)
    return __reduce_max_sync(0xffffffffu, x[0]);
#else
    int most = x[0];
    for (int k = 1; k < kWarp; ++k) most = x[k] > most ? x[k] : most;
    return most;
#endif
  }

  // Sums of `n` numbers over the lanes, in one fixed order. Lane l then holds that of number sum_of_lane(l, n) in
  // value[0]. Lanes swap halves of what they still have to sum: about n shuffles, not the 5 n of one sum after another.
  template <class T, int n>
  R2_KERNEL void sums(Own<Sums<T, n>, kWarp>& x) const {
    halve<n, kWarp / 2>(x);
  }

  // The same sums to to[0..n) in shared memory, for all lanes to read.
  template <class T, int n>
  R2_KERNEL void sums(Own<Sums<T, n>, kWarp>& x, T* to) const {
    sums(x);
    lanes([&](int lane) {
      const int k = sum_of_lane(lane, n);
      if (k >= 0) to[k] = x[lane].value[0];
    });
  }

 private:
  template <int count, int offset, class T, int n>
  R2_KERNEL void halve(Own<Sums<T, n>, kWarp>& x) const {
    constexpr int half = (count + 1) / 2;
    auto given = [](const Sums<T, n>& s, int k, bool upper) -> T {
      const T high = k + half < count ? s.value[k + half] : T(0);
      return upper ? s.value[k] : high;
    };
    auto kept = [](const Sums<T, n>& s, int k, bool upper) -> T {
      const T high = k + half < count ? s.value[k + half] : T(0);
      return upper ? high : s.value[k];
    };
#if defined(__CUDA_ARCH__)
    Sums<T, n>& s = x[0];
    const bool upper = (threadIdx.x & offset) != 0;
#pragma unroll
    for (int k = 0; k < half; ++k) {
      const T other = __shfl_xor_sync(0xffffffffu, given(s, k, upper), offset);
      s.value[k] = kept(s, k, upper) + other;
    }
#else
    for (int k = 0; k < half; ++k) {
      T other[kWarp];
      for (int l = 0; l < kWarp; ++l) other[l ^ offset] = given(x[l], k, l & offset);
      for (int l = 0; l < kWarp; ++l) x[l].value[k] = kept(x[l], k, l & offset) + other[l];
    }
#endif
    if constexpr (offset > 1) halve<half, offset / 2>(x);
  }
};

template <int kThreads>
class Block {
  static_assert(kThreads >= kWarp && (kThreads & (kThreads - 1)) == 0, "whole warps, a power of two");

 public:
  static constexpr int kWarps = kThreads / kWarp;

  R2_KERNEL Block(int64_t index, int scramble) : index_(index), scramble_(scramble) {}

  R2_KERNEL int64_t index() const { return index_; }
  // The thread's number among those of all blocks.
  R2_KERNEL int64_t place(int thread) const { return index_ * kThreads + thread; }

  template <class F>
  R2_KERNEL void threads(const F& f) const {
#if defined(__CUDA_ARCH__)
    f(static_cast<int>(threadIdx.x));
    __syncthreads();
#else
    for (int k = 0; k < kThreads; ++k) f(k ^ scramble_);
#endif
  }

  template <class F>
  R2_KERNEL void warps(const F& f) const {
#if defined(__CUDA_ARCH__)
    f(Warp{static_cast<int>(threadIdx.x) / kWarp, 0});
    __syncthreads();
#else
    for (int k = 0; k < kWarps; ++k) f(Warp{k ^ (scramble_ / kWarp), scramble_ % kWarp});
#endif
  }

  // Whether `x` holds for any thread; the same for all of them.
  R2_KERNEL bool any(const Own<bool, kThreads>& x) const {
#if defined(__CUDA_ARCH__)
    return __syncthreads_or(x[0]) != 0;
#else
    bool found = false;
    for (int k = 0; k < kThreads; ++k) found |= x[k];
    return found;
#endif
  }

  // Sums of `n` numbers over the block's threads, in one fixed order, to sums[0..n); `parts` is room in shared memory.
  template <class T, int n>
  R2_KERNEL void sums(Own<Sums<T, n>, kThreads>& x, T (&parts)[kWarps][n], T* sums) const {
    static_assert(n <= kThreads, "a thread for each sum");
    warps([&](const Warp& warp) {
      Own<Sums<T, n>, kWarp> mine;
      warp.lanes([&](int lane) { mine[lane] = x[warp.thread(lane)]; });
      warp.sums(mine, parts[warp.index]);
    });
    threads([&](int thread) {
      if (thread >= n) return;
      T sum = 0;
      for (int w = 0; w < kWarps; ++w) sum += parts[w][thread];
      sums[thread] = sum;
    });
  }

 private:
  int64_t index_;
  int scramble_;
};

// Sums of what blocks left, `n` numbers each, by one block.
template <class T, int n>
struct AddParts {
  static constexpr int kThreads = 256;
  struct Shared {
    T parts[kThreads / kWarp][n], sums[n];
  };
  const T* from;
  int64_t count;
  R2_KERNEL void add(const Block<kThreads>& block, Shared& s) const {
    Own<Sums<T, n>, kThreads> mine;
    block.threads([&](int thread) {
      for (int k = 0; k < n; ++k) mine[thread].value[k] = 0;
      for (int64_t i = thread; i < count; i += kThreads)
        for (int k = 0; k < n; ++k) mine[thread].value[k] += from[i * n + k];
    });
    block.sums(mine, s.parts, s.sums);
  }
};

}  // namespace R2_ISA
