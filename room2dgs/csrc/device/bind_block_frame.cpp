// Binds the rasterizer of block code as bind_splat.cpp does the CPU's, with the queue to draw on.
#include <atomic>
#include <utility>

#include "../frame_arguments.h"
#include "bind_device.h"
#include "block_frame.h"

namespace R2_ISA {

using namespace room2dgs;

namespace {

struct Frame : BlockFrame {
  std::atomic<bool> busy{false};
};

bool draw(Frame& f, Arguments& check, const ViewArrays& view, const SurfelArrays& surfels, const Images& out,
          const OptionalInput& center_px, uint64_t queue) {
  const ViewInput in{view.cam_from_world, view.K, view.background, view.near, view.opacity_floor, view.width,
                     view.height};
  const float* moved = check.input<float>("center_px", center_px, {surfels.count, 2});
  f.view = 0, f.device = view.device;
  nb::gil_scoped_release release;
  const Queue on(queue, f.device);
  const OnDevice current(on);
  return f.forward(on, in, surfels, moved, out);
}

void run_back(Frame& f, const BackwardArrays& a, uint64_t queue) {
  const Queue on(queue, f.device);
  const OnDevice current(on);
  f.backward(on, a.surfels, a.maps, a.from, a.to, a.to_pose, a.to_K, a.to_background);
}

template <class Values>
nb::list listed(const Values& values) {
  nb::list list;
  for (auto value : values) list.append(value);
  return list;
}

}  // namespace

void bind_block_frame(nb::module_& m) {
  auto frame = nb::class_<Frame>(m, "BlockFrame", "One rendered view: what its backward pass needs.")
      .def(nb::init<>())
      .def_prop_ro("visible", [](Frame& f) { Claim claim(f); return f.facts.visible; }, "Surfels that reach a pixel.")
      .def_prop_ro("entries", [](Frame& f) { Claim claim(f); return f.facts.entries; }, "(surfel, tile) pairs.")
      .def_prop_ro("bytes", [](Frame& f) { Claim claim(f); return f.bytes(); }, "Memory of the device that it holds.")
      .def_prop_ro("moved", [](Frame& f) { Claim claim(f); return f.facts.moved; }, "Rows of center_px that are not 0.")
      .def(
          "camera",
          [](Frame& f) {
            Claim claim(f);
            return nb::make_tuple(listed(f.facts.cam_from_world), listed(f.facts.K), listed(f.facts.background));
          },
          "The last view's pose (16 numbers), K (9) and background (3), as the device read them.");
  const auto start = [](const Frame& f, const Input& centers) {
    require(f.device < 0 || f.device == centers.device_id(), "the frame has its memory on another GPU");
    return on_device(centers);
  };
  const auto queue = extra<uint64_t>(nb::arg("queue") = 0);
  def_forward(frame,
              "Draws a view into the maps. Gives its number, which `backward` asks for, or 0 where nothing was drawn: a "
              "focal length is not above 0, or the camera not finite. cam_from_world and K are float64, all else "
              "float32. queue: torch's cuda_stream; on the CPU the seed of the order of blocks, 0 for in order.",
              start, draw, extra<OptionalInput>(or_none("center_px") = nb::none()), queue);
  def_backward(
      frame, start, [](const Frame& f) { return std::pair<int64_t, int64_t>(f.input.width, f.input.height); }, run_back,
      queue);
}

}  // namespace R2_ISA
