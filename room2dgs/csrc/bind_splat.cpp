// Binds the rasterizer. Arrays are float32, contiguous and checked for shape by the Python wrapper (splat/raster.py).
#include <algorithm>
#include <chrono>
#include <memory>
#include <vector>

#include "bind.h"

#include <optional>
#include "parallel.h"
#include "raster_frame.h"

namespace room2dgs {

bool has_avx2_kernels() { return has_avx2(); }

namespace {

using FloatArray = Array<float>;
using ConstArray = Array<const float>;

Camera camera_of(const Array<const double>& cam_from_world, const Array<const double>& K, int width, int height, double near) {
  Camera c;
  const double *m = cam_from_world.data(), *k = K.data();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) c.R[3 * row + column] = m[4 * row + column];
    c.t[row] = m[4 * row + 3];
  }
  c.fx = k[0], c.fy = k[4], c.cx = k[2], c.cy = k[5];
  c.near = near, c.width = width, c.height = height;
  return c;
}

SurfelArrays surfels_of(const ConstArray& centers, const ConstArray& rotations, const ConstArray& scales,
                        const ConstArray& opacities, const ConstArray& sh) {
  return {static_cast<int64_t>(centers.shape(0)), centers.data(), rotations.data(), scales.data(),
          opacities.data(), sh.data(), static_cast<int>(sh.shape(1))};
}

template <class A>
auto* data_or_null(std::optional<A>& a) {
  return a ? a->data() : nullptr;
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

}  // namespace

