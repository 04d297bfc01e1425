// What the bindings of both rasterizers and of the bench share: a frame held by one caller, its arrays checked.
#pragma once

#include <atomic>
#include <cmath>
#include <stdexcept>
#include <string>

#include "arrays.h"
#include "raster_frame.h"

namespace room2dgs {

// Buffers hold one view: two threads that drew into one frame would write past each other's lists.
template <class Frame>
class Claim {
 public:
  explicit Claim(Frame& frame) : frame_(frame) {
    if (frame_.busy.exchange(true)) throw std::runtime_error("the frame is in use by another thread");
  }
  ~Claim() { frame_.busy = false; }
  Claim(const Claim&) = delete;

 private:
  Frame& frame_;
};

// The variance of a pixel's own filter of 3D Gaussians.
inline void require_filter(double filter_px2) {
  require(filter_px2 >= 0.01 && filter_px2 <= 1, "filter_px2 is " + std::to_string(filter_px2) + ", not from 0.01 to 1");
}

inline SurfelArrays surfels_of(Arguments& check, int64_t scale_count, const Input& centers, const Input& rotations,
                               const Input& scales, const Input& opacities, const Input& sh) {
  const int64_t n = lengths("centers", centers, 2)[0], terms = lengths("sh", sh, 3)[1];
  require(n <= kMaxSurfels, std::to_string(n) + " surfels are more than " + std::to_string(kMaxSurfels));
  require(terms == 1 || terms == 4 || terms == 9 || terms == 16,
          "sh has " + std::to_string(terms) + " coefficients a surfel, not 1, 4, 9 or 16");
  return {n,
          check.input<float>("centers", centers, {n, 3}),
          check.input<float>("rotations", rotations, {n, 4}),
          check.input<float>("scales", scales, {n, scale_count}),
          check.input<float>("opacities", opacities, {n}),
          check.input<float>("sh", sh, {n, terms, 3}),
          static_cast<int>(terms)};
}

// The maps of a view's size; `normal` and `distortion` may be None.
inline Images images_of(Arguments& check, int64_t width, int64_t height, const Output& color, const Output& alpha, const Output& depth,
                 const Output& median, const OptionalOutput& normal, const OptionalOutput& distortion) {
  return {check.output<float>("color", color, {height, width, 3}),
          check.output<float>("alpha", alpha, {height, width}),
          check.output<float>("depth", depth, {height, width}),
          check.output<float>("median", median, {height, width}),
          check.output<float>("normal", normal, {height, width, 3}),
          check.output<float>("distortion", distortion, {height, width})};
}

template <class Frame>
void require_view(const Frame& f) {
  require(f.view != 0, "the frame holds no view: forward comes first");
}

// Of a view, where the surfels are; not looked at yet.
struct ViewArrays {
  const double *cam_from_world, *K;  // (4, 4), (3, 3)
  const float* background;           // (3)
  double near;
  float opacity_floor;
  int width, height;
  int device;  // of the surfels
};

// Of a backward pass. Of the maps only alpha and depth are there: read only, they are what the forward pass wrote.
struct BackwardArrays {
  SurfelArrays surfels;
  Images maps;
  ImageGradients from;
  SurfelGradients to;
  double *to_pose, *to_K, *to_background;
};

// An argument of one frame alone, behind those of all.
template <class T, class Named>
struct Extra {
  Named named;
};
template <class T, class Named>
Extra<T, Named> extra(const Named& named) {
  return {named};
}

// Binds `forward`. start(frame, centers) gives the `Arguments` by which the arrays are checked, and
// draw(frame, arguments, ViewArrays, SurfelArrays, Images, extra...) false where it draws nothing.
template <class Frame, class Start, class Draw, class... More, class... Named>
void def_forward(nb::class_<Frame>& type, const char* about, Start start, Draw draw, const Extra<More, Named>&... extra) {
  type.def(
      "forward",
      [start, draw](Frame& f, const Input& centers, const Input& rotations, const Input& scales, const Input& opacities,
                    const Input& sh, const Input& cam_from_world, const Input& K, int64_t width, int64_t height,
                    double near, double opacity_floor, const Input& background, const Output& color,
                    const Output& alpha, const Output& depth, const Output& median, const OptionalOutput& normal,
                    const OptionalOutput& distortion, More... more) -> int64_t {
        Claim claim(f);
        Arguments check = start(f, centers);
        require(width >= 1 && width <= kMaxSide && height >= 1 && height <= kMaxSide,
                "image size " + std::to_string(width) + " x " + std::to_string(height) + " is not in 1.." +
                    std::to_string(kMaxSide));
        require(std::isfinite(near) && near > 0, "near is " + std::to_string(near) + ", not a distance above 0");
        require(opacity_floor >= 1.0 / 255 && opacity_floor < 1,
                "opacity_floor is " + std::to_string(opacity_floor) + ", not a share from 1/255 to below 1");
        const ViewArrays view{check.input<double>("cam_from_world", cam_from_world, {4, 4}),
                              check.input<double>("K", K, {3, 3}),
                              check.input<float>("background", background, {3}),
                              near,
                              static_cast<float>(opacity_floor),
                              static_cast<int>(width),
                              static_cast<int>(height),
                              centers.device_id()};
        const SurfelArrays surfels = surfels_of(check, Frame::kScales, centers, rotations, scales, opacities, sh);
        const Images out = images_of(check, width, height, color, alpha, depth, median, normal, distortion);
        require(normal || !distortion, "distortion is drawn with the normal or not at all: normal is None");
        if (!draw(f, check, view, surfels, out, more...)) return 0;
        f.has_normal = normal.has_value(), f.has_distortion = distortion.has_value();
        return static_cast<int64_t>(f.view = ++f.views);
      },
      as_is("centers"), as_is("rotations"), as_is("scales"), as_is("opacities"), as_is("sh"), as_is("cam_from_world"),
      as_is("K"), nb::arg("width"), nb::arg("height"), nb::arg("near"), nb::arg("opacity_floor"), as_is("background"),
      as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"), or_none("normal"), or_none("distortion"),
      extra.named..., about);
}

// Binds `backward`, likewise: run(frame, BackwardArrays, extra...) without Python's lock. `size(frame)` is the view's
// (width, height).
template <class Frame, class Start, class Size, class Run, class... More, class... Named>
void def_backward(nb::class_<Frame>& type, Start start, Size size, Run run, const Extra<More, Named>&... extra) {
  type.def(
      "backward",
      [start, size, run](Frame& f, int64_t view, const Input& centers, const Input& rotations, const Input& scales,
                         const Input& opacities, const Input& sh, const Input& alpha, const Input& depth,
                         const OptionalInput& g_color, const OptionalInput& g_alpha, const OptionalInput& g_depth,
                         const OptionalInput& g_median, const OptionalInput& g_normal,
                         const OptionalInput& g_distortion, const Output& to_centers, const Output& to_rotations,
                         const Output& to_scales, const Output& to_opacities, const Output& to_sh,
                         const Output& to_center_px, const Output& to_pose, const Output& to_K,
                         const OptionalOutput& to_background, More... more) {
        Claim claim(f);
        require_view(f);
        require(view == static_cast<int64_t>(f.view), "the frame has drawn another view since: its backward pass is lost");
        Arguments check = start(f, centers);
        const SurfelArrays surfels = surfels_of(check, Frame::kScales, centers, rotations, scales, opacities, sh);
        const int64_t n = f.count, terms = surfels.sh_count;
        require(surfels.count == n, std::to_string(surfels.count) + " surfels come back, " + std::to_string(n) +
                                        " were drawn");
        require(!g_normal || f.has_normal, "g_normal flows back to a normal that was not drawn");
        require(!g_distortion || f.has_distortion, "g_distortion flows back to a distortion that was not drawn");
        const auto [width, height] = size(f);
        Images maps{};
        maps.alpha = const_cast<float*>(check.input<float>("alpha", alpha, {height, width}));
        maps.depth = const_cast<float*>(check.input<float>("depth", depth, {height, width}));
        const ImageGradients from{check.input<float>("g_color", g_color, {height, width, 3}),
                                  check.input<float>("g_alpha", g_alpha, {height, width}),
                                  check.input<float>("g_depth", g_depth, {height, width}),
                                  check.input<float>("g_median", g_median, {height, width}),
                                  check.input<float>("g_normal", g_normal, {height, width, 3}),
                                  check.input<float>("g_distortion", g_distortion, {height, width})};
        const SurfelGradients to{check.output<float>("to_centers", to_centers, {n, 3}),
                                 check.output<float>("to_rotations", to_rotations, {n, 4}),
                                 check.output<float>("to_scales", to_scales, {n, Frame::kScales}),
                                 check.output<float>("to_opacities", to_opacities, {n}),
                                 check.output<float>("to_sh", to_sh, {n, terms, 3}),
                                 check.output<float>("to_center_px", to_center_px, {n, 2})};
        const BackwardArrays arrays{surfels, maps, from, to, check.output<double>("to_pose", to_pose, {4, 4}),
                                    check.output<double>("to_K", to_K, {3, 3}),
                                    check.output<double>("to_background", to_background, {3})};
        require(!arrays.to_background || from.color, "to_background comes from g_color: it is None");
        nb::gil_scoped_release release;
        run(f, arrays, more...);
      },
      nb::arg("view"), as_is("centers"), as_is("rotations"), as_is("scales"), as_is("opacities"), as_is("sh"),
      as_is("alpha"), as_is("depth"), or_none("g_color"), or_none("g_alpha"), or_none("g_depth"), or_none("g_median"),
      or_none("g_normal"), or_none("g_distortion"), as_is("to_centers"), as_is("to_rotations"), as_is("to_scales"),
      as_is("to_opacities"), as_is("to_sh"), as_is("to_center_px"), as_is("to_pose"), as_is("to_K"),
      or_none("to_background"), extra.named...,
      "The gradients of the frame's last view, which must be number `view`; alpha and depth are its maps. to_pose, "
      "to_K and to_background are float64, all else float32.");
}

}  // namespace room2dgs
