// Where block code (block.h) runs, and the memory that it works on: a CUDA stream, or this machine's CPU.
// One interface; R2_CUDA is defined in the build for CUDA.
#pragma once

#include <cstdint>
#include <cstring>
#include <utility>

#include "block.h"

#if defined(R2_CUDA)
#include <cuda_runtime_api.h>

#include <stdexcept>
#include <string>
#else
#include <algorithm>
#include <cstdlib>
#include <memory>
#include <new>
#include <numeric>
#include <random>
#include <vector>

#include "parallel.h"
#endif

namespace R2_ISA {

#if defined(R2_CUDA)

inline void cuda_check(cudaError_t error) {
  if (error != cudaSuccess) throw std::runtime_error(std::string("CUDA: ") + cudaGetErrorString(error));
}

// A stream of one device. `handle` is what torch calls `cuda_stream`.
struct Queue {
  cudaStream_t stream;
  int device;
  explicit Queue(uint64_t handle = 0, int on = 0) : stream(reinterpret_cast<cudaStream_t>(handle)), device(on) {}
};

// The device of a queue is the current one while this lives.
class OnDevice {
 public:
  explicit OnDevice(const Queue& queue) {
    cuda_check(cudaGetDevice(&before_));
    if (before_ != queue.device) cuda_check(cudaSetDevice(queue.device));
  }
  ~OnDevice() { cudaSetDevice(before_); }
  OnDevice(const OnDevice&) = delete;

 private:
  int before_ = 0;
};

inline void* device_allocate(const Queue& queue, size_t bytes) {
  void* data = nullptr;
  cuda_check(cudaMallocAsync(&data, bytes, queue.stream));
  return data;
}
inline void device_release(void* data) { cudaFree(data); }  // waits for what still uses it
inline void fill_bytes(const Queue& queue, void* data, int value, size_t bytes) {
  cuda_check(cudaMemsetAsync(data, value, bytes, queue.stream));
}
// The host's memory may change afterwards.
inline void bytes_from_host(const Queue& queue, void* to, const void* from, size_t bytes) {
  cuda_check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, queue.stream));
  cuda_check(cudaStreamSynchronize(queue.stream));
}
// Waits for the queue: the numbers are there.
inline void bytes_to_host(const Queue& queue, void* to, const void* from, size_t bytes) {
  cuda_check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, queue.stream));
  cuda_check(cudaStreamSynchronize(queue.stream));
}

// A value of the device on its way to the host, while the queue goes on.
template <class T>
class HostCopy {
 public:
  HostCopy() = default;
  ~HostCopy() {
    if (value_) cudaFreeHost(value_), cudaEventDestroy(arrived_);
  }
  HostCopy(const HostCopy&) = delete;
  void begin(const Queue& queue, const T* from) {
    if (!value_) {
      cuda_check(cudaEventCreateWithFlags(&arrived_, cudaEventDisableTiming));
      cuda_check(cudaMallocHost(&value_, sizeof(T)));
    }
    cuda_check(cudaMemcpyAsync(value_, from, sizeof(T), cudaMemcpyDeviceToHost, queue.stream));
    cuda_check(cudaEventRecord(arrived_, queue.stream));
  }
  const T& wait() {
    cuda_check(cudaEventSynchronize(arrived_));
    return *value_;
  }

 private:
  T* value_ = nullptr;
  cudaEvent_t arrived_{};
};

// Memory that one queue after the other works with: each waits for what the one before it has asked for.
class Turn {
 public:
  Turn() = default;
  ~Turn() {
    if (done_) cudaEventDestroy(done_);
  }
  Turn(const Turn&) = delete;

  class Mine {  // while it lives
   public:
    Mine(Turn& turn, const Queue& queue) : turn_(turn), queue_(queue) {
      if (!turn.done_) cuda_check(cudaEventCreateWithFlags(&turn.done_, cudaEventDisableTiming));
      else if (turn.last_ != queue.stream) cuda_check(cudaStreamWaitEvent(queue.stream, turn.done_, 0));
      turn.last_ = queue.stream;
    }
    ~Mine() { cudaEventRecord(turn_.done_, queue_.stream); }
    Mine(const Mine&) = delete;

   private:
    Turn& turn_;
    const Queue& queue_;
  };

 private:
  cudaEvent_t done_ = nullptr;
  cudaStream_t last_ = nullptr;
};

#if defined(__CUDACC__)

template <class Kernel>
__global__ void __launch_bounds__(Kernel::kThreads) block_kernel(const Kernel kernel) {
  __shared__ typename Kernel::Shared shared;
  kernel(Block<Kernel::kThreads>(blockIdx.x, 0), shared);
}

