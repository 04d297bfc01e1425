#include "raster_frame.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "parallel.h"

namespace room2dgs {
namespace {

constexpr int64_t kPrefetch = 16;
constexpr int64_t kListBlock = 4096;  // depth-sorted surfels a task of the tile lists

Span* room_for_spans(void* context, uint32_t first, uint32_t count) {
  auto& spans = *static_cast<std::vector<Span>*>(context);
  if (spans.size() < first + static_cast<size_t>(count)) spans.resize(2 * (first + static_cast<size_t>(count)));
  return spans.data() + first;
}

uint32_t depth_key(float depth) {  // positive floats sort as their bits do
  uint32_t bits;
  std::memcpy(&bits, &depth, 4);
  return bits;
}

}  // namespace

const Kernels& kernels() {
  static const Kernels table = R2_BEST(raster_kernels)();
  return table;
}
const Kernels& gaussian_kernels() {
  static const Kernels table = R2_BEST(gaussian_kernels)();
  return table;
}

void RasterFrame::project(const Camera& view, const SurfelArrays& surfels) {
  camera = view;
  count = surfels.count;
  const int64_t blocks = (count + kProjectBlock - 1) / kProjectBlock;
  records.grow(count);
  extents.grow(count);
  if (static_cast<int64_t>(spans.size()) < blocks) spans.resize(blocks);
  parallel_for(blocks, [&](int64_t block, int) {
    const int64_t begin = block * kProjectBlock, end = std::min(begin + kProjectBlock, count);
    table->project(camera, surfels, begin, end, records.data(), extents.data(), {&spans[block], &room_for_spans});
  });
  first_entry.grow(count + 1);
  uint64_t total = 0;
  visible = 0;
  for (int64_t i = 0; i < count; ++i) {
    first_entry[i] = static_cast<uint32_t>(total);
    total += extents[i].tiles;
    visible += extents[i].tiles != 0;
  }
  if (total > UINT32_MAX) {
    entries = 0;
    throw std::length_error("the surfels reach more than 2^32 tiles in this view: too many, too large for the image");
  }
  first_entry[count] = static_cast<uint32_t>(total);
  entries = static_cast<uint32_t>(total);
}

// Least significant digit first, so that equal depths stay in the order of their indices.
void RasterFrame::sort_by_depth() {
  order.grow(visible);
  order_scratch.grow(visible);
  constexpr int kDigit = 11, kBuckets = 1 << kDigit;
  std::vector<uint32_t> histogram(3 * kBuckets);
  int64_t n = 0;
  for (int64_t i = 0; i < count; ++i) {
    if (!extents[i].tiles) continue;
    const uint32_t key = depth_key(extents[i].depth);
    order[n++] = {key, static_cast<uint32_t>(i)};
    for (int pass = 0; pass < 3; ++pass) ++histogram[pass * kBuckets + (key >> (pass * kDigit) & (kBuckets - 1))];
  }
  for (int pass = 0; pass < 3; ++pass) {
    uint32_t* bucket = histogram.data() + pass * kBuckets;
    uint32_t sum = 0;
    for (int k = 0; k < kBuckets; ++k) sum += std::exchange(bucket[k], sum);
    const Keyed *from = pass % 2 ? order_scratch.data() : order.data();
    Keyed* to = pass % 2 ? order.data() : order_scratch.data();
    for (int64_t k = 0; k < visible; ++k) to[bucket[from[k].key >> (pass * kDigit) & (kBuckets - 1)]++] = from[k];
  }
  std::swap(order, order_scratch);
}

void RasterFrame::list_tiles() {
  const int64_t tiles = tile_count();
  const int64_t blocks = (visible + kListBlock - 1) / kListBlock;
  tile_begin.grow(tiles + 1);
  block_counts.grow(blocks * tiles);
  const int tiles_x = camera.tiles_x();
  placed.grow(visible);
  auto for_tiles = [&](const Placed& p, auto&& visit) {
    uint32_t entry = p.entry;
    for (int row = 0; row < p.rows; ++row)
      for (int x = p.spans[row].x0; x < p.spans[row].x1; ++x) visit((p.row + row) * tiles_x + x, Item{p.record, entry++});
  };
  parallel_for(blocks, [&](int64_t block, int) {
    const int64_t begin = block * kListBlock, end = std::min(begin + kListBlock, visible);
    uint32_t* counts = block_counts.data() + block * tiles;
    std::fill(counts, counts + tiles, 0u);
    // depth order is no order in memory: what a surfel needs is asked for well before, its spans once it is known
    // where they are
    auto spans_of = [&](uint32_t surfel) { return spans[surfel / kProjectBlock].data() + extents[surfel].span; };
    for (int64_t k = begin; k < end; ++k) {
      if (k + 2 * kPrefetch < end) {
        const uint32_t ahead = order[k + 2 * kPrefetch].index;
        __builtin_prefetch(&extents[ahead]);
        __builtin_prefetch(&first_entry[ahead]);
      }
      if (k + kPrefetch < end) __builtin_prefetch(spans_of(order[k + kPrefetch].index));
      const uint32_t surfel = order[k].index;
      const Extent& extent = extents[surfel];
      placed[k] = {spans_of(surfel), extent.record, first_entry[surfel], extent.row, extent.rows};
      for_tiles(placed[k], [&](int tile, Item) { ++counts[tile]; });
    }
  });
  uint32_t total = 0;
  for (int64_t tile = 0; tile < tiles; ++tile) {
    tile_begin[tile] = total;
    for (int64_t block = 0; block < blocks; ++block) total += std::exchange(block_counts[block * tiles + tile], total);
  }
  tile_begin[tiles] = total;
  items.grow(total);
  parallel_for(blocks, [&](int64_t block, int) {
    const int64_t begin = block * kListBlock, end = std::min(begin + kListBlock, visible);
    uint32_t* next = block_counts.data() + block * tiles;
    for (int64_t k = begin; k < end; ++k) {
      if (k + kPrefetch < end) __builtin_prefetch(placed[k + kPrefetch].spans);
      for_tiles(placed[k], [&](int tile, Item item) { items[next[tile]++] = item; });
    }
  });
}

BlendArgs RasterFrame::blend_args() {
  const int64_t pixels = tile_count() * kTilePixels;
  for (Buffer<float>* buffer : {&transmittance, &first_z, &m1, &m2}) buffer->grow(pixels);
  for (Buffer<int32_t>* buffer : {&last, &median}) buffer->grow(pixels);
  BlendArgs args{};
  args.records = records.data();
  args.items = items.data();
  args.tile_begin = tile_begin.data();
  args.opacity_floor = camera.opacity_floor;
  args.width = camera.width, args.height = camera.height, args.tiles_x = camera.tiles_x();
  std::copy(background, background + 3, args.background);
  args.state = {transmittance.data(), last.data(), median.data(), first_z.data(), m1.data(), m2.data()};
  return args;
}

void RasterFrame::forward(const Camera& view, const SurfelArrays& surfels, const Images& out) {
  project(view, surfels);
  sort_by_depth();
  list_tiles();
  const BlendArgs args = blend_args();
  parallel_for(tile_count(), [&](int64_t tile, int) { table->blend(args, out, tile); });
}

void RasterFrame::backward(const SurfelArrays& surfels, const Images& out, const ImageGradients& gradients,
                           const SurfelGradients& to, CameraGradient<double>& to_camera) {
  const BlendArgs args = blend_args();
  entry_sums.grow(static_cast<int64_t>(entries) * kGradients);
  parallel_for(tile_count(),
               [&](int64_t tile, int) { table->blend_backward(args, out, gradients, tile, entry_sums.data()); });
  const int64_t blocks = (count + kProjectBlock - 1) / kProjectBlock;
  std::vector<CameraGradient<double>> partial(blocks);
  parallel_for(blocks, [&](int64_t block, int) {
    const int64_t begin = block * kProjectBlock, end = std::min(begin + kProjectBlock, count);
    table->project_backward(camera, surfels, extents.data(), first_entry.data(), entry_sums.data(), begin, end, to,
                               &partial[block]);
  });
  to_camera = {};
  for (const CameraGradient<double>& p : partial) {
    for (int k = 0; k < 9; ++k) to_camera.R[k] += p.R[k];
    for (int k = 0; k < 3; ++k) to_camera.t[k] += p.t[k];
    to_camera.fx += p.fx, to_camera.fy += p.fy, to_camera.cx += p.cx, to_camera.cy += p.cy;
  }
}

void RasterFrame::background_backward(const float* g_color, double* to) {
  struct Sum {
    double channel[3];
  };
  std::vector<Sum> partial(tile_count());
  parallel_for(tile_count(), [&](int64_t tile, int) {
    const int x = static_cast<int>(tile % camera.tiles_x()) * kTile, y = static_cast<int>(tile / camera.tiles_x()) * kTile;
    Sum sum = {};
    for (int row = 0; row < kTile && y + row < camera.height; ++row)
      for (int column = 0; column < kTile && x + column < camera.width; ++column) {
        const double T = transmittance[tile * kTilePixels + row * kTile + column];
        const float* g = g_color + 3 * (static_cast<int64_t>(y + row) * camera.width + x + column);
        for (int c = 0; c < 3; ++c) sum.channel[c] += T * g[c];
      }
    partial[tile] = sum;
  });
  for (int c = 0; c < 3; ++c) to[c] = 0;
  for (const Sum& sum : partial)
    for (int c = 0; c < 3; ++c) to[c] += sum.channel[c];
}

int64_t RasterFrame::count_pairs(const Images& out) {
  const BlendArgs args = blend_args();
  int64_t pairs = 0;
  for (int64_t tile = 0; tile < tile_count(); ++tile) pairs += table->count_pairs(args, out, tile);
  return pairs;
}

}  // namespace room2dgs
