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

// True when the processor runs the AVX2 kernels.
bool has_avx2();

}  // namespace room2dgs
