// What the bindings of block code share. They are compiled twice: for the CPU as `_C.device`, for CUDA as `_cuda`.
#pragma once

#include "../bind.h"
#include "../launch.h"

namespace R2_ISA {

namespace nb = nanobind;

void bind_block_frame(nb::module_& m);

// Everything, in the module that it is given.
void bind_device(nb::module_& m);

}  // namespace R2_ISA
