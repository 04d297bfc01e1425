#include "bind_device.h"

namespace R2_ISA {

void bind_device(nb::module_& m) {
#if defined(R2_CUDA)
  m.attr("cuda") = true;
#else
  m.attr("cuda") = false;
#endif
  bind_block_frame(m);
  bind_block_losses(m);
  bind_block_stereo(m);
  bind_block_fusion(m);
}

}  // namespace R2_ISA
