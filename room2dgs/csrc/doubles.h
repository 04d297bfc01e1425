// Several doubles at once, as a scalar for the templates of surfel.h, bounds.h and sh.h: lane by lane the bits of one
// (scalar.h). As many as a vector has: eight with AVX-512, else four.
#pragma once

#include "simd.h"

namespace R2_ISA {

#if defined(__AVX512F__)
constexpr int kDoubles = 8;
#else
constexpr int kDoubles = 4;
#endif
typedef double dn __attribute__((vector_size(8 * kDoubles)));
typedef int64_t ln __attribute__((vector_size(8 * kDoubles)));
typedef uint64_t un __attribute__((vector_size(8 * kDoubles)));
typedef float fn __attribute__((vector_size(4 * kDoubles)));
typedef int32_t in __attribute__((vector_size(4 * kDoubles)));

struct DoublesMask {
  ln lanes;
  friend R2_INLINE DoublesMask operator&(DoublesMask a, DoublesMask b) { return {a.lanes & b.lanes}; }
  friend R2_INLINE DoublesMask inverted(DoublesMask a) { return {~a.lanes}; }
  // A bit a lane.
  friend R2_INLINE uint32_t bits(DoublesMask a) {
#if defined(__AVX512F__)
    return _mm512_movepi64_mask(reinterpret_cast<__m512i>(a.lanes));
#elif defined(__AVX2__)
    return static_cast<uint32_t>(_mm256_movemask_pd(reinterpret_cast<__m256d>(a.lanes)));
#else
    uint32_t r = 0;
    for (int k = 0; k < kDoubles; ++k) r |= (a.lanes[k] ? 1u : 0u) << k;
    return r;
#endif
  }
};

struct Doubles {
  dn lanes;
  Doubles() = default;
  R2_INLINE Doubles(dn x) : lanes(x) {}
  R2_INLINE Doubles(double x) : lanes(x - dn{}) {}  // in every lane
  friend R2_INLINE Doubles operator+(Doubles a, Doubles b) { return a.lanes + b.lanes; }
  friend R2_INLINE Doubles operator-(Doubles a, Doubles b) { return a.lanes - b.lanes; }
  friend R2_INLINE Doubles operator-(Doubles a) { return -a.lanes; }
  friend R2_INLINE Doubles operator*(Doubles a, Doubles b) { return a.lanes * b.lanes; }
  friend R2_INLINE Doubles operator/(Doubles a, Doubles b) { return a.lanes / b.lanes; }
  R2_INLINE Doubles& operator+=(Doubles b) { return *this = *this + b; }
  R2_INLINE Doubles& operator-=(Doubles b) { return *this = *this - b; }
  friend R2_INLINE DoublesMask operator<(Doubles a, Doubles b) { return {a.lanes < b.lanes}; }
  friend R2_INLINE DoublesMask operator>(Doubles a, Doubles b) { return {a.lanes > b.lanes}; }
  friend R2_INLINE DoublesMask operator<=(Doubles a, Doubles b) { return {a.lanes <= b.lanes}; }
  friend R2_INLINE DoublesMask operator>=(Doubles a, Doubles b) { return {a.lanes >= b.lanes}; }
  friend R2_INLINE DoublesMask operator!=(Doubles a, Doubles b) { return {a.lanes != b.lanes}; }
  friend R2_INLINE Doubles fma(Doubles a, Doubles b, Doubles c) {
#if defined(__AVX512F__)
    return dn(_mm512_fmadd_pd(a.lanes, b.lanes, c.lanes));
#elif defined(__AVX2__) && defined(__FMA__)
    return dn(_mm256_fmadd_pd(a.lanes, b.lanes, c.lanes));
#else
    return a.lanes * b.lanes + c.lanes;
#endif
  }
  friend R2_INLINE Doubles vsqrt(Doubles a) {
#if defined(__AVX512F__)
    return dn(_mm512_sqrt_pd(a.lanes));
#elif defined(__AVX2__)
    return dn(_mm256_sqrt_pd(a.lanes));
#else
    dn r;
    for (int k = 0; k < kDoubles; ++k) r[k] = __builtin_sqrt(a.lanes[k]);
    return r;
#endif
  }
  friend R2_INLINE Doubles vfloor(Doubles a) {
#if defined(__AVX512F__)
    return dn(_mm512_roundscale_pd(a.lanes, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC));
#elif defined(__AVX2__)
    return dn(_mm256_floor_pd(a.lanes));
#else
    dn r;
    for (int k = 0; k < kDoubles; ++k) r[k] = __builtin_floor(a.lanes[k]);
    return r;
#endif
  }
  friend R2_INLINE Doubles vceil(Doubles a) { return -vfloor(-a); }
  friend R2_INLINE Doubles select(DoublesMask mask, Doubles yes, Doubles no) {
#if defined(__AVX512F__)
    return dn(mask.lanes ? yes.lanes : no.lanes);
#elif defined(__AVX2__)
    return dn(_mm256_blendv_pd(no.lanes, yes.lanes, reinterpret_cast<__m256d>(mask.lanes)));
#else
    const ln picked = (mask.lanes & reinterpret_cast<ln>(yes.lanes)) | (~mask.lanes & reinterpret_cast<ln>(no.lanes));
    return reinterpret_cast<dn>(picked);
#endif
  }
  friend R2_INLINE Doubles vmin(Doubles a, Doubles b) { return select(a < b, a, b); }
  friend R2_INLINE Doubles vmax(Doubles a, Doubles b) { return select(a > b, a, b); }
  friend R2_INLINE Doubles mantissa_of(Doubles x, Doubles& power) {
    un bits = reinterpret_cast<un>(x.lanes) - kRootHalf + (uint64_t{1023} << 52);
    // a whole number of 52 bits, as the last ones of 2^52 and more
    power = reinterpret_cast<dn>((bits >> 52) + 0x4330000000000000ull) - (0x1p52 + 1023);
    return reinterpret_cast<dn>((bits & kMantissa) + kRootHalf);
  }
};

R2_INLINE fn narrow(Doubles x) { return __builtin_convertvector(x.lanes, fn); }
R2_INLINE in whole_numbers(Doubles x) { return __builtin_convertvector(x.lanes, in); }  // any number where it is none
R2_INLINE Doubles widen(fn x) { return __builtin_convertvector(x, dn); }

// Sum of the lanes in one fixed order.
R2_INLINE double hsum(Doubles x) {
  const double* lane = reinterpret_cast<const double*>(&x);
  double sum = 0;
  for (int k = 0; k < kDoubles; ++k) sum += lane[k];
  return sum;
}

template <>
struct Lanes<Doubles> {
  using Mask = DoublesMask;
  using Narrow = fn;
};

// p[index[k]] in lane k.
R2_INLINE Doubles picked(const float* p, const int64_t* index) {
#if defined(__AVX2__)
  const auto four = [&](int k) {
    return _mm_set_ps(p[index[k + 3]], p[index[k + 2]], p[index[k + 1]], p[index[k]]);
  };
#endif
#if defined(__AVX512F__)
  return dn(_mm512_cvtps_pd(_mm256_set_m128(four(4), four(0))));
#elif defined(__AVX2__)
  return dn(_mm256_cvtps_pd(four(0)));
#else
  return dn{p[index[0]], p[index[1]], p[index[2]], p[index[3]]};
#endif
}

}  // namespace R2_ISA
