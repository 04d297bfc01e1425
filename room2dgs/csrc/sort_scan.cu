#include "sort_scan.h"

#if defined(__CUDACC__)
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#else
#include <algorithm>
#include <numeric>
#include <vector>
#endif

namespace R2_ISA {

#if defined(__CUDACC__)

void exclusive_sum(const Queue& queue, Scratch& scratch, const uint32_t* from, uint32_t* to, int64_t count) {
  if (count <= 0) return;
  size_t bytes = 0;
  cuda_check(cub::DeviceScan::ExclusiveSum(nullptr, bytes, from, to, count, queue.stream));
  void* room = scratch.grow(queue, static_cast<int64_t>(bytes));
  cuda_check(cub::DeviceScan::ExclusiveSum(room, bytes, from, to, count, queue.stream));
}

namespace {

template <class Value>
void sort(const Queue& queue, Scratch& scratch, const uint32_t* keys, uint32_t* sorted_keys, const Value* values,
          Value* sorted_values, int64_t count, int bits) {
  if (count <= 0) return;
  size_t bytes = 0;
  cuda_check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, sorted_keys, values, sorted_values, count, 0, bits,
                                             queue.stream));
  void* room = scratch.grow(queue, static_cast<int64_t>(bytes));
  cuda_check(cub::DeviceRadixSort::SortPairs(room, bytes, keys, sorted_keys, values, sorted_values, count, 0, bits,
                                             queue.stream));
}

}  // namespace

#else

void exclusive_sum(const Queue&, Scratch&, const uint32_t* from, uint32_t* to, int64_t count) {
  std::exclusive_scan(from, from + count, to, uint32_t{0});
}

namespace {

template <class Value>
void sort(const Queue&, Scratch&, const uint32_t* keys, uint32_t* sorted_keys, const Value* values,
          Value* sorted_values, int64_t count, int bits) {
  const uint32_t mask = bits >= 32 ? ~uint32_t{0} : (uint32_t{1} << bits) - 1;
  std::vector<int64_t> order(static_cast<size_t>(count));
  std::iota(order.begin(), order.end(), int64_t{0});
  std::stable_sort(order.begin(), order.end(), [&](int64_t a, int64_t b) { return (keys[a] & mask) < (keys[b] & mask); });
  for (int64_t k = 0; k < count; ++k) {
    sorted_keys[k] = keys[order[static_cast<size_t>(k)]];
    sorted_values[k] = values[order[static_cast<size_t>(k)]];
  }
}

}  // namespace

#endif

void sort_pairs(const Queue& queue, Scratch& scratch, const uint32_t* keys, uint32_t* sorted_keys,
                const uint32_t* values, uint32_t* sorted_values, int64_t count, int bits) {
  sort(queue, scratch, keys, sorted_keys, values, sorted_values, count, bits);
}
void sort_pairs(const Queue& queue, Scratch& scratch, const uint32_t* keys, uint32_t* sorted_keys,
                const uint64_t* values, uint64_t* sorted_values, int64_t count, int bits) {
  sort(queue, scratch, keys, sorted_keys, values, sorted_values, count, bits);
}

}  // namespace R2_ISA