void bind_splat(nb::module_& m) {
  nb::class_<RasterFrame>(m, "RasterFrame", "One rendered view: what its backward pass needs.")
      .def(nb::init<>())
      .def_ro("visible", &RasterFrame::visible)
      .def_ro("entries", &RasterFrame::entries)
      .def(
          "forward",
          [](RasterFrame& f, ConstArray centers, ConstArray rotations, ConstArray scales, ConstArray opacities,
             ConstArray sh, Array<const double> cam_from_world, Array<const double> K, int width, int height, double near,
             ConstArray background, FloatArray color, FloatArray alpha, FloatArray depth, FloatArray median,
             std::optional<FloatArray> normal, std::optional<FloatArray> distortion) {
            std::copy(background.data(), background.data() + 3, f.background);
            const Images out{color.data(), alpha.data(), depth.data(), median.data(), data_or_null(normal),
                             data_or_null(distortion)};
            nb::gil_scoped_release release;
            f.forward(camera_of(cam_from_world, K, width, height, near),
                      surfels_of(centers, rotations, scales, opacities, sh), out);
          },
          nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
          nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none())
      .def(
          "backward",
          [](RasterFrame& f, ConstArray centers, ConstArray rotations, ConstArray scales, ConstArray opacities,
             ConstArray sh, ConstArray alpha, ConstArray depth, std::optional<ConstArray> g_color, std::optional<ConstArray> g_alpha,
             std::optional<ConstArray> g_depth, std::optional<ConstArray> g_median, std::optional<ConstArray> g_normal,
             std::optional<ConstArray> g_distortion, FloatArray to_centers, FloatArray to_rotations,
             FloatArray to_scales, FloatArray to_opacities, FloatArray to_sh, FloatArray to_center_px,
             FloatArray to_pose) {
            Images out{};
            out.alpha = const_cast<float*>(alpha.data());
            out.depth = const_cast<float*>(depth.data());
            const ImageGradients g{data_or_null(g_color),  data_or_null(g_alpha),  data_or_null(g_depth),
                                   data_or_null(g_median), data_or_null(g_normal), data_or_null(g_distortion)};
            PoseGradient pose;
            {
              nb::gil_scoped_release release;
              f.backward(surfels_of(centers, rotations, scales, opacities, sh), out, g,
                         {to_centers.data(), to_rotations.data(), to_scales.data(), to_opacities.data(), to_sh.data(),
                          to_center_px.data()},
                         pose);
            }
            for (int row = 0; row < 3; ++row) {
              for (int column = 0; column < 3; ++column)
                to_pose.data()[4 * row + column] = static_cast<float>(pose.R[3 * row + column]);
              to_pose.data()[4 * row + 3] = static_cast<float>(pose.t[row]);
            }
            for (int k = 12; k < 16; ++k) to_pose.data()[k] = 0;
          },
          nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(),
          nb::arg().none(), nb::arg().none(), nb::arg().none(), nb::arg().none(), nb::arg(), nb::arg(), nb::arg(),
          nb::arg(), nb::arg(), nb::arg(), nb::arg())
      .def(
          "time_stages",
          [](RasterFrame& f, ConstArray centers, ConstArray rotations, ConstArray scales, ConstArray opacities,
             ConstArray sh, ConstArray color, ConstArray alpha, ConstArray depth, ConstArray median,
             ConstArray normal) {
            const SurfelArrays surfels = surfels_of(centers, rotations, scales, opacities, sh);
            const Images out{const_cast<float*>(color.data()), const_cast<float*>(alpha.data()),
                             const_cast<float*>(depth.data()), const_cast<float*>(median.data()),
                             const_cast<float*>(normal.data()), nullptr};
            nb::dict seconds;
            Timer timer;
            f.project(f.camera, surfels);
            seconds["project"] = timer.lap();
            f.sort_by_depth();
            seconds["sort"] = timer.lap();
            f.list_tiles();
            seconds["list"] = timer.lap();
            const BlendArgs args = f.blend_args();
            parallel_for(f.tile_count(), [&](int64_t tile, int) { kernels().blend(args, out, tile); });
            seconds["blend"] = timer.lap();
            return seconds;
          },
          "Renders the last view again and gives the seconds of each stage of the forward pass.")
      .def(
          "bare_loop",
          [](RasterFrame& f, ConstArray color, ConstArray alpha, ConstArray depth, ConstArray median, ConstArray normal,
             std::optional<ConstArray> g_color, int64_t every, int repeats) {
            const Images out{const_cast<float*>(color.data()), const_cast<float*>(alpha.data()),
                             const_cast<float*>(depth.data()), const_cast<float*>(median.data()),
                             const_cast<float*>(normal.data()), nullptr};
            // the same incoming image serves for all three: only the arithmetic counts
            const ImageGradients g{data_or_null(g_color), nullptr, depth.data(), nullptr, data_or_null(g_color), nullptr};
            const BlendArgs args = f.blend_args();
            f.entry_sums.grow(static_cast<int64_t>(f.entries) * kGradients);
            double seconds = 0;
            int64_t pairs = 0;
            for (int64_t tile = every / 2; tile < f.tile_count(); tile += every) {
              pairs += kernels().count_pairs(args, out, tile);
              double best = 1e9;
              for (int k = 0; k < repeats; ++k) {
                Timer timer;
                if (g_color) kernels().blend_backward(args, out, g, tile, f.entry_sums.data());
                else kernels().blend(args, out, tile);
                best = std::min(best, timer.lap());
              }
              seconds += best;
            }
            return nb::make_tuple(seconds, pairs);
          },
          nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg("every"), nb::arg("repeats"),
          "Seconds and (pixel, surfel) pairs of every n-th tile, each run over and over with its data in the cache.")
      .def(
          "count_pairs",
          [](RasterFrame& f, ConstArray color, ConstArray alpha, ConstArray depth, ConstArray median, ConstArray normal) {
            const Images out{const_cast<float*>(color.data()), const_cast<float*>(alpha.data()),
                             const_cast<float*>(depth.data()), const_cast<float*>(median.data()),
                             const_cast<float*>(normal.data()), nullptr};
            return f.count_pairs(out);
          },
          "(pixel, surfel) pairs that the last view evaluates.")
      .def(
          "tiles_of",
          [](RasterFrame& f, FloatArray counts) {
            for (int64_t i = 0; i < f.count; ++i) counts.data()[i] = static_cast<float>(f.extents[i].tiles);
          },
          "Fills (N,) with the number of tiles that each surfel reaches.");
}

}  // namespace room2dgs
