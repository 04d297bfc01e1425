// Binds the rasterizer: every argument is checked here, whatever the Python wrapper (splat/cpu_view.py) has checked.
#include <algorithm>
#include <cmath>
#include <utility>

#include "frame_arguments.h"

namespace room2dgs {

namespace {

Camera camera_of(const ViewArrays& view) {
  Camera c;
  const double *m = view.cam_from_world, *k = view.K;
  require(std::isfinite(k[0]) && k[0] > 0 && std::isfinite(k[4]) && k[4] > 0 && std::isfinite(k[2]) && std::isfinite(k[5]),
          "K has a focal length that is not above 0, or a number that is not finite");
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) c.R[3 * row + column] = m[4 * row + column];
    c.t[row] = m[4 * row + 3];
  }
  c.fx = k[0], c.fy = k[4], c.cx = k[2], c.cy = k[5];
  c.near = view.near, c.opacity_floor = view.opacity_floor, c.width = view.width, c.height = view.height;
  return c;
}

void draw_with(RasterFrame& f, const Camera& camera, const ViewArrays& view, const SurfelArrays& splats, const Images& out) {
  f.view = 0;
  std::copy(view.background, view.background + 3, f.background);
  nb::gil_scoped_release release;
  f.forward(camera, splats, out);
}

bool draw(RasterFrame& f, const Arguments&, const ViewArrays& view, const SurfelArrays& surfels, const Images& out) {
  draw_with(f, camera_of(view), view, surfels, out);
  return true;
}

bool draw_gaussians(GaussianFrame& f, const Arguments&, const ViewArrays& view, const SurfelArrays& gaussians,
                    const Images& out, double filter_px2, bool compensated) {
  require_filter(filter_px2);
  Camera camera = camera_of(view);
  camera.filter_px2 = filter_px2, camera.compensated = compensated;
  draw_with(f, camera, view, gaussians, out);
  return true;
}

void run_back(RasterFrame& f, const BackwardArrays& a) {
  CameraGradient<double> camera;
  f.backward(a.surfels, a.maps, a.from, a.to, camera);
  if (a.to_background) f.background_backward(a.from.color, a.to_background);
  std::fill(a.to_pose, a.to_pose + 16, 0.0), std::fill(a.to_K, a.to_K + 9, 0.0);
  for (int row = 0; row < 3; ++row) {
    std::copy(camera.R + 3 * row, camera.R + 3 * row + 3, a.to_pose + 4 * row);
    a.to_pose[4 * row + 3] = camera.t[row];
  }
  a.to_K[0] = camera.fx, a.to_K[4] = camera.fy, a.to_K[2] = camera.cx, a.to_K[5] = camera.cy;
}

template <class Frame, class Draw, class... Extras>
void bind_frame(nb::module_& m, const char* name, Draw draw_view, const char* about, const Extras&... extras) {
  auto frame =
      nb::class_<Frame>(m, name, "One rendered view: what its backward pass needs.")
          .def(nb::init<>())
          .def_prop_ro("visible", [](Frame& f) { Claim claim(f); return f.visible; }, "Surfels that reach a pixel.")
          .def_prop_ro("entries", [](Frame& f) { Claim claim(f); return f.entries; }, "(surfel, tile) pairs.");
  const auto start = [](const Frame&, const Input&) { return Arguments(); };
  def_forward(frame, about, start, draw_view, extras...);
  def_backward(
      frame, start, [](const Frame& f) { return std::pair<int64_t, int64_t>(f.camera.width, f.camera.height); },
      run_back);
}

}  // namespace

void bind_splat(nb::module_& m) {
  bind_frame<RasterFrame>(m, "RasterFrame", draw,
                          "Draws a view into the maps. Gives its number, which `backward` asks for. cam_from_world and K "
                          "are float64, all else float32.");
  bind_frame<GaussianFrame>(m, "GaussianFrame", draw_gaussians,
                            "As RasterFrame's, of 3D Gaussians: scales are (n, 3).",
                            extra<double>(nb::arg("filter_px2")), extra<bool>(nb::arg("compensated")));
}

}  // namespace room2dgs
