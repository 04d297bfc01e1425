// Binds the rasterizer: every argument is checked here, whatever the Python wrapper (splat/raster.py) has checked.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "arrays.h"
#include "parallel.h"
#include "raster_frame.h"

namespace room2dgs {

bool has_avx2_kernels() { return has_avx2(); }

namespace {

// Buffers hold one view: two threads that drew into one frame would write past each other's lists.
class Claim {
 public:
  explicit Claim(RasterFrame& frame) : frame_(frame) {
    if (frame_.busy.exchange(true)) throw std::runtime_error("the frame is in use by another thread");
  }
  ~Claim() { frame_.busy = false; }
  Claim(const Claim&) = delete;

 private:
  RasterFrame& frame_;
};

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

SurfelArrays surfels_of(Arguments& check, const Input& centers, const Input& rotations, const Input& scales,
                        const Input& opacities, const Input& sh) {
  const int64_t n = lengths("centers", centers, 2)[0], terms = lengths("sh", sh, 3)[1];
  require(n <= kMaxSurfels, std::to_string(n) + " surfels are more than " + std::to_string(kMaxSurfels));
  require(terms == 1 || terms == 4 || terms == 9 || terms == 16,
          "sh has " + std::to_string(terms) + " coefficients a surfel, not 1, 4, 9 or 16");
  return {n,
          check.input<float>("centers", centers, {n, 3}),
          check.input<float>("rotations", rotations, {n, 4}),
          check.input<float>("scales", scales, {n, 2}),
          check.input<float>("opacities", opacities, {n}),
          check.input<float>("sh", sh, {n, terms, 3}),
          static_cast<int>(terms)};
}

// The maps of a view's size; `normal` and `distortion` may be None.
Images images_of(Arguments& check, const Camera& view, const Output& color, const Output& alpha, const Output& depth,
                 const Output& median, const OptionalOutput& normal, const OptionalOutput& distortion) {
  const int64_t height = view.height, width = view.width;
  return {check.output<float>("color", color, {height, width, 3}),
          check.output<float>("alpha", alpha, {height, width}),
          check.output<float>("depth", depth, {height, width}),
          check.output<float>("median", median, {height, width}),
          check.output<float>("normal", normal, {height, width, 3}),
          check.output<float>("distortion", distortion, {height, width})};
}

void require_view(const RasterFrame& f) { require(f.view != 0, "the frame holds no view: forward comes first"); }

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
  const Images out = images_of(check, camera, color, alpha, depth, median, normal, distortion);
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
              const Output& to_opacities, const Output& to_sh, const Output& to_center_px, const Output& to_pose) {
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
  float* pose_out = check.output<float>("to_pose", to_pose, {4, 4});
  PoseGradient pose;
  {
    nb::gil_scoped_release release;
    f.backward(surfels, out, g, to, pose);
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) pose_out[4 * row + column] = static_cast<float>(pose.R[3 * row + column]);
    pose_out[4 * row + 3] = static_cast<float>(pose.t[row]);
  }
  for (int k = 12; k < 16; ++k) pose_out[k] = 0;
}

struct Timer {
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - start).count();
    start = now;
    return seconds;
  }
};

nb::dict time_stages(RasterFrame& f, const Input& centers, const Input& rotations, const Input& scales,
                     const Input& opacities, const Input& sh, const Output& color, const Output& alpha,
                     const Output& depth, const Output& median, const Output& normal) {
  Claim claim(f);
  Arguments check;
  require_view(f);
  const SurfelArrays surfels = surfels_of(check, centers, rotations, scales, opacities, sh);
  const Images out = images_of(check, f.camera, color, alpha, depth, median, normal, std::nullopt);
  nb::dict seconds;
  Timer timer;
  f.view = 0;  // what the last backward pass would need goes
  f.project(f.camera, surfels);
  seconds["project"] = timer.lap();
  f.sort_by_depth();
  seconds["sort"] = timer.lap();
  f.list_tiles();
  seconds["list"] = timer.lap();
  const BlendArgs args = f.blend_args();
  parallel_for(f.tile_count(), [&](int64_t tile, int) { kernels().blend(args, out, tile); });
  seconds["blend"] = timer.lap();
  f.has_normal = true, f.has_distortion = false;
  f.view = ++f.views;
  return seconds;
}

nb::tuple bare_loop(RasterFrame& f, const Output& color, const Output& alpha, const Output& depth,
                    const Output& median, const Output& normal, const OptionalInput& g_color, int64_t every,
                    int64_t repeats) {
  Claim claim(f);
  Arguments check;
  require_view(f);
  require(every >= 1 && repeats >= 1, "every and repeats are 1 or more");
  const Images out = images_of(check, f.camera, color, alpha, depth, median, normal, std::nullopt);
  const float* g_image = check.input<float>("g_color", g_color, {f.camera.height, f.camera.width, 3});
  // the same incoming image serves for all three: only the arithmetic counts
  const ImageGradients g{g_image, nullptr, out.depth, nullptr, g_image, nullptr};
  const BlendArgs args = f.blend_args();
  f.entry_sums.grow(static_cast<int64_t>(f.entries) * kGradients);
  double seconds = 0;
  int64_t pairs = 0;
  for (int64_t tile = every / 2; tile < f.tile_count(); tile += every) {
    pairs += kernels().count_pairs(args, out, tile);
    double best = 1e9;
    for (int64_t k = 0; k < repeats; ++k) {
      Timer timer;
      if (g_color) kernels().blend_backward(args, out, g, tile, f.entry_sums.data());
      else kernels().blend(args, out, tile);
      best = std::min(best, timer.lap());
    }
    seconds += best;
  }
  return nb::make_tuple(seconds, pairs);
}

int64_t count_pairs(RasterFrame& f, const Output& color, const Output& alpha, const Output& depth,
                    const Output& median, const Output& normal) {
  Claim claim(f);
  Arguments check;
  require_view(f);
  return f.count_pairs(images_of(check, f.camera, color, alpha, depth, median, normal, std::nullopt));
}

void tiles_of(RasterFrame& f, const Output& counts) {
  Claim claim(f);
  Arguments check;
  require_view(f);
  float* tiles = check.output<float>("counts", counts, {f.count});
  for (int64_t i = 0; i < f.count; ++i) tiles[i] = static_cast<float>(f.extents[i].tiles);
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
           as_is("to_pose"),
           "The gradients of the frame's last view, which must be number `view`; alpha and depth are its maps.")
      .def("time_stages", &time_stages, as_is("centers"), as_is("rotations"), as_is("scales"), as_is("opacities"),
           as_is("sh"), as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"), as_is("normal"),
           "Renders the last view again and gives the seconds of each stage of the forward pass.")
      .def("bare_loop", &bare_loop, as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"), as_is("normal"),
           or_none("g_color"), nb::arg("every"), nb::arg("repeats"),
           "Seconds and (pixel, surfel) pairs of every n-th tile, each run over and over with its data in the cache.")
      .def("count_pairs", &count_pairs, as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"),
           as_is("normal"), "(pixel, surfel) pairs that the last view evaluates.")
      .def("tiles_of", &tiles_of, as_is("counts"), "Fills (N,) with the number of tiles that each surfel reaches.");
}

}  // namespace room2dgs
