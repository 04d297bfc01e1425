// Shared by the files that bind kernels to Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include "isa.h"

namespace room2dgs {

namespace nb = nanobind;

void bind_splat(nb::module_& m);
void bind_losses(nb::module_& m);
void bind_bench(nb::module_ m);
void bind_mesh(nb::module_& m);
void bind_coloring(nb::module_& m);
void bind_stereo(nb::module_& m);
void bind_joint(nb::module_& m);
void bind_completion(nb::module_& m);
void bind_captures(nb::module_& m);

}  // namespace room2dgs
