// Binds the rasterizer of block code, argument for argument as bind_splat.cpp does the CPU's, with the queue to draw on.
#include <atomic>

#include "../frame_arguments.h"
#include "bind_device.h"
#include "block_frame.h"

namespace R2_ISA {

using namespace room2dgs;

namespace {

struct Frame : BlockFrame {
  std::atomic<bool> busy{false};
};

int64_t forward(Frame& f, const Input& centers, const Input& rotations, const Input& scales, const Input& opacities,
                const Input& sh, const Input& cam_from_world, const Input& K, int64_t width, int64_t height, double near,
                const Input& background, const Output& color, const Output& alpha, const Output& depth,
                const Output& median, const OptionalOutput& normal, const OptionalOutput& distortion,
                const OptionalInput& center_px, uint64_t queue) {
  Claim claim(f);
  Arguments check = on_device(centers);
  require(width >= 1 && width <= kMaxSide && height >= 1 && height <= kMaxSide,
          "image size " + std::to_string(width) + " x " + std::to_string(height) + " is not in 1.." +
              std::to_string(kMaxSide));
  require(near > 0 && near < 1e300, "near is " + std::to_string(near) + ", not a distance above 0");
  const ViewInput in{check.input<double>("cam_from_world", cam_from_world, {4, 4}),
                     check.input<double>("K", K, {3, 3}),
                     check.input<float>("background", background, {3}),
                     near,
                     static_cast<int>(width),
                     static_cast<int>(height)};
  const SurfelArrays surfels = surfels_of(check, centers, rotations, scales, opacities, sh);
  const Images out = images_of(check, width, height, color, alpha, depth, median, normal, distortion);
  const float* moved = check.input<float>("center_px", center_px, {surfels.count, 2});
  require(normal || !distortion, "distortion is drawn with the normal or not at all: normal is None");
  const int device = centers.device_id();
  require(f.device < 0 || f.device == device, "the frame has its memory on another GPU");
  f.device = device;
  f.view = 0;
  bool drawn;
  {
    nb::gil_scoped_release release;
    const Queue to(queue, device);
    const OnDevice current(to);
    drawn = f.forward(to, in, surfels, moved, out);
  }
  if (!drawn) return 0;
  f.has_normal = normal.has_value(), f.has_distortion = distortion.has_value();
  return static_cast<int64_t>(f.view = ++f.views);
}

void backward(Frame& f, int64_t view, const Input& centers, const Input& rotations, const Input& scales,
              const Input& opacities, const Input& sh, const Input& alpha, const Input& depth,
              const OptionalInput& g_color, const OptionalInput& g_alpha, const OptionalInput& g_depth,
              const OptionalInput& g_median, const OptionalInput& g_normal, const OptionalInput& g_distortion,
              const Output& to_centers, const Output& to_rotations, const Output& to_scales,
              const Output& to_opacities, const Output& to_sh, const Output& to_center_px, const Output& to_pose,
              const Output& to_K, const OptionalOutput& to_background, uint64_t queue) {
  Claim claim(f);
  require(f.view != 0, "the frame holds no view: forward comes first");
  require(view == static_cast<int64_t>(f.view), "the frame has drawn another view since: its backward pass is lost");
  Arguments check = on_device(centers);
  require(centers.device_id() == f.device, "the frame has its memory on another GPU");
  const SurfelArrays surfels = surfels_of(check, centers, rotations, scales, opacities, sh);
  require(surfels.count == f.count, std::to_string(surfels.count) + " surfels come back, " + std::to_string(f.count) +
                                        " were drawn");
  require(!g_normal || f.has_normal, "g_normal flows back to a normal that was not drawn");
  require(!g_distortion || f.has_distortion, "g_distortion flows back to a distortion that was not drawn");
  const int64_t n = f.count, height = f.input.height, width = f.input.width, terms = surfels.sh_count;
  Images out{};
  // read only: the kernels take what the forward pass wrote
  out.alpha = const_cast<float*>(check.input<float>("alpha", alpha, {height, width}));
  out.depth = const_cast<float*>(check.input<float>("depth", depth, {height, width}));
  const ImageGradients g{check.input<float>("g_color", g_color, {height, width, 3}),
                         check.input<float>("g_alpha", g_alpha, {height, width}),
                         check.input<float>("g_depth", g_depth, {height, width}),
                         check.input<float>("g_median", g_median, {height, width}),
                         check.input<float>("g_normal", g_normal, {height, width, 3}),
                         check.input<float>("g_distortion", g_distortion, {height, width})};
  const SurfelGradients to{check.output<float>("to_centers", to_centers, {n, 3}),
                           check.output<float>("to_rotations", to_rotations, {n, 4}),
                           check.output<float>("to_scales", to_scales, {n, 2}),
                           check.output<float>("to_opacities", to_opacities, {n}),
                           check.output<float>("to_sh", to_sh, {n, terms, 3}),
                           check.output<float>("to_center_px", to_center_px, {n, 2})};
  double *pose = check.output<double>("to_pose", to_pose, {4, 4}), *K = check.output<double>("to_K", to_K, {3, 3});
  double* behind = check.output<double>("to_background", to_background, {3});
  require(!behind || g.color, "to_background comes from g_color: it is None");
  nb::gil_scoped_release release;
  const Queue on(queue, f.device);
  const OnDevice current(on);
  f.backward(on, surfels, out, g, to, pose, K, behind);
}

template <class Values>
nb::list listed(const Values& values) {
  nb::list list;
  for (auto value : values) list.append(value);
  return list;
}

}  // namespace

void bind_block_frame(nb::module_& m) {
  nb::class_<Frame>(m, "BlockFrame", "One rendered view: what its backward pass needs.")
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
          "The last view's pose (16 numbers), K (9) and background (3), as the device read them.")
      .def("forward", &forward, as_is("centers"), as_is("rotations"), as_is("scales"), as_is("opacities"), as_is("sh"),
           as_is("cam_from_world"), as_is("K"), nb::arg("width"), nb::arg("height"), nb::arg("near"),
           as_is("background"), as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"), or_none("normal"),
           or_none("distortion"), or_none("center_px") = nb::none(), nb::arg("queue") = 0,
           "Draws a view into the maps. Gives its number, which `backward` asks for, or 0 where nothing was drawn: a "
           "focal length is not above 0, or the camera not finite. cam_from_world and K are float64, all else float32. queue: torch's cuda_stream; on the CPU the seed of the order of blocks, 0 for in order.")
      .def("backward", &backward, nb::arg("view"), as_is("centers"), as_is("rotations"), as_is("scales"),
           as_is("opacities"), as_is("sh"), as_is("alpha"), as_is("depth"), or_none("g_color"), or_none("g_alpha"),
           or_none("g_depth"), or_none("g_median"), or_none("g_normal"), or_none("g_distortion"), as_is("to_centers"),
           as_is("to_rotations"), as_is("to_scales"), as_is("to_opacities"), as_is("to_sh"), as_is("to_center_px"),
           as_is("to_pose"), as_is("to_K"), or_none("to_background"), nb::arg("queue") = 0,
           "The gradients of the frame's last view, which must be number `view`; alpha and depth are its maps. to_pose, "
           "to_K and to_background are float64, all else float32.");
}

}  // namespace R2_ISA
