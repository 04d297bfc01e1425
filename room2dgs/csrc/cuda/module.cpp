// The extension `_cuda`: the functions of `_C.device`, on an NVIDIA GPU.
#include "device/bind_device.h"

NB_MODULE(_cuda, m) {
  nanobind::set_leak_warnings(false);
  m.doc() = "Compiled CUDA kernels of room2dgs; use the Python functions that wrap them.";
  R2_ISA::bind_device(m);
}
