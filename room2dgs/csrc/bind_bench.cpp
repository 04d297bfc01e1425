// Binds what `room2dgs bench raster` measures by: the stages of a view on their own, and its counts. A module of its own,
// `_C.bench`; nothing that renders or trains calls it.
#include <algorithm>
#include <chrono>

#include "counted.h"  // first: templates see the scalars that stand before them
#include "frame_arguments.h"
#include "parallel.h"
#include "pixel.h"
#include "sh.h"

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
  const SurfelArrays surfels = surfels_of(check, RasterFrame::kScales, centers, rotations, scales, opacities, sh);
  const Images out = images_of(check, f.camera.width, f.camera.height, color, alpha, depth, median, normal, std::nullopt);
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
  const Images out = images_of(check, f.camera.width, f.camera.height, color, alpha, depth, median, normal, std::nullopt);
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
  return f.count_pairs(images_of(check, f.camera.width, f.camera.height, color, alpha, depth, median, normal, std::nullopt));
}

// What a GPU's warps do over each tile's list: those of 16 x 2 pixels that walk over all of it, as gsplat's, and those of
// 8 x 4 that look at surfels alone that reach them, as ours (block_blend.cu). Lists are walked to their end by pixels
// that stay light.
void tile_work(RasterFrame& f, int64_t every, const Output& work) {
  using namespace isa_baseline;
  constexpr int kColumns = 11, kWarps = kTilePixels / 32;
  Claim claim(f);
  Arguments check;
  require_view(f);
  require(every >= 1, "every is 1 or more");
  double* rows = check.output<double>("work", work, {f.tile_count(), kColumns});
  const BlendArgs a = f.blend_args();
  const auto row_warp = [](int p) { return p / 32; };
  const auto patch = [](int p) { return p / kTile / 4 * 2 + p % kTile / 8; };
  parallel_for(f.tile_count(), [&](int64_t tile, int) {
    const int x = static_cast<int>(tile % a.tiles_x) * kTile, y = static_cast<int>(tile / a.tiles_x) * kTile;
    const Item* items = a.items + a.tile_begin[tile];
    const int count = static_cast<int>(a.tile_begin[tile + 1] - a.tile_begin[tile]);
    struct Ends {
      int forward[kWarps] = {}, backward[kWarps] = {};
    } ends, patch_ends;
    for (int p = 0; p < kTilePixels; ++p) {
      if (x + p % kTile >= a.width || y + p / kTile >= a.height) continue;
      const int last = a.state.last[tile * kTilePixels + p];
      const int walked = a.state.transmittance[tile * kTilePixels + p] >= kTransmittanceMin ? count : last;
      const auto reach = [&](Ends& e, int warp) {
        e.forward[warp] = std::max(e.forward[warp], walked), e.backward[warp] = std::max(e.backward[warp], last);
      };
      reach(ends, row_warp(p)), reach(patch_ends, patch(p));
    }
    const int tile_forward = *std::max_element(ends.forward, ends.forward + kWarps);
    const bool sampled = tile % every == every / 2 % every;
    int64_t kept = 0, kept_warps = 0, near_forward = 0, near_backward = 0, kept_patches = 0;
    for (int j = 0; sampled && j < tile_forward; ++j) {
      const Record& r = a.records[items[j].record];
      uint32_t near = 0, blended = 0, blended_rows = 0;  // bits of patches, and of rows' warps
      for (int p = 0; p < kTilePixels; ++p) {
        const float dx = x + p % kTile + 0.5f - r.cx - r.cx_rest, dy = y + p / kTile + 0.5f - r.cy - r.cy_rest;
        if (!(intersect<float>(r, dx, dy).raw >= a.opacity_floor)) continue;
        near |= 1u << patch(p);
        if (x + p % kTile >= a.width || y + p / kTile >= a.height || a.state.last[tile * kTilePixels + p] <= j) continue;
        blended |= 1u << patch(p), blended_rows |= 1u << row_warp(p), ++kept;
      }
      for (int k = 0; k < kWarps; ++k) {
        near_forward += (near >> k & 1) && j < patch_ends.forward[k];
        near_backward += (near >> k & 1) && j < patch_ends.backward[k];
      }
      kept_warps += __builtin_popcount(blended_rows), kept_patches += __builtin_popcount(blended);
    }
    double* row = rows + kColumns * tile;
    row[0] = count, row[1] = tile_forward;
    row[2] = *std::max_element(ends.backward, ends.backward + kWarps);
    row[3] = row[4] = 0;
    for (int warp = 0; warp < kWarps; ++warp) row[3] += ends.forward[warp], row[4] += ends.backward[warp];
    row[5] = tile_forward == count ? 1e30 : a.records[items[tile_forward - 1].record].z;
    const int64_t counted[] = {kept, kept_warps, near_forward, near_backward, kept_patches};
    for (int k = 0; k < 5; ++k) row[6 + k] = sampled ? static_cast<double>(counted[k]) : -1.0;
  });
}

