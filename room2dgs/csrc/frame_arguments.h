// What the bindings of the rasterizer and of its bench share: a frame held by one caller, its arrays checked.
#pragma once

#include <atomic>
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

inline SurfelArrays surfels_of(Arguments& check, const Input& centers, const Input& rotations, const Input& scales,
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
inline Images images_of(Arguments& check, int64_t width, int64_t height, const Output& color, const Output& alpha, const Output& depth,
                 const Output& median, const OptionalOutput& normal, const OptionalOutput& distortion) {
  return {check.output<float>("color", color, {height, width, 3}),
          check.output<float>("alpha", alpha, {height, width}),
          check.output<float>("depth", depth, {height, width}),
          check.output<float>("median", median, {height, width}),
          check.output<float>("normal", normal, {height, width, 3}),
          check.output<float>("distortion", distortion, {height, width})};
}

inline void require_view(const RasterFrame& f) { require(f.view != 0, "the frame holds no view: forward comes first"); }

}  // namespace room2dgs
