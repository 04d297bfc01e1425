#include "bind.h"
#include "isa.h"
#include "parallel.h"

namespace isa_blocks {
void bind_device(nanobind::module_& m);
}

NB_MODULE(_C, m) {
  nanobind::set_leak_warnings(false);  // graphs that are alive when the interpreter ends hold frames
  m.doc() = "Compiled kernels of room2dgs; use the Python functions that wrap them.";
  m.def("isa", [] { return room2dgs::isa_name(room2dgs::best_isa()); }, "Instruction set of the kernels in use.");
  m.def(
      "set_threads",
      [](int64_t count) {
        if (count < 1 || count > room2dgs::kMaxThreads) throw nanobind::value_error("count is not in 1..1024");
        nanobind::gil_scoped_release unlocked;  // a kernel may run in another thread
        return room2dgs::set_threads(static_cast<int>(count));
      },
      nanobind::arg("count"), "Asks for so many threads and gives the number in use.");
  m.def("threads", &room2dgs::threads, "Threads in use, the caller's own included.");
  room2dgs::bind_splat(m);
  room2dgs::bind_losses(m);
  room2dgs::bind_bench(m.def_submodule("bench", "What `room2dgs bench raster` measures by."));
  room2dgs::bind_stereo(m);
  room2dgs::bind_joint(m);
  room2dgs::bind_completion(m);
  room2dgs::bind_mesh(m);
  room2dgs::bind_coloring(m);
  room2dgs::bind_captures(m);
  nanobind::module_ device = m.def_submodule("device", "The CUDA kernels as plain C++ on the CPU: for tests, and multi-view terms.");
  isa_blocks::bind_device(device);
}
