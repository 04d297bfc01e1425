// Eight-lane vectors, written with the compiler's vector extensions: one source for AVX2, SSE2 and NEON.
//
// Fused multiply-add is explicit (`fma`), because forward and backward must take the same branch for the same
// pixel, bit for bit; the build forbids contraction by the compiler.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

#ifndef R2_ISA
#define R2_ISA isa_baseline
#endif

namespace R2_ISA {

constexpr int kLanes = 8;
typedef float f8 __attribute__((vector_size(32)));
typedef int32_t i8 __attribute__((vector_size(32)));
typedef float f8u __attribute__((vector_size(32), aligned(4)));  // for unaligned loads and stores

#define R2_INLINE inline __attribute__((always_inline))

R2_INLINE f8 splat(float x) { return f8{x, x, x, x, x, x, x, x}; }
R2_INLINE i8 splat_i(int32_t x) { return i8{x, x, x, x, x, x, x, x}; }
R2_INLINE f8 load(const float* p) { return *reinterpret_cast<const f8u*>(p); }
R2_INLINE void store(float* p, f8 x) { *reinterpret_cast<f8u*>(p) = x; }
R2_INLINE f8 iota() { return f8{0, 1, 2, 3, 4, 5, 6, 7}; }

R2_INLINE f8 fma(f8 a, f8 b, f8 c) {
#if defined(__AVX2__) && defined(__FMA__)
  return _mm256_fmadd_ps(a, b, c);
#else
  return a * b + c;
#endif
}
R2_INLINE f8 as_float(i8 x) { f8 r; std::memcpy(&r, &x, 32); return r; }
R2_INLINE i8 as_int(f8 x) { i8 r; std::memcpy(&r, &x, 32); return r; }
R2_INLINE f8 select(i8 mask, f8 yes, f8 no) {
#if defined(__AVX2__)
  return _mm256_blendv_ps(no, yes, _mm256_castsi256_ps(reinterpret_cast<__m256i>(mask)));
#else
  return as_float((mask & as_int(yes)) | (~mask & as_int(no)));
#endif
}
R2_INLINE i8 select(i8 mask, i8 yes, i8 no) { return (mask & yes) | (~mask & no); }
// `x` where the mask is set, 0 elsewhere.
R2_INLINE f8 masked(i8 mask, f8 x) { return as_float(mask & as_int(x)); }
R2_INLINE f8 vmin(f8 a, f8 b) {  // b where a is NaN
#if defined(__AVX2__)
  return _mm256_min_ps(a, b);
#else
  return select(a < b, a, b);
#endif
}
R2_INLINE f8 vmax(f8 a, f8 b) {
#if defined(__AVX2__)
  return _mm256_max_ps(a, b);
#else
  return select(a > b, a, b);
#endif
}
R2_INLINE bool any(i8 mask) {
#if defined(__AVX2__)
  return _mm256_movemask_ps(_mm256_castsi256_ps(reinterpret_cast<__m256i>(mask))) != 0;
#else
  int32_t r = 0;
  for (int k = 0; k < kLanes; ++k) r |= mask[k];
  return r != 0;
#endif
}
R2_INLINE f8 vsqrt(f8 x) {
#if defined(__AVX2__)
  return _mm256_sqrt_ps(x);
#else
  f8 r;
  for (int k = 0; k < kLanes; ++k) r[k] = __builtin_sqrtf(x[k]);
  return r;
#endif
}
R2_INLINE f8 vround(f8 x) {  // to nearest, for |x| < 2^22
  const f8 magic = splat(12582912.0f);
  return (x + magic) - magic;
}

// exp(x) for x <= 0 with about 1 ulp; 0 below -87.
R2_INLINE f8 exp_nonpositive(f8 x) {
  const i8 flush = x < -87.0f;
  x = vmax(x, splat(-87.0f));
  const f8 n = vround(x * 1.44269504088896341f);
  f8 r = fma(n, splat(-0.693359375f), x);
  r = fma(n, splat(2.12194440e-4f), r);
  f8 p = splat(1.9875691500e-4f);
  p = fma(p, r, splat(1.3981999507e-3f));
  p = fma(p, r, splat(8.3334519073e-3f));
  p = fma(p, r, splat(4.1665795894e-2f));
  p = fma(p, r, splat(1.6666665459e-1f));
  p = fma(p, r, splat(5.0000001201e-1f));
  p = fma(p, r * r, r + 1.0f);
  const i8 exponent = (__builtin_convertvector(n, i8) + 127) << 23;
  return masked(~flush, p * as_float(exponent));
}

// Sum of the lanes in one fixed order.
R2_INLINE float hsum(f8 x) {
#if defined(__AVX2__)
  const __m128 low = _mm256_castps256_ps128(x), high = _mm256_extractf128_ps(x, 1);
  __m128 s = _mm_add_ps(low, high);
  s = _mm_add_ps(s, _mm_movehl_ps(s, s));
  s = _mm_add_ss(s, _mm_shuffle_ps(s, s, 1));
  return _mm_cvtss_f32(s);
#else
  const float a = x[0] + x[4], b = x[1] + x[5], c = x[2] + x[6], d = x[3] + x[7];
  return (a + c) + (b + d);
#endif
}

}  // namespace R2_ISA