nb::dict operations(int64_t terms) {
  require(terms == 1 || terms == 4 || terms == 9 || terms == 16, "terms is not 1, 4, 9 or 16");
  using namespace isa_baseline;
  const Camera view = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}, 500, 500, 320, 240, 0.05, 1.0f / 32, 640, 480};
  nb::dict counted;
  const auto lap = [&](const char* name) {
    const Operations o = Counted::done();
    nb::dict row;
    row["fma"] = o.fma, row["add"] = o.add, row["multiply"] = o.multiply, row["divide"] = o.divide;
    row["root"] = o.root, row["power"] = o.power, row["other"] = o.other;
    counted[name] = row;
    Counted::done() = {};
  };
  Counted::done() = {};
  const Surfel<Counted> surfel = {{0.1, 0.2, 2.0}, 0.9, 0.2, 0.3, 0.1, 0.02, 0.03};
  const Axes<Counted> axes = axes_of(surfel);
  const Projected<Counted> o = project(surfel, axes, view);
  lap("project");
  const Counted sums[kGradients] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
  const CameraGrad<Counted> c = project_backward(surfel, o, view, nine_from_sums(sums, o));
  Counted to_rotation[4];
  axes_backward(axes, rotate_transposed(view.R, c.tu), rotate_transposed(view.R, c.tv),
                rotate_transposed(view.R, c.tw) + o.side * Vec3<Counted>{1, 1, 1}, to_rotation);
  rotate_transposed(view.R, c.p);
  lap("project_backward");
  Counted inverse_distance, color[3];
  const Vec3<Counted> direction = view_direction(view, o, inverse_distance);
  const float sh[48] = {0.1f};
  color_of(sh, static_cast<int>(terms), direction, color);
  lap("color");
  const Vec3<Counted> gd = color_backward(sh, static_cast<int>(terms), direction, sums + kSumColor, [](int, Counted) {});
  inverse_distance * (gd + (-dot(gd, direction)) * direction);
  lap("color_backward");
  Record r{};
  r.z = 2, r.aux = r.avy = 0.2f, r.den_max = 40, r.log2_opacity = -0.5f;
  const Hit<Counted> hit = intersect<Counted>(r, 1.5, 0.5f);
  lap("intersect");
  hit_backward<Counted>(hit, true, 1, 1);
  lap("hit_backward");
  const Counted mu = shifted_depth<Counted>(2.1, 2.0);
  spread<Counted>(mu, 0.5, 0.1, 0.1);
  lap("distortion");
  return counted;
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
  m.def("tile_work", &tile_work, nb::arg("frame"), nb::arg("every"), as_is("work"),
        "Rows of the last view's tiles: surfels listed, walked until the tile is dark, and blended; of warps of 16 x 2 "
        "pixels the sums of these walked and blended; the depth at which the tile is dark; of every n-th tile (else -1) "
        "the (pixel, surfel) pairs that are blended, those of warps of 16 x 2, and of warps of 8 x 4 the pairs that reach "
        "it until it is dark, those until its last that is blended, and those blended.");
  m.def("operations", &operations, nb::arg("terms"), "Operations of the rasterizer's maths by function, counted in its source; `terms` SH coefficients.");
}

}  // namespace room2dgs
