// Eight running sums in double, one for each lane of a float vector.
#pragma once

#include "simd.h"

namespace R2_ISA {

#if defined(__AVX2__)
struct LaneSum {
  __m256d low = _mm256_setzero_pd(), high = _mm256_setzero_pd();

  R2_INLINE void add(f8 x) {
    low = _mm256_add_pd(low, _mm256_cvtps_pd(_mm256_castps256_ps128(x)));
    high = _mm256_add_pd(high, _mm256_cvtps_pd(_mm256_extractf128_ps(x, 1)));
  }
  R2_INLINE double total() const {
    const __m256d s = _mm256_add_pd(low, high);
    return (s[0] + s[1]) + (s[2] + s[3]);
  }
};
#else
struct LaneSum {
  double lanes[kLanes] = {};

  R2_INLINE void add(f8 x) {
    for (int k = 0; k < kLanes; ++k) lanes[k] += x[k];
  }
  R2_INLINE double total() const {
    double sum = 0.0;
    for (int k = 0; k < kLanes; ++k) sum += lanes[k];
    return sum;
  }
};
#endif

}  // namespace R2_ISA
