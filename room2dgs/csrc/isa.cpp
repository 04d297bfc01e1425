#include "isa.h"

#include <cstdlib>
#include <cstring>
#include <initializer_list>

namespace room2dgs {
namespace {

Isa of_processor() {
#if defined(__x86_64__) || defined(_M_X64)
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
  if (!avx2) return Isa::kBaseline;
  const bool avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
  return avx512 ? Isa::kAvx512 : Isa::kAvx2;
#else
  return Isa::kBaseline;
#endif
}

}  // namespace

const char* isa_name(Isa isa) {
  return isa == Isa::kAvx512 ? "avx512" : isa == Isa::kAvx2 ? "avx2" : "baseline";
}

Isa best_isa() {
  // read anew each time: tests change it, and so may whoever doubts the processor
  static const Isa most = of_processor();
  const char* wanted = std::getenv("ROOM2DGS_ISA");
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2})
    if (wanted && std::strcmp(wanted, isa_name(isa)) == 0 && isa < most) return isa;
  return most;
}

}  // namespace room2dgs
