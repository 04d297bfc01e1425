// What templated maths needs of a scalar type: fma, vsqrt and select.
#pragma once

#include "simd.h"

#ifdef __CUDACC__
#define R2_HD inline __host__ __device__
#else
#define R2_HD inline __attribute__((always_inline))
#endif

namespace R2_ISA {

// Fused where the hardware does it, and the same operation in forward and backward everywhere.
R2_HD double fma(double a, double b, double c) {
#if defined(__FMA__) || defined(__CUDA_ARCH__)
  return __builtin_fma(a, b, c);
#else
  return a * b + c;
#endif
}
R2_HD double vsqrt(double x) { return __builtin_sqrt(x); }
R2_HD double select(bool mask, double yes, double no) { return mask ? yes : no; }

}  // namespace R2_ISA