template <class Kernel>
void launch(const Queue& queue, int64_t blocks, const Kernel& kernel) {
  if (blocks <= 0) return;
  block_kernel<Kernel><<<static_cast<unsigned>(blocks), Kernel::kThreads, 0, queue.stream>>>(kernel);
  cuda_check(cudaGetLastError());
}

#endif

#else

// The order in which blocks and threads come: 0 for as they are numbered, anything else draws another.
struct Queue {
  uint64_t seed;
  explicit Queue(uint64_t handle = 0, int = 0) : seed(handle) {}
};

struct OnDevice {
  explicit OnDevice(const Queue&) {}
};

inline void* device_allocate(const Queue&, size_t bytes) {
  void* data = std::malloc(bytes);
  if (!data) throw std::bad_alloc();
  std::memset(data, 0xff, bytes);  // as shared memory: NaN, and indices that lead nowhere
  return data;
}
inline void device_release(void* data) { std::free(data); }
inline void fill_bytes(const Queue&, void* data, int value, size_t bytes) { std::memset(data, value, bytes); }
inline void bytes_from_host(const Queue&, void* to, const void* from, size_t bytes) { std::memcpy(to, from, bytes); }
inline void bytes_to_host(const Queue&, void* to, const void* from, size_t bytes) { std::memcpy(to, from, bytes); }

struct Turn {
  struct Mine {
    Mine(Turn&, const Queue&) {}
  };
};

template <class T>
class HostCopy {
 public:
  HostCopy() = default;
  HostCopy(const HostCopy&) = delete;
  void begin(const Queue&, const T* from) { value_ = *from; }
  const T& wait() const { return value_; }

 private:
  T value_;
};

template <class Kernel>
void launch(const Queue& queue, int64_t blocks, const Kernel& kernel) {
  if (blocks <= 0) return;
  std::vector<int64_t> order(static_cast<size_t>(blocks));
  std::iota(order.begin(), order.end(), int64_t{0});
  std::mt19937_64 draw(queue.seed);
  if (queue.seed) std::shuffle(order.begin(), order.end(), draw);
  const uint64_t drawn = queue.seed ? draw() : 0;
  using Shared = typename Kernel::Shared;
  room2dgs::Region region;
  std::vector<std::unique_ptr<Shared>> shared(static_cast<size_t>(region.workers()));
  for (auto& one : shared) one.reset(new Shared);
  region.parallel_for(blocks, [&](int64_t k, int worker) {
    const int64_t index = order[static_cast<size_t>(k)];
    Shared& mine = *shared[static_cast<size_t>(worker)];
    std::memset(static_cast<void*>(&mine), 0xff, sizeof mine);
    const int scramble = static_cast<int>((drawn * (2 * static_cast<uint64_t>(index) + 1)) >> 32) & (Kernel::kThreads - 1);
    kernel(Block<Kernel::kThreads>(index, scramble), mine);
  });
}

#endif

inline int64_t blocks_for(int64_t count, int threads) { return (count + threads - 1) / threads; }

// Memory of the device that only grows, uninitialised; for plain data. Growing loses what was there.
template <class T>
class DeviceBuffer {
 public:
  DeviceBuffer() = default;
  DeviceBuffer(DeviceBuffer&& other) noexcept { swap(other); }
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    swap(other);
    return *this;
  }
  ~DeviceBuffer() { release(); }
  T* grow(const Queue& queue, int64_t count) {
    if (count > capacity_) {
      release();
      const int64_t wanted = count + count / 4 + 64;
      data_ = static_cast<T*>(device_allocate(queue, sizeof(T) * static_cast<size_t>(wanted)));
      capacity_ = wanted;
    }
    return data_;
  }
  T* data() { return data_; }
  const T* data() const { return data_; }
  int64_t bytes() const { return capacity_ * static_cast<int64_t>(sizeof(T)); }

 private:
  void release() {
    if (data_) device_release(data_);
    data_ = nullptr, capacity_ = 0;
  }
  void swap(DeviceBuffer& other) {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
  }
  T* data_ = nullptr;
  int64_t capacity_ = 0;
};

template <class T>
void from_host(const Queue& queue, T* to, const T* from, int64_t count) {
  bytes_from_host(queue, to, from, sizeof(T) * static_cast<size_t>(count));
}
template <class T>
void to_host(const Queue& queue, T* to, const T* from, int64_t count = 1) {
  bytes_to_host(queue, to, from, sizeof(T) * static_cast<size_t>(count));
}

}  // namespace R2_ISA
