// Normals in two numbers of 16 bits, octahedral coordinates (captures/packed_maps.py), one axis after the other.
#pragma once

#include <cstdint>

#include "isa.h"

namespace room2dgs {

constexpr float kNormalUnit = 32767.0f;   // of a coordinate
constexpr int16_t kNoNormal = -32768;

}  // namespace room2dgs

// codes: x, then y, of `count` pixels each; normals: x, then y, then z.
#define X(isa)                                                             \
  namespace isa {                                                          \
  void pack_normals(const float* normals, int64_t count, int16_t* codes);  \
  void unpack_normals(const int16_t* codes, int64_t count, float* normals); \
  }
R2_EACH_ISA(X)
#undef X
