// Plain loops that the compiler turns into vectors; the same bits on every instruction set.
#include "normal_codes.h"

#include "scalar.h"

namespace R2_ISA {
namespace {

inline float size_of(float x) { return __builtin_fabsf(x); }
inline float signed_as(float x, float sign) { return __builtin_copysignf(x, sign); }
inline bool finite(float x) { return size_of(x) <= __FLT_MAX__; }

// Nearest whole number, halves to the even one, for |x| < 2^22.
inline float whole(float x) {
  const float magic = 12582912.0f;
  return (x + magic) - magic;
}

}  // namespace

void pack_normals(const float* normals, int64_t count, int16_t* codes) {
  const float *xs = normals, *ys = xs + count, *zs = ys + count;
  int16_t *u = codes, *v = codes + count;
  for (int64_t i = 0; i < count; ++i) {
    const bool valid = finite(xs[i]) & finite(ys[i]) & finite(zs[i]) & ((xs[i] != 0.0f) | (ys[i] != 0.0f) | (zs[i] != 0.0f));
    const float z = valid ? zs[i] : 1.0f, size = size_of(valid ? xs[i] : 0.0f) + size_of(valid ? ys[i] : 0.0f) + size_of(z);
    const float x = (valid ? xs[i] : 0.0f) / size, y = (valid ? ys[i] : 0.0f) / size;
    const float folded_x = signed_as(1.0f - size_of(y), x), folded_y = signed_as(1.0f - size_of(x), y);
    const float code_x = whole((z < 0.0f ? folded_x : x) * room2dgs::kNormalUnit);
    const float code_y = whole((z < 0.0f ? folded_y : y) * room2dgs::kNormalUnit);
    u[i] = static_cast<int16_t>(valid ? static_cast<int32_t>(code_x) : room2dgs::kNoNormal);
    v[i] = static_cast<int16_t>(valid ? static_cast<int32_t>(code_y) : room2dgs::kNoNormal);
  }
}

void unpack_normals(const int16_t* codes, int64_t count, float* normals) {
  const int16_t *u = codes, *v = codes + count;
  float *xs = normals, *ys = xs + count, *zs = ys + count;
  const float unit = 1.0f / room2dgs::kNormalUnit;
  for (int64_t i = 0; i < count; ++i) {
    float x = static_cast<float>(u[i]) * unit, y = static_cast<float>(v[i]) * unit;
    const float sum = size_of(y) + size_of(x), z = 1.0f - sum;
    const float fold = sum - 1.0f > 0.0f ? sum - 1.0f : 0.0f;
    x -= signed_as(fold, x), y -= signed_as(fold, y);
    const float length = u[i] == room2dgs::kNoNormal ? __builtin_inff() : vsqrt(x * x + y * y + z * z);
    xs[i] = x / length, ys[i] = y / length, zs[i] = z / length;
  }
}

}  // namespace R2_ISA
