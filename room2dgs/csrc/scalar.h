// What templated maths needs of a scalar type: fma, vsqrt, select, masks and broadcasts, for float and double here and
// for eight lanes in simd.h. Free of intrinsics, so that a compiler for another machine reads it too: it defines R2_HD
// (how a function is marked) and R2_ISA (the namespace of its own copy) as it needs.
#pragma once

#include <cstdint>
#include <cstring>

#ifndef R2_ISA
#define R2_ISA isa_baseline
#endif

#ifndef R2_HD
#ifdef __CUDACC__
#define R2_HD inline __host__ __device__
#else
#define R2_HD inline __attribute__((always_inline))
#endif
#endif

namespace R2_ISA {

// Fused where the hardware does it, and the same operation in forward and backward everywhere.
R2_HD double fma(double a, double b, double c) {
#if defined(__CUDA_ARCH__)
  return ::fma(a, b, c);
#elif defined(__FMA__)
  return __builtin_fma(a, b, c);
#else
  return a * b + c;
#endif
}
R2_HD float fma(float a, float b, float c) {
#if defined(__CUDA_ARCH__)
  return ::fmaf(a, b, c);
#elif defined(__FMA__)
  return __builtin_fmaf(a, b, c);
#else
  return a * b + c;
#endif
}
R2_HD double vsqrt(double x) {
#if defined(__CUDA_ARCH__)
  return ::sqrt(x);
#else
  return __builtin_sqrt(x);
#endif
}
R2_HD float vsqrt(float x) {
#if defined(__CUDA_ARCH__)
  return ::sqrtf(x);
#else
  return __builtin_sqrtf(x);
#endif
}
R2_HD double select(bool mask, double yes, double no) { return mask ? yes : no; }
R2_HD float select(bool mask, float yes, float no) { return mask ? yes : no; }
R2_HD float masked(bool mask, float x) { return mask ? x : 0.0f; }
R2_HD bool inverted(bool mask) { return !mask; }
R2_HD float vmin(float a, float b) { return a < b ? a : b; }  // b where a is NaN
R2_HD float vmax(float a, float b) { return a > b ? a : b; }

// The type of a comparison's result, and a number in every lane.
template <class F>
struct Lanes;
template <>
struct Lanes<float> {
  using Mask = bool;
  static R2_HD float all(float x) { return x; }
};
template <class F>
using Mask = typename Lanes<F>::Mask;

// 2^x for -24 <= x < 100, relative error below 1e-7; smaller x counts as -24. The same steps as for eight lanes.
R2_HD float exp2_from(float x) {
  x = vmax(x, -24.0f);
  const float magic = 12582912.0f;  // leaves the rounded x in the low bits
  const float shifted = x + magic;
  const float f = x - (shifted - magic);
  float p = 0.001327647129073739f;
  p = fma(p, f, 0.009675540961325169f);
  p = fma(p, f, 0.05550713092088699f);
  p = fma(p, f, 0.24022120237350464f);
  p = fma(p, f, 0.6931469440460205f);
  p = fma(p, f, 1.0000001192092896f);
  int32_t power, bits;
  memcpy(&power, &shifted, 4), memcpy(&bits, &p, 4);
  bits += static_cast<int32_t>(static_cast<uint32_t>(power) << 23);
  memcpy(&p, &bits, 4);
  return p;
}

}  // namespace R2_ISA
