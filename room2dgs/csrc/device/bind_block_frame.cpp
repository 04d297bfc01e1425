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
  static constexpr int64_t kScales = 2;
  explicit Frame(bool gaussians = false) : BlockFrame(gaussians) {}
  std::atomic<bool> busy{false};
};
// The same of 3D Gaussians.
struct GaussianBlockFrame : Frame {
  static constexpr int64_t kScales = 3;
  GaussianBlockFrame() : Frame(true) {}
};

bool draw_view(Frame& f, Arguments& check, const ViewArrays& view, const SurfelArrays& surfels, const Images& out,
               double filter_px2, bool compensated, const OptionalInput& center_px, uint64_t queue) {
  const ViewInput in{view.cam_from_world, view.K, view.background, view.near, view.opacity_floor, view.width,
                     view.height, filter_px2, compensated};
  const float* moved = check.input<float>("center_px", center_px, {surfels.count, 2});
  f.view = 0, f.device = view.device;
  nb::gil_scoped_release release;
  const Queue on(queue, f.device);
  const OnDevice current(on);
  return f.forward(on, in, surfels, moved, out);
}

bool draw(Frame& f, Arguments& check, const ViewArrays& view, const SurfelArrays& surfels, const Images& out,
          const OptionalInput& center_px, uint64_t queue) {
  return draw_view(f, check, view, surfels, out, 0, false, center_px, queue);
}

bool draw_gaussians(Frame& f, Arguments& check, const ViewArrays& view, const SurfelArrays& gaussians, const Images& out,
                    double filter_px2, bool compensated, const OptionalInput& center_px, uint64_t queue) {
  require_filter(filter_px2);
  return draw_view(f, check, view, gaussians, out, filter_px2, compensated, center_px, queue);
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

template <class Drawn, class Draw, class... Extras>
void bind_frame(nb::module_& m, const char* name, Draw draw_it, const char* about, const Extras&... extras) {
  auto frame = nb::class_<Drawn>(m, name, "One rendered view: what its backward pass needs.")
      .def(nb::init<>())
      .def_prop_ro("visible", [](Drawn& f) { Claim claim(f); return f.facts.visible; }, "Surfels that reach a pixel.")
      .def_prop_ro("entries", [](Drawn& f) { Claim claim(f); return f.facts.entries; }, "(surfel, tile) pairs.")
      .def_prop_ro("bytes", [](Drawn& f) { Claim claim(f); return f.bytes(); }, "Memory of the device that it holds.")
      .def_prop_ro("moved", [](Drawn& f) { Claim claim(f); return f.facts.moved; }, "Rows of center_px that are not 0.")
      .def(
          "camera",
          [](Drawn& f) {
            Claim claim(f);
            return nb::make_tuple(listed(f.facts.cam_from_world), listed(f.facts.K), listed(f.facts.background));
          },
          "The last view's pose (16 numbers), K (9) and background (3), as the device read them.");
  const auto start = [](const Drawn& f, const Input& centers) {
    require(f.device < 0 || f.device == centers.device_id(), "the frame has its memory on another GPU");
    return on_device(centers);
  };
  const auto queue = extra<uint64_t>(nb::arg("queue") = 0);
  def_forward(frame, about, start, draw_it, extras..., extra<OptionalInput>(or_none("center_px") = nb::none()), queue);
  def_backward(
      frame, start, [](const Drawn& f) { return std::pair<int64_t, int64_t>(f.input.width, f.input.height); }, run_back,
      queue);
}

}  // namespace

void bind_block_frame(nb::module_& m) {
  bind_frame<Frame>(
      m, "BlockFrame", draw,
      "Draws a view into the maps. Gives its number, which `backward` asks for, or 0 where nothing was drawn: a focal "
      "length is not above 0, or the camera not finite. cam_from_world and K are float64, all else float32. queue: "
      "torch's cuda_stream; on the CPU the seed of the order of blocks, 0 for in order.");
  bind_frame<GaussianBlockFrame>(m, "GaussianBlockFrame", draw_gaussians,
                                 "As BlockFrame's, of 3D Gaussians: scales are (n, 3).",
                                 extra<double>(nb::arg("filter_px2")), extra<bool>(nb::arg("compensated")));
}

}  // namespace R2_ISA
