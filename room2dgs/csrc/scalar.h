// What templated maths needs of a scalar type: fma, vsqrt, select, masks and broadcasts, for float and double here, for
// eight floats in simd.h and for several doubles in doubles.h. Free of intrinsics, so that a compiler for another machine
// reads it too: it defines R2_HD
// (how a function is marked) and R2_ISA (the namespace of its own copy) as it needs.
#pragma once

#include <math.h>  // the C functions: inline ones of <cmath> must not be shared between instruction sets

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
R2_HD double vmin(double a, double b) { return a < b ? a : b; }
R2_HD double vmax(double a, double b) { return a > b ? a : b; }
R2_HD double vfloor(double x) { return ::floor(x); }
R2_HD double vceil(double x) { return ::ceil(x); }
R2_HD float narrow(double x) { return static_cast<float>(x); }
R2_HD double widen(float x) { return x; }

// The type of a comparison's result, a number in every lane, and the floats that go with doubles.
template <class F>
struct Lanes;
template <>
struct Lanes<float> {
  using Mask = bool;
  static R2_HD float all(float x) { return x; }
};
template <>
struct Lanes<double> {
  using Mask = bool;
  using Narrow = float;
};
template <class F>
using Mask = typename Lanes<F>::Mask;
template <class T>
using Narrow = typename Lanes<T>::Narrow;

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

// x = 2^power m with m from sqrt(1/2) to sqrt(2), for a normal number above 0.
constexpr uint64_t kRootHalf = 0x3fe6a09e667f3bcdull, kMantissa = (uint64_t{1} << 52) - 1;
R2_HD double mantissa_of(double x, double& power) {
  uint64_t bits;
  memcpy(&bits, &x, 8);
  bits = bits - kRootHalf + (uint64_t{1023} << 52);
  power = static_cast<double>(bits >> 52) - 1023;
  bits = (bits & kMantissa) + kRootHalf;
  memcpy(&x, &bits, 8);
  return x;
}
// Logarithm to base 2 of a normal number above 0, by double or several; within 1e-15 of the result or of 1, whichever is
// larger, and exact for powers of 2.
template <class T>
R2_HD T log2_of(T x) {
  T power;
  const T m = mantissa_of(x, power);
  const T s = (m - T(1)) / (m + T(1)), z = s * s;  // ln m = 2 atanh s
  T p = T(1.0 / 17);
  p = fma(z, p, T(1.0 / 15));
  p = fma(z, p, T(1.0 / 13));
  p = fma(z, p, T(1.0 / 11));
  p = fma(z, p, T(1.0 / 9));
  p = fma(z, p, T(1.0 / 7));
  p = fma(z, p, T(1.0 / 5));
  p = fma(z, p, T(1.0 / 3));
  p = fma(z, p, T(1));
  return fma(T(2.8853900817779268) * s, p, power);  // 2 / ln 2
}

}  // namespace R2_ISA
