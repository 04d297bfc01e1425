// See patchmatch.h and patchmatch_maths.h. A vector holds eight pixels of one colour of the checkerboard.
#include "simd.h"

#include "patchmatch_maths.h"

namespace R2_ISA {

template <>
struct StereoLanes<f8> {
  using Integers = i8;
  typedef uint32_t Bits __attribute__((vector_size(32)));
  static constexpr int count = kLanes;
  static R2_INLINE f8 number(i8 x) { return __builtin_convertvector(x, f8); }
  static R2_INLINE i8 truncated(f8 x) { return __builtin_convertvector(x, i8); }
  static R2_INLINE i8 integers(Bits x) { return reinterpret_cast<i8>(x); }
  static R2_INLINE Bits bits(i8 x) { return reinterpret_cast<Bits>(x); }
  static R2_INLINE i8 raw(f8 x) { return as_int(x); }
  static R2_INLINE f8 float_of(i8 x) { return as_float(x); }
  static R2_INLINE i8 whole(int32_t x) { return splat_i(x); }
  static R2_INLINE i8 only(i8 mask, i8 x) { return mask & x; }
  static R2_INLINE i8 choose(i8 mask, i8 yes, i8 no) { return select(mask, yes, no); }
  static R2_INLINE i8 bit(i8 k) { return splat_i(1) << k; }
  static R2_INLINE bool any(i8 mask) { return R2_ISA::any(mask); }
  static R2_INLINE f8 absolute(f8 x) { return as_float(as_int(x) & splat_i(0x7fffffff)); }
  static R2_INLINE f8 columns(int64_t first) { return iota() * 2.0f + static_cast<float>(first); }
  static R2_INLINE f8 bytes(const uint8_t* p) {  // every second one
    typedef uint16_t s8 __attribute__((vector_size(16)));
    s8 pairs;
    std::memcpy(&pairs, p, 16);
    return number(__builtin_convertvector(pairs & 255, i8));
  }
  static R2_INLINE f8 load(const float* p) { return R2_ISA::load(p); }
  static R2_INLINE void store(float* p, f8 x) { R2_ISA::store(p, x); }
  static R2_INLINE i8 whole_at(const int32_t* p) {
    i8 r;
    std::memcpy(&r, p, 32);
    return r;
  }
  static R2_INLINE void store(int32_t* p, i8 x) { std::memcpy(p, &x, 32); }
  static R2_INLINE float lane(f8 x, int k) { return x[k]; }
  // Eight loads in place of one `vpgatherdd`: that is microcode on many processors, and nothing runs beside it.
  static R2_INLINE Bits gather(const uint32_t* p, i8 index) {
#if defined(__AVX2__)
    const __m256i i = reinterpret_cast<__m256i>(index);
    const __m128i low = _mm256_castsi256_si128(i), high = _mm256_extracti128_si256(i, 1);
    const auto two = [&](uint64_t pair) {
      return _mm_unpacklo_epi32(_mm_cvtsi32_si128(static_cast<int>(p[static_cast<uint32_t>(pair)])),
                                _mm_cvtsi32_si128(static_cast<int>(p[pair >> 32])));
    };
    const __m128i a = _mm_unpacklo_epi64(two(_mm_cvtsi128_si64(low)), two(_mm_extract_epi64(low, 1)));
    const __m128i b = _mm_unpacklo_epi64(two(_mm_cvtsi128_si64(high)), two(_mm_extract_epi64(high, 1)));
    return reinterpret_cast<Bits>(_mm256_set_m128i(b, a));
#else
    Bits r;
    for (int k = 0; k < kLanes; ++k) r[k] = p[index[k]];
    return r;
#endif
  }
  static R2_INLINE f8 gather(const float* p, i8 index) { return R2_ISA::gather(p, index); }
  // Sums of the products of the two 16-bit numbers in each lane.
  static R2_INLINE i8 product_of_halves(i8 a, i8 b) {
#if defined(__AVX2__)
    return reinterpret_cast<i8>(_mm256_madd_epi16(reinterpret_cast<__m256i>(a), reinterpret_cast<__m256i>(b)));
#else
    return ((a << 16) >> 16) * ((b << 16) >> 16) + (a >> 16) * (b >> 16);
#endif
  }
  // The low 16 bits of `low` below the high 16 bits of `high`.
  static R2_INLINE i8 halves(i8 low, i8 high) {
#if defined(__AVX2__)
    return reinterpret_cast<i8>(
        _mm256_blend_epi16(reinterpret_cast<__m256i>(low), reinterpret_cast<__m256i>(high), 0xaa));
#else
    return (low & 0xffff) | (high & ~0xffff);
#endif
  }
  static R2_INLINE i8 logical_shift(i8 x, int by) { return reinterpret_cast<i8>(reinterpret_cast<Bits>(x) >> by); }

  // The weights of a pixel and its right neighbour by the low 16 bits of a position, adding up to kWhole.
  static R2_INLINE i8 along_row(i8 position) {
#if defined(__AVX2__)
    const __m256i low = _mm256_set1_epi32(0x01000100) + _mm256_setr_epi64x(0x0404040400000000, 0x0c0c0c0c08080808,
                                                                           0x0404040400000000, 0x0c0c0c0c08080808);
    const __m256i twice = _mm256_srli_epi16(_mm256_shuffle_epi8(reinterpret_cast<__m256i>(position), low), 1);
    return reinterpret_cast<i8>(twice) ^ 0x7fff;
#else
    const i8 half = (position & 0xffff) >> 1;
    return (half << 16) | (0x7fff - half);
#endif
  }
  // Of each lane's own view.
  static R2_INLINE f8 of_view(const StereoJob& job, int field, i8 view) {
    const float* table = job.table + field * room2dgs::kStereoMaxViews;
#if defined(__AVX2__)
    if (job.view_count <= kLanes) return _mm256_permutevar8x32_ps(R2_ISA::load(table), reinterpret_cast<__m256i>(view));
#endif
    return gather(table, view);
  }
};

namespace {

// Groups of eight pixels of a colour in a row, each by its first one.
template <class Body>
R2_INLINE void groups(const StereoJob& job, int64_t row, int colour, const Body& body) {
  for (int64_t i = 0; 2 * i + ((row + colour) & 1) < job.width; i += kLanes) body(i);
}

}  // namespace

void stereo_start_row(const StereoJob& job, int64_t row) {
  for (int colour = 0; colour < 2; ++colour)
    groups(job, row, colour, [&](int64_t i) { stereo_start<f8>(job, colour, row, i); });
}

void stereo_sweep_row(const StereoJob& job, const StereoSweep& sweep, int64_t row) {
  groups(job, row, sweep.colour, [&](int64_t i) { stereo_sweep<f8>(job, sweep, row, i); });
}

void stereo_cost_row(const StereoJob& job, int64_t row, float* cost, float* variance) {
  for (int colour = 0; colour < 2; ++colour)
    groups(job, row, colour, [&](int64_t i) { stereo_cost<f8>(job, colour, row, i, cost, variance); });
}

}  // namespace R2_ISA
