// Binds the rasterizer: every argument is checked here, whatever the Python wrapper (splat/backends/cpu.py) has checked.
#include <algorithm>
#include <cmath>

#include "frame_arguments.h"

namespace room2dgs {

bool has_avx2_kernels() { return has_avx2(); }

namespace {

Camera camera_of(Arguments& check, const Input& cam_from_world, const Input& K, int64_t width, int64_t height,
                 double near) {
  Camera c;
  const double *m = check.input<double>("cam_from_world", cam_from_world, {4, 4}), *k = check.input<double>("K", K, {3, 3});
  require(width >= 1 && width <= kMaxSide && height >= 1 && height <= kMaxSide,
          "image size " + std::to_string(width) + " x " + std::to_string(height) + " is not in 1.." +
              std::to_string(kMaxSide));
  require(std::isfinite(near) && near > 0, "near is " + std::to_string(near) + ", not a distance above 0");
  require(std::isfinite(k[0]) && k[0] > 0 && std::isfinite(k[4]) && k[4] > 0 && std::isfinite(k[2]) && std::isfinite(k[5]),
          "K has a focal length that is not above 0, or a number that is not finite");
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) c.R[3 * row + column] = m[4 * row + column];
    c.t[row] = m[4 * row + 3];
  }
  c.fx = k[0], c.fy = k[4], c.cx = k[2], c.cy = k[5];
  c.near = near, c.width = static_cast<int>(width), c.height = static_cast<int>(height);
  return c;
}

int64_t forward(RasterFrame& f, const Input& centers, const Input& rotations, const Input& scales,
                const Input& opacities, const Input& sh, const Input& cam_from_world, const Input& K, int64_t width,
                int64_t height, double near, const Input& background, const Output& color, const Output& alpha,
                const Output& depth, const Output& median, const OptionalOutput& normal,
                const OptionalOutput& distortion) {
  Claim claim(f);
  Arguments check;
  const Camera camera = camera_of(check, cam_from_world, K, width, height, near);
  const SurfelArrays surfels = surfels_of(check, centers, rotations, scales, opacities, sh);
  const float* behind = check.input<float>("background", background, {3});
  const Images out = images_of(check, width, height, color, alpha, depth, median, normal, distortion);
  require(normal || !distortion, "distortion is drawn with the normal or not at all: normal is None");
  f.view = 0;
  std::copy(behind, behind + 3, f.background);
  {
    nb::gil_scoped_release release;
    f.forward(camera, surfels, out);
  }
  f.has_normal = normal.has_value(), f.has_distortion = distortion.has_value();
  return static_cast<int64_t>(f.view = ++f.views);
}

void backward(RasterFrame& f, int64_t view, const Input& centers, const Input& rotations, const Input& scales,
              const Input& opacities, const Input& sh, const Input& alpha, const Input& depth,
              const OptionalInput& g_color, const OptionalInput& g_alpha, const OptionalInput& g_depth,
              const OptionalInput& g_median, const OptionalInput& g_normal, const OptionalInput& g_distortion,
              const Output& to_centers, const Output& to_rotations, const Output& to_scales,
              const Output& to_opacities, const Output& to_sh, const Output& to_center_px, const Output& to_pose,
              const Output& to_K, const OptionalOutput& to_background) {
  Claim claim(f);
  Arguments check;
  require_view(f);
  require(view == static_cast<int64_t>(f.view), "the frame has drawn another view since: its backward pass is lost");
  const SurfelArrays surfels = surfels_of(check, centers, rotations, scales, opacities, sh);
  require(surfels.count == f.count, std::to_string(surfels.count) + " surfels come back, " + std::to_string(f.count) +
                                        " were drawn");
  require(!g_normal || f.has_normal, "g_normal flows back to a normal that was not drawn");
  require(!g_distortion || f.has_distortion, "g_distortion flows back to a distortion that was not drawn");
  const int64_t n = f.count, height = f.camera.height, width = f.camera.width, terms = surfels.sh_count;
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
  CameraGradient camera;
  {
    nb::gil_scoped_release release;
    f.backward(surfels, out, g, to, camera);
    if (behind) f.background_backward(g.color, behind);
  }
  std::fill(pose, pose + 16, 0.0), std::fill(K, K + 9, 0.0);
  for (int row = 0; row < 3; ++row) {
    std::copy(camera.R + 3 * row, camera.R + 3 * row + 3, pose + 4 * row);
    pose[4 * row + 3] = camera.t[row];
  }
  K[0] = camera.fx, K[4] = camera.fy, K[2] = camera.cx, K[5] = camera.cy;
}

}  // namespace

void bind_splat(nb::module_& m) {
  nb::class_<RasterFrame>(m, "RasterFrame", "One rendered view: what its backward pass needs.")
      .def(nb::init<>())
      .def_prop_ro("visible", [](RasterFrame& f) { Claim claim(f); return f.visible; }, "Surfels that reach a pixel.")
      .def_prop_ro("entries", [](RasterFrame& f) { Claim claim(f); return f.entries; }, "(surfel, tile) pairs.")
      .def("forward", &forward, as_is("centers"), as_is("rotations"), as_is("scales"), as_is("opacities"), as_is("sh"),
           as_is("cam_from_world"), as_is("K"), nb::arg("width"), nb::arg("height"), nb::arg("near"),
           as_is("background"), as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"), or_none("normal"),
           or_none("distortion"),
           "Draws a view into the maps. Gives its number, which `backward` asks for. cam_from_world and K are float64, "
           "all else float32.")
      .def("backward", &backward, nb::arg("view"), as_is("centers"), as_is("rotations"), as_is("scales"),
           as_is("opacities"), as_is("sh"), as_is("alpha"), as_is("depth"), or_none("g_color"), or_none("g_alpha"),
           or_none("g_depth"), or_none("g_median"), or_none("g_normal"), or_none("g_distortion"), as_is("to_centers"),
           as_is("to_rotations"), as_is("to_scales"), as_is("to_opacities"), as_is("to_sh"), as_is("to_center_px"),
           as_is("to_pose"), as_is("to_K"), or_none("to_background"),
           "The gradients of the frame's last view, which must be number `view`; alpha and depth are its maps. to_pose, "
           "to_K and to_background are float64, all else float32.");
}

}  // namespace room2dgs
