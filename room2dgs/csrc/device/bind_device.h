// What the bindings of block code share. They are compiled twice: for the CPU as `_C.device`, for CUDA as `_cuda`.
#pragma once

#include "../arrays.h"
#include "../bind.h"
#include "../launch.h"

namespace R2_ISA {

namespace nb = nanobind;

// Arguments that lie where the first one of them lies.
inline room2dgs::Arguments on_device(const room2dgs::Input& first) {
#if defined(R2_CUDA)
  return room2dgs::Arguments::on_cuda(first.device_id());
#else
  (void)first;
  return room2dgs::Arguments();
#endif
}

void bind_block_frame(nb::module_& m);
void bind_block_losses(nb::module_& m);
void bind_block_stereo(nb::module_& m);
void bind_block_fusion(nb::module_& m);

// Everything, in the module that it is given.
void bind_device(nb::module_& m);

}  // namespace R2_ISA
