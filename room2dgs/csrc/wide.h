// As many lanes as the processor has for float: sixteen with AVX-512, else the eight of simd.h. Lane by lane both give the
// same bits.
#pragma once

#include "simd.h"

namespace R2_ISA {

#if defined(__AVX512F__)

constexpr int kWide = 16;
typedef float fw __attribute__((vector_size(64)));
typedef int32_t iw __attribute__((vector_size(64)));

R2_INLINE fw as_float(iw x) { return reinterpret_cast<fw>(x); }
R2_INLINE iw as_int(fw x) { return reinterpret_cast<iw>(x); }
template <>
struct Lanes<fw> {
  using Mask = iw;
  static R2_INLINE fw all(float x) { return _mm512_set1_ps(x); }
};
R2_INLINE iw all_wide(int32_t x) { return reinterpret_cast<iw>(_mm512_set1_epi32(x)); }
R2_INLINE fw load_wide(const float* p) { return _mm512_loadu_ps(p); }
R2_INLINE iw load_wide(const int32_t* p) { return reinterpret_cast<iw>(_mm512_loadu_si512(p)); }
R2_INLINE void store_wide(float* p, fw x) { _mm512_storeu_ps(p, x); }
R2_INLINE void store_wide(int32_t* p, iw x) { _mm512_storeu_si512(p, reinterpret_cast<__m512i>(x)); }
R2_INLINE fw fma(fw a, fw b, fw c) { return _mm512_fmadd_ps(a, b, c); }
R2_INLINE fw select(iw mask, fw yes, fw no) { return mask ? yes : no; }
R2_INLINE iw select(iw mask, iw yes, iw no) { return mask ? yes : no; }
R2_INLINE fw masked(iw mask, fw x) { return mask ? x : Lanes<fw>::all(0.0f); }
R2_INLINE fw vmin(fw a, fw b) { return _mm512_min_ps(a, b); }
R2_INLINE fw vmax(fw a, fw b) { return _mm512_max_ps(a, b); }
R2_INLINE fw vsqrt(fw x) { return _mm512_sqrt_ps(x); }
R2_INLINE iw inverted(iw mask) { return ~mask; }
R2_INLINE uint32_t bits(iw mask) { return _mm512_movepi32_mask(reinterpret_cast<__m512i>(mask)); }
R2_INLINE bool any(iw mask) { return bits(mask) != 0; }
R2_INLINE fw wide_iota() { return fw{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}; }

// 2^x for -24 <= x < 100, relative error below 1e-7; smaller x counts as -24. The steps of eight lanes.
R2_INLINE fw exp2_from(fw x) {
  const auto all = [](float value) { return Lanes<fw>::all(value); };
  x = vmax(x, all(-24.0f));
  const fw magic = all(12582912.0f);  // leaves the rounded x in the low bits
  const fw shifted = x + magic;
  const fw f = x - (shifted - magic);
  fw p = all(0.001327647129073739f);
  p = fma(p, f, all(0.009675540961325169f));
  p = fma(p, f, all(0.05550713092088699f));
  p = fma(p, f, all(0.24022120237350464f));
  p = fma(p, f, all(0.6931469440460205f));
  p = fma(p, f, all(1.0000001192092896f));
  return as_float(as_int(p) + (as_int(shifted) << 23));
}

#else

constexpr int kWide = kLanes;
typedef f8 fw;
typedef i8 iw;

R2_INLINE iw all_wide(int32_t x) { return splat_i(x); }
R2_INLINE fw load_wide(const float* p) { return load(p); }
R2_INLINE iw load_wide(const int32_t* p) {
  iw x;
  std::memcpy(&x, p, sizeof x);
  return x;
}
R2_INLINE void store_wide(float* p, fw x) { store(p, x); }
R2_INLINE void store_wide(int32_t* p, iw x) { std::memcpy(p, &x, sizeof x); }
R2_INLINE fw wide_iota() { return iota(); }

#endif

}  // namespace R2_ISA
