#include "blend_forward.h"

namespace R2_ISA {

void set_blend(room2dgs::Kernels& k) { k.blend = &blend<SurfelHits>, k.count_pairs = &count_pairs<SurfelHits>; }

}  // namespace R2_ISA
