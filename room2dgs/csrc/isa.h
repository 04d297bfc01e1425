// Which copy of a kernel this processor runs: every *_kernels.cpp is compiled once for each instruction set.
#pragma once

namespace room2dgs {

enum class Isa { kBaseline, kAvx2, kAvx512 };

// The widest that the processor has, and at most what the environment's ROOM2DGS_ISA names (isa.cpp).
Isa best_isa();
const char* isa_name(Isa isa);

}  // namespace room2dgs

// X(namespace) for each copy; the kernel of the best one.
#if defined(__x86_64__) || defined(_M_X64)
#define R2_EACH_ISA(X) X(isa_baseline) X(isa_avx2) X(isa_avx512)
#define R2_BEST(kernel)                                                 \
  (room2dgs::best_isa() == room2dgs::Isa::kAvx512 ? &isa_avx512::kernel \
   : room2dgs::best_isa() == room2dgs::Isa::kAvx2 ? &isa_avx2::kernel   \
                                                  : &isa_baseline::kernel)
#else
#define R2_EACH_ISA(X) X(isa_baseline)
#define R2_BEST(kernel) (&isa_baseline::kernel)
#endif
