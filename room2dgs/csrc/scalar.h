// What templated maths needs of a scalar type: fma, vsqrt, select and a mask, for float and for eight lanes.
#pragma once

#include "simd.h"

#ifdef __CUDACC__
#define R2_HD inline __host__ __device__
#else
#define R2_HD inline __attribute__((always_inline))
#endif

namespace R2_ISA {

R2_HD float fma(float a, float b, float c) {
#if defined(__FMA__) || defined(__CUDA_ARCH__)
  return __builtin_fmaf(a, b, c);
#else
  return a * b + c;
#endif
}
R2_HD float vsqrt(float x) { return __builtin_sqrtf(x); }
R2_HD float select(bool mask, float yes, float no) { return mask ? yes : no; }

template <class T>
struct MaskOf;
template <>
struct MaskOf<float> {
  using type = bool;
};
template <>
struct MaskOf<f8> {
  using type = i8;
};

}  // namespace R2_ISA
