// Eight-lane vectors, written with the compiler's vector extensions: one source for AVX-512, AVX2,
// SSE2 and NEON. As many lanes as there are: wide.h.
//
// Fused multiply-add is explicit (`fma`), because forward and backward must take the same branch for the same
// pixel, bit for bit; the build forbids contraction by the compiler.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

#include "scalar.h"

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
R2_INLINE f8 gather(const float* p, i8 index) {
#if defined(__AVX2__)
  return _mm256_i32gather_ps(p, reinterpret_cast<__m256i>(index), 4);
#else
  f8 r;
  for (int k = 0; k < kLanes; ++k) r[k] = p[index[k]];
  return r;
#endif
}
R2_INLINE i8 gather(const int32_t* p, i8 index) {
#if defined(__AVX2__)
  return reinterpret_cast<i8>(_mm256_i32gather_epi32(p, reinterpret_cast<__m256i>(index), 4));
#else
  i8 r;
  for (int k = 0; k < kLanes; ++k) r[k] = p[index[k]];
  return r;
#endif
}
// The lanes of two vectors that constants name, 0 to 15.
#if defined(__clang__)
#define R2_PICKED(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define R2_PICKED(a, b, ...) __builtin_shuffle(a, b, i8{__VA_ARGS__})
#endif
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
#if defined(__AVX512VL__)
  return mask ? yes : no;  // the compiler keeps the mask in a register of a bit a lane
#elif defined(__AVX2__)
  return _mm256_blendv_ps(no, yes, _mm256_castsi256_ps(reinterpret_cast<__m256i>(mask)));
#else
  return as_float((mask & as_int(yes)) | (~mask & as_int(no)));
#endif
}
R2_INLINE i8 select(i8 mask, i8 yes, i8 no) { return (mask & yes) | (~mask & no); }
// `x` where the mask is set, 0 elsewhere.
R2_INLINE f8 masked(i8 mask, f8 x) {
#if defined(__AVX512VL__)
  return mask ? x : splat(0.0f);
#else
  return as_float(mask & as_int(x));
#endif
}
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
R2_INLINE i8 inverted(i8 mask) { return ~mask; }
template <>
struct Lanes<f8> {
  using Mask = i8;
  static R2_INLINE f8 all(float x) { return splat(x); }
};
// A bit a lane.
R2_INLINE uint32_t bits(i8 mask) {
#if defined(__AVX2__)
  return static_cast<uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(reinterpret_cast<__m256i>(mask))));
#else
  uint32_t r = 0;
  for (int k = 0; k < kLanes; ++k) r |= (mask[k] ? 1u : 0u) << k;
  return r;
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
// 2^x for -24 <= x < 100, relative error below 1e-7; smaller x counts as -24.
R2_INLINE f8 exp2_from(f8 x) {
  x = vmax(x, splat(-24.0f));
  const f8 magic = splat(12582912.0f);  // leaves the rounded x in the low bits
  const f8 shifted = x + magic;
  const f8 f = x - (shifted - magic);
  f8 p = splat(0.001327647129073739f);
  p = fma(p, f, splat(0.009675540961325169f));
  p = fma(p, f, splat(0.05550713092088699f));
  p = fma(p, f, splat(0.24022120237350464f));
  p = fma(p, f, splat(0.6931469440460205f));
  p = fma(p, f, splat(1.0000001192092896f));
  return as_float(as_int(p) + (as_int(shifted) << 23));
}
// e^x for -80 < x < 80, relative error below 2e-7, and 1 for 0 exactly; beyond, of the nearest such x.
R2_INLINE f8 exp_of(f8 x) {
  x = vmin(vmax(x, splat(-80.0f)), splat(80.0f));
  const f8 magic = splat(12582912.0f);  // leaves the rounded power of 2 in the low bits
  const f8 shifted = fma(x, splat(1.44269504f), magic), power = shifted - magic;
  const f8 f = fma(power, splat(2.1219444e-4f), fma(power, splat(-0.693359375f), x));  // ln 2 in two parts
  f8 p = splat(1.0f / 5040.0f);
  p = fma(p, f, splat(1.0f / 720.0f));
  p = fma(p, f, splat(1.0f / 120.0f));
  p = fma(p, f, splat(1.0f / 24.0f));
  p = fma(p, f, splat(1.0f / 6.0f));
  p = fma(p, f, splat(0.5f));
  p = fma(p, f, splat(1.0f));
  p = fma(p, f, splat(1.0f));
  return as_float(as_int(p) + (as_int(shifted) << 23));
}
// Natural logarithm of a normal number above 0, error below 1e-7 of the result or of 1, whichever is less.
R2_INLINE f8 log_of(f8 x) {
  // x = 2^power m with m in sqrt(1/2)..sqrt(2); ln m = 2 atanh((m - 1) / (m + 1))
  const i8 from_root = as_int(x) - 0x3f3504f3;
  const f8 power = __builtin_convertvector(from_root >> 23, f8);
  const f8 m = as_float((from_root & 0x007fffff) + 0x3f3504f3);
  const f8 s = (m - 1.0f) / (m + 1.0f), z = s * s;
  f8 p = fma(z, splat(1.0f / 9.0f), splat(1.0f / 7.0f));
  p = fma(z, p, splat(1.0f / 5.0f));
  p = fma(z, p, splat(1.0f / 3.0f));
  p = fma(s * z, p, s) * 2.0f;
  // ln 2 in two parts: the first one's products with powers are exact
  return fma(power, splat(0.693359375f), fma(power, splat(-2.1219444e-4f), p));
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
