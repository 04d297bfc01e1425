#include "blend_backward.h"

namespace R2_ISA {

void set_blend_backward(room2dgs::Kernels& k) { k.blend_backward = &blend_backward<SurfelHits>; }

}  // namespace R2_ISA
