// Shared by the files that bind kernels to Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

namespace room2dgs {

namespace nb = nanobind;

void bind_splat(nb::module_& m);
void bind_losses(nb::module_& m);
void bind_bench(nb::module_ m);
void bind_mesh(nb::module_& m);
void bind_stereo(nb::module_& m);
void bind_joint(nb::module_& m);
void bind_completion(nb::module_& m);

// True when the processor runs the AVX2 kernels.
bool has_avx2();

}  // namespace room2dgs

// The kernel of the widest instruction set that the processor has.
#if defined(__x86_64__) || defined(_M_X64)
#define R2_BEST(kernel) (room2dgs::has_avx2() ? &isa_avx2::kernel : &isa_baseline::kernel)
#else
#define R2_BEST(kernel) (&isa_baseline::kernel)
#endif
