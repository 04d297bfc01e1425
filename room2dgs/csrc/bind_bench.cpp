// Binds what `room2dgs bench raster` measures by: the stages of a view on their own, and its counts. A module of its own,
// `_C.bench`; nothing that renders or trains calls it.
#include <algorithm>
#include <chrono>

#include "frame_arguments.h"
#include "parallel.h"

namespace room2dgs {
namespace {

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

}  // namespace

void bind_bench(nb::module_ m) {
  m.def("time_stages", &time_stages, nb::arg("frame"), as_is("centers"), as_is("rotations"), as_is("scales"),
        as_is("opacities"), as_is("sh"), as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"), as_is("normal"),
        "Renders the last view again and gives the seconds of each stage of the forward pass.");
  m.def("bare_loop", &bare_loop, nb::arg("frame"), as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"),
        as_is("normal"), or_none("g_color"), nb::arg("every"), nb::arg("repeats"),
        "Seconds and (pixel, surfel) pairs of every n-th tile, each run over and over with its data in the cache.");
  m.def("count_pairs", &count_pairs, nb::arg("frame"), as_is("color"), as_is("alpha"), as_is("depth"), as_is("median"),
        as_is("normal"), "(pixel, surfel) pairs that the last view evaluates.");
}

}  // namespace room2dgs
