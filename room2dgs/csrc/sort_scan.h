// Prefix sums and sorts of block code: CUB's on CUDA, plain loops on the CPU.
#pragma once

#include "launch.h"

namespace R2_ISA {

// Room for both, kept between calls.
using Scratch = DeviceBuffer<unsigned char>;

// to[k] = from[0] + ... + from[k - 1] for k < count, modulo 2^32.
void exclusive_sum(const Queue& queue, Scratch& scratch, const uint32_t* from, uint32_t* to, int64_t count);

// Sorts by the lowest `bits` bits of the keys; pairs of equal keys stay in their order.
void sort_pairs(const Queue& queue, Scratch& scratch, const uint32_t* keys, uint32_t* sorted_keys,
                const uint32_t* values, uint32_t* sorted_values, int64_t count, int bits);
void sort_pairs(const Queue& queue, Scratch& scratch, const uint32_t* keys, uint32_t* sorted_keys,
                const uint64_t* values, uint64_t* sorted_values, int64_t count, int bits);

}  // namespace R2_ISA
