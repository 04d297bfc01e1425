// A pinhole and its pose as arguments of a binding; they lie on the CPU, wherever the images do.
#pragma once

#include <cmath>

#include "arrays.h"
#include "surface.h"

namespace room2dgs {

inline Pinhole pinhole(Arguments& check, double fx, double fy, double cx, double cy, const Input& cam_from_world) {
  require(std::isfinite(fx) && fx > 0 && std::isfinite(fy) && fy > 0 && std::isfinite(cx) && std::isfinite(cy),
          "fx or fy is not above 0, or one of fx, fy, cx, cy is not finite");
  const double* rotation = check.input<double>("cam_from_world", cam_from_world, {3, 3});
  Pinhole camera = {static_cast<float>(fx), static_cast<float>(fy), static_cast<float>(cx), static_cast<float>(cy), {}};
  for (int k = 0; k < 9; ++k) camera.cam_from_world[k] = static_cast<float>(rotation[k]);
  return camera;
}

}  // namespace room2dgs
