// Blending over the tiles, forward and backward: a block a tile, a thread a pixel, a warp a patch of 8 x 4 pixels, which
// looks at those surfels alone that can reach it.
#include <cmath>
#include <stdexcept>

#include "block_frame.h"
#include "gaussian_pixel.h"
#include "pixel.h"

namespace R2_ISA {
namespace {

using room2dgs::ImageGradients;
using room2dgs::Images;
using room2dgs::kSumDen;
using room2dgs::kSumFilter;
using room2dgs::kSumU;
using room2dgs::kSumV;
using room2dgs::kSumZ;
using room2dgs::kTilePixels;

constexpr int kPatchX = 8, kPatchY = 4, kPatches = kTilePixels / kWarp;  // two side by side, four rows of them
static_assert(kPatches == 8 && kPatchX * kPatchY == kWarp, "a bit for each patch in a byte");
constexpr int kPieces = sizeof(Record) / 16;  // a record is copied by so many threads
static_assert(sizeof(Record) % 16 == 0, "records are copied 16 bytes at a time");

// A thread's pixel.
struct Place {
  int column, row;  // in the tile
  bool inside;
  int64_t image;    // in row-major maps
};
R2_HD Place place_of(const BlockTiles& a, int64_t tile, int thread) {
  const int warp = thread / kWarp, lane = thread % kWarp;
  Place p;
  p.column = (warp & 1) * kPatchX + lane % kPatchX, p.row = (warp >> 1) * kPatchY + lane / kPatchX;
  const int x = static_cast<int>(tile % a.tiles_x) * kTile + p.column, y = static_cast<int>(tile / a.tiles_x) * kTile + p.row;
  p.inside = x < a.width && y < a.height;
  p.image = p.inside ? static_cast<int64_t>(y) * a.width + x : 0;
  return p;
}
// Its offset from a record's centre, of which (ox, oy) is the tile's; added up as the CPU's kernels do.
R2_HD float dx_of(const Place& p, float ox) {
  const int first = p.column / kPatchX * kPatchX;
  return (static_cast<float>(p.column - first) + ox) + static_cast<float>(first);
}
R2_HD float dy_of(const Place& p, float oy) { return oy + static_cast<float>(p.row); }

// A bit for each patch in the rows [4 first, 4 (first + 2)) of patches that a record can reach; first is 0 or 1 halves.
R2_HD uint32_t patches_of(const Record& r, int x, int y, int half) {
  uint32_t reach = 0;
  for (int patch_row = 2 * half; patch_row < 2 * half + 2; ++patch_row) {
    const int top = y + patch_row * kPatchY;
    bool left = false, right = false;
    if (r.half_width < 0) {
      const bool rows = r.y0 < top + kPatchY && r.y1 >= top;
      left = rows && r.x0 < x + kPatchX && r.x1 >= x, right = rows && r.x1 >= x + kPatchX && r.x0 < x + kTile;
    } else {
      for (int k = 0; k < kPatchY; ++k) {
        const Columns<float> c = columns_of<float>(r, x, static_cast<float>(top + k) + 0.5f);
        left |= (c.left <= 7.0f) & (c.right >= 0.0f), right |= (c.left <= 15.0f) & (c.right >= 8.0f);
      }
    }
    reach |= (left ? 1u : 0u) << (2 * patch_row) | (right ? 2u : 0u) << (2 * patch_row);
  }
  return reach;
}

// `Hits`: SurfelHits or GaussianHits.
template <class Hits, bool kNormal, bool kDistortion>
struct BlendTiles {
  static constexpr int kThreads = kTilePixels, kBatch = 128;
  static_assert(2 * kBatch == kThreads, "two threads find the patches of a record");
  struct Shared {
    alignas(16) Record records[kBatch];
    uint8_t reach[2][kBatch];
    float floor;  // as a kernel's argument it would take a register
  };
  BlockTiles a;
  Images out;

  struct Pixel {
    float T, covered;  // kept apart: 1 - T has few digits where little is covered
    float red, green, blue, depth, median;
    int last, median_item;
    float nx, ny, nz;
    float distortion, first_z, m1, m2;
  };

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    const int64_t tile = block.index();
    const int x = static_cast<int>(tile % a.tiles_x) * kTile, y = static_cast<int>(tile / a.tiles_x) * kTile;
    const uint64_t* items = a.items + a.begin[tile];
    uint8_t* reach = a.reach + a.begin[tile];
    const int count = static_cast<int>(a.begin[tile + 1] - a.begin[tile]);
    Own<Pixel, kThreads> pixels;
    block.threads([&](int thread) {
      // pixels beyond the image are finished before they start
      pixels[thread] = {};
      pixels[thread].T = place_of(a, tile, thread).inside ? 1.0f : 0.0f;
      pixels[thread].median_item = -1;
    });
    for (int begin = 0; begin < count; begin += kBatch) {
      const int batch = count - begin < kBatch ? count - begin : kBatch;
      block.threads([&](int thread) {
        for (int k = thread; k < batch * kPieces; k += kThreads)
          copy_piece(s.records + k / kPieces, a.records + surfel_of(items[begin + k / kPieces]), k % kPieces);
      });
      block.threads([&](int thread) {
        if (thread == 0) s.floor = a.opacity_floor;
        const int j = thread / 2, half = thread % 2;
        s.reach[half][j] = static_cast<uint8_t>(j < batch ? patches_of(s.records[j], x, y, half) : 0);
      });
      Own<bool, kThreads> alive;
      block.warps([&](const Warp& warp) {
        for (int first = 0; first < batch; first += kWarp) {
          Own<bool, kWarp> hit;
          warp.lanes([&](int lane) {
            const int j = first + lane, all = s.reach[0][j] | s.reach[1][j];
            hit[lane] = all >> warp.index & 1;
            if (warp.index == 0 && j < batch) reach[begin + j] = static_cast<uint8_t>(all);  // for the way back
          });
          const uint32_t near = warp.ballot(hit);
          warp.lanes([&](int lane) {
            const int thread = warp.thread(lane);
            const Place p = place_of(a, tile, thread);
            Pixel& pixel = pixels[thread];
            for (uint32_t left = near; left && pixel.T >= kTransmittanceMin; left &= left - 1) {
              const int j = first + lowest_bit(left);
              const Record& r = s.records[j];
              add(r, s.floor, begin + j, dx_of(p, offset(x, r.cx, r.cx_rest)),
                  dy_of(p, offset(y, r.cy, r.cy_rest)), pixel);
            }
          });
        }
        warp.lanes([&](int lane) { alive[warp.thread(lane)] = pixels[warp.thread(lane)].T >= kTransmittanceMin; });
      });
      if (!block.any(alive)) break;
    }
    block.threads([&](int thread) { put_out(tile, thread, pixels[thread]); });
  }

  // One record to one pixel at (dx, dy) from its centre; `j` is its position in the list.
  static R2_KERNEL void add(const Record& r, float floor, int j, float dx, float dy, Pixel& p) {
    const Hit<float> h = Hits::hit(r, dx, row_terms(r, dy));
    if (!(h.raw >= floor)) return;
    const float alpha = alpha_of<float>(h.raw, true);
    const float weight = p.T * alpha, after = p.T * (1.0f - alpha), in_front = p.covered;
    p.covered = in_front + weight;
    p.red = fma(weight, r.color[0], p.red);
    p.green = fma(weight, r.color[1], p.green);
    p.blue = fma(weight, r.color[2], p.blue);
    p.depth = fma(weight, h.z, p.depth);
    p.last = j + 1;
    if (p.T > 0.5f && after <= 0.5f) p.median = h.z, p.median_item = j;
    if (kNormal) {
      p.nx = fma(weight, r.normal[0], p.nx);
      p.ny = fma(weight, r.normal[1], p.ny);
      p.nz = fma(weight, r.normal[2], p.nz);
    }
    if (kDistortion) {
      if (p.first_z == 0.0f) p.first_z = h.z;
      const float mu = shifted_depth(h.z, p.first_z), wmu = weight * mu;
      // about those in front
      p.distortion = fma(weight, vmax(spread(mu, in_front, p.m1, p.m2), 0.0f), p.distortion);
      p.m1 = p.m1 + wmu;
      p.m2 = fma(wmu, mu, p.m2);
    }
    p.T = after;
  }

  R2_KERNEL void put_out(int64_t tile, int thread, const Pixel& p) const {
    const int64_t k = tile * kTilePixels + thread;
    a.state.transmittance[k] = p.T, a.state.last[k] = p.last, a.state.median[k] = p.median_item;
    if (kDistortion) a.state.first_z[k] = p.first_z, a.state.m1[k] = p.m1, a.state.m2[k] = p.m2;
    const Place place = place_of(a, tile, thread);
    if (!place.inside) return;
    const int64_t q = place.image;
    out.color[3 * q] = p.red + p.T * a.background[0];
    out.color[3 * q + 1] = p.green + p.T * a.background[1];
    out.color[3 * q + 2] = p.blue + p.T * a.background[2];
    out.alpha[q] = p.covered;
    out.depth[q] = p.covered > 0 ? p.depth / p.covered : 0.0f;
    out.median[q] = p.median;
    if (kNormal) out.normal[3 * q] = p.nx, out.normal[3 * q + 1] = p.ny, out.normal[3 * q + 2] = p.nz;
    if (kDistortion) out.distortion[q] = p.distortion;
  }
};

// Every entry gets its sums from its own tile's block: those of a warp's pixels first, then of the warps, in one order.
template <class Hits, bool kNormal, bool kDistortion>
struct BlendTilesBackward {
  static constexpr int kThreads = kTilePixels, kBatch = kWarp;  // a bit a record
  static constexpr int kSums = kNormal ? 19 : 16;               // without those of the normal
  struct Shared {
    alignas(16) Record records[kBatch];
    uint32_t entry[kBatch];
    uint8_t reach[kBatch];
    int last[kPatches];
    uint32_t filled[kPatches];  // a bit for each record that a patch has sums of
    float sums[kPatches][kBatch][kSums];
  };
  BlockTiles a;
  Images out;
  ImageGradients g;
  float* entries;

  struct Pixel {
    float T, behind;  // `behind`: what the rest of the ray is worth, per unit of light
    float red, green, blue, alpha;
    float depth, expected;  // gradient of sum w z, and the expected depth itself
    float median;
    int last, median_item;
    float nx, ny, nz;
    float distortion, first_z, m1, m2, covered;
  };

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    const int64_t tile = block.index();
    const int x = static_cast<int>(tile % a.tiles_x) * kTile, y = static_cast<int>(tile / a.tiles_x) * kTile;
    const uint64_t* items = a.items + a.begin[tile];
    const uint8_t* reach = a.reach + a.begin[tile];
    const int count = static_cast<int>(a.begin[tile + 1] - a.begin[tile]);
    Own<Pixel, kThreads> pixels;
    block.warps([&](const Warp& warp) {
      Own<int, kWarp> lasts;
      warp.lanes([&](int lane) {
        const int thread = warp.thread(lane);
        pixels[thread] = load(tile, thread);
        lasts[lane] = pixels[thread].last;
      });
      const int last = warp.largest(lasts);
      warp.lanes([&](int lane) {
        if (lane == 0) s.last[warp.index] = last;
      });
    });
    int tile_last = 0;
    for (int k = 0; k < kPatches; ++k) tile_last = s.last[k] > tile_last ? s.last[k] : tile_last;

    const int batches = (tile_last + kBatch - 1) / kBatch;
    block.threads([&](int thread) {  // never blended here
      for (int k = batches * kBatch * kGradients + thread; k < count * kGradients; k += kThreads)
        entries[static_cast<int64_t>(entry_of(items[k / kGradients])) * kGradients + k % kGradients] = 0;
    });
    for (int begin = (batches - 1) * kBatch; begin >= 0; begin -= kBatch) {
      const int batch = count - begin < kBatch ? count - begin : kBatch;
      block.threads([&](int thread) {
        for (int k = thread; k < batch * kPieces; k += kThreads)
          copy_piece(s.records + k / kPieces, a.records + surfel_of(items[begin + k / kPieces]), k % kPieces);
        if (thread < batch) {
          s.entry[thread] = entry_of(items[begin + thread]);
          // what lies behind all pixels' last one was perhaps never looked at
          s.reach[thread] = begin + thread < tile_last ? reach[begin + thread] : 0;
        }
      });
      block.warps([&](const Warp& warp) {
        Own<bool, kWarp> hit;
        warp.lanes([&](int lane) {
          hit[lane] = lane < batch && begin + lane < s.last[warp.index] && (s.reach[lane] >> warp.index & 1);
        });
        uint32_t left = warp.ballot(hit), filled = 0;
        while (left) {
          const int j = highest_bit(left);
          left &= ~(1u << j);
          const Record& r = s.records[j];
          const float ox = offset(x, r.cx, r.cx_rest), oy = offset(y, r.cy, r.cy_rest);
          Own<Hit<float>, kWarp> hits;
          Own<bool, kWarp> keep;
          warp.lanes([&](int lane) {
            const int thread = warp.thread(lane);
            const Place p = place_of(a, tile, thread);
            hits[lane] = Hits::hit(r, dx_of(p, ox), row_terms(r, dy_of(p, oy)));
            keep[lane] = hits[lane].raw >= a.opacity_floor && pixels[thread].last > begin + j;
          });
          if (!warp.ballot(keep)) continue;
          filled |= 1u << j;
          Own<Sums<float, kSums>, kWarp> sums;
          warp.lanes([&](int lane) {
            const int thread = warp.thread(lane);
            const Place p = place_of(a, tile, thread);
            for (int k = 0; k < kSums; ++k) sums[lane].value[k] = 0;
            if (keep[lane])
              add(r, begin + j, hits[lane], dx_of(p, ox), dy_of(p, oy), pixels[thread], sums[lane].value);
          });
          warp.sums(sums);
          warp.lanes([&](int lane) {
            const int k = sum_of_lane(lane, kSums);
            if (k >= 0) s.sums[warp.index][j][k] = sums[lane].value[0];
          });
        }
        warp.lanes([&](int lane) {
          if (lane == 0) s.filled[warp.index] = filled;
        });
      });
      block.threads([&](int thread) {
        for (int k = thread; k < batch * kGradients; k += kThreads) {
          const int j = k / kGradients, number = k % kGradients;
          float sum = 0;
          if (number < kSums)
            for (int patch = 0; patch < kPatches; ++patch)
              if (s.filled[patch] >> j & 1) sum += s.sums[patch][j][number];
          entries[static_cast<int64_t>(s.entry[j]) * kGradients + number] = sum;
        }
      });
    }
  }

  R2_KERNEL Pixel load(int64_t tile, int thread) const {
    const Place place = place_of(a, tile, thread);
    Pixel p = {};
    if (!place.inside) return p;
    const int64_t k = tile * kTilePixels + thread, q = place.image;
    p.covered = out.alpha[q];
    p.T = a.state.transmittance[k], p.last = a.state.last[k], p.median_item = a.state.median[k];
    if (g.color) p.red = g.color[3 * q], p.green = g.color[3 * q + 1], p.blue = g.color[3 * q + 2];
    // expected = sum w z / covered, so w is worth (z - expected) / covered
    p.depth = g.depth && p.covered > 0 ? g.depth[q] / p.covered : 0.0f;
    p.expected = out.depth[q];
    p.alpha = g.alpha ? g.alpha[q] : 0.0f;
    p.median = g.median ? g.median[q] : 0.0f;
    p.behind = a.background[0] * p.red + a.background[1] * p.green + a.background[2] * p.blue;
    if (kNormal) p.nx = g.normal[3 * q], p.ny = g.normal[3 * q + 1], p.nz = g.normal[3 * q + 2];
    if (kDistortion) {
      p.distortion = g.distortion[q];
      p.first_z = a.state.first_z[k], p.m1 = a.state.m1[k], p.m2 = a.state.m2[k];
    }
    return p;
  }

  // One hit of one pixel, from the back; adds to sums in the order of raster.h's kSum...
  static R2_KERNEL void add(const Record& r, int j, const Hit<float>& hit, float dx, float dy, Pixel& p, float* sum) {
    const float alpha = alpha_of<float>(hit.raw, true);
    p.T = p.T / (1.0f - alpha);
    const float weight = p.T * alpha;
    // what this hit is worth, per unit of its weight
    float worth = fma(p.red, r.color[0], fma(p.green, r.color[1], fma(p.blue, r.color[2], p.alpha)));
    worth = fma(p.depth, hit.z - p.expected, worth);
    float gz = weight * p.depth;
    if (kNormal) {
      worth = fma(p.nx, r.normal[0], fma(p.ny, r.normal[1], fma(p.nz, r.normal[2], worth)));
      sum[kSumNormal] = weight * p.nx, sum[kSumNormal + 1] = weight * p.ny, sum[kSumNormal + 2] = weight * p.nz;
    }
    if (kDistortion) {
      const float mu = shifted_depth(hit.z, p.first_z);
      worth = fma(p.distortion, spread(mu, p.covered, p.m1, p.m2), worth);
      gz = fma(2.0f * kDistortionScale * p.distortion * weight, fma(mu, p.covered, -p.m1) / (hit.z * hit.z), gz);
    }
    const float galpha = p.T * (worth - p.behind);
    p.behind = fma(alpha, worth - p.behind, p.behind);
    if (p.median_item == j) gz += p.median;
    const HitGradient<float> grad = Hits::backward(hit, true, galpha, gz);
    sum[kSumU] = grad.u, sum[kSumU + 1] = grad.u * dx, sum[kSumU + 2] = grad.u * dy;
    sum[kSumV] = grad.v, sum[kSumV + 1] = grad.v * dx, sum[kSumV + 2] = grad.v * dy;
    sum[kSumDen] = grad.den, sum[kSumDen + 1] = grad.den * dx, sum[kSumDen + 2] = grad.den * dy;
    sum[kSumZ] = grad.z;
    sum[kSumFilter] = grad.filter * dx, sum[kSumFilter + 1] = grad.filter * dy;
    sum[kSumOpacity] = grad.opacity;
    sum[kSumColor] = weight * p.red, sum[kSumColor + 1] = weight * p.green, sum[kSumColor + 2] = weight * p.blue;
  }
};

// The light that passes all surfels times the colour's gradient, summed over a tile.
struct BackgroundOfTiles {
  static constexpr int kThreads = kTilePixels;
  struct Shared {
    double parts[kThreads / kWarp][3], sums[3];
  };
  BlockTiles a;
  const float* g_color;
  double* parts;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    Own<Sums<double, 3>, kThreads> mine;
    block.threads([&](int thread) {
      const Place p = place_of(a, block.index(), thread);
      const double T = p.inside ? a.state.transmittance[block.place(thread)] : 0.0f;
      for (int c = 0; c < 3; ++c) mine[thread].value[c] = p.inside ? T * g_color[3 * p.image + c] : 0.0;
    });
    block.sums(mine, s.parts, s.sums);
    block.threads([&](int thread) {
      if (thread < 3) parts[3 * block.index() + thread] = s.sums[thread];
    });
  }
};

struct BackgroundBackward : AddParts<double, 3> {
  double* to;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    add(block, s);
    block.threads([&](int thread) {
      if (thread < 3) to[thread] = s.sums[thread];
    });
  }
};

}  // namespace

BlockTiles BlockFrame::tiles(const Queue& queue) {
  const int64_t pixels = input.tiles() * kTilePixels;
  for (DeviceBuffer<float>* buffer : {&transmittance_, &first_z_, &m1_, &m2_}) buffer->grow(queue, pixels);
  for (DeviceBuffer<int32_t>* buffer : {&last_, &median_}) buffer->grow(queue, pixels);
  reach_.grow(queue, static_cast<int64_t>(facts.entries));
  return {records_.data(), items_.data(), tile_begin_.data(), reach_.data(), view_.data()->background,
          input.opacity_floor, input.width, input.height, input.tiles_x(),
          {transmittance_.data(), last_.data(), median_.data(), first_z_.data(), m1_.data(), m2_.data()}};
}

void BlockFrame::blend(const Queue& queue, const Images& out) {
  const BlockTiles a = tiles(queue);
  with_kind([&](auto kind) {
    using Hits = typename decltype(kind)::Hits;
    if (out.distortion) launch(queue, input.tiles(), BlendTiles<Hits, true, true>{a, out});
    else if (out.normal) launch(queue, input.tiles(), BlendTiles<Hits, true, false>{a, out});
    else launch(queue, input.tiles(), BlendTiles<Hits, false, false>{a, out});
  });
}

void BlockFrame::blend_backward(const Queue& queue, const Images& out, const ImageGradients& g) {
  const BlockTiles a = tiles(queue);
  float* entries = entry_sums_.grow(queue, static_cast<int64_t>(facts.entries) * kGradients);
  with_kind([&](auto kind) {
    using Hits = typename decltype(kind)::Hits;
    if (g.normal && g.distortion) launch(queue, input.tiles(), BlendTilesBackward<Hits, true, true>{a, out, g, entries});
    else if (g.normal) launch(queue, input.tiles(), BlendTilesBackward<Hits, true, false>{a, out, g, entries});
    else if (g.distortion) launch(queue, input.tiles(), BlendTilesBackward<Hits, false, true>{a, out, g, entries});
    else launch(queue, input.tiles(), BlendTilesBackward<Hits, false, false>{a, out, g, entries});
  });
}

void BlockFrame::background_backward(const Queue& queue, const float* g_color, double* to) {
  double* parts = background_parts_.grow(queue, 3 * input.tiles());
  launch(queue, input.tiles(), BackgroundOfTiles{tiles(queue), g_color, parts});
  BackgroundBackward total;
  total.from = parts, total.count = input.tiles(), total.to = to;
  launch(queue, 1, total);
}

// The focal lengths can be divided by, and there is no NaN. Whether the pose is rigid is Python's to ask (checks.py).
static bool camera_holds(const ViewFacts& f) {
  for (double x : f.cam_from_world)
    if (!std::isfinite(x)) return false;
  for (double x : f.K)
    if (!std::isfinite(x)) return false;
  return f.K[0] > 0 && f.K[4] > 0;
}

bool BlockFrame::forward(const Queue& queue, const ViewInput& in, const SurfelArrays& surfels, const float* center_px,
                         const Images& out) {
  const Turn::Mine mine(turn_, queue);
  input = in, count = surfels.count;
  project(queue, surfels, center_px);
  facts_copy_.begin(queue, facts_.data());
  sort_by_depth(queue);  // while the host waits for the counts
  facts = facts_copy_.wait();
  if (!camera_holds(facts)) return false;
  if (facts.entries > UINT32_MAX)
    throw std::length_error("the surfels reach more than 2^32 tiles in this view: too many, too large for the image");
  list_tiles(queue, surfels);
  blend(queue, out);
  return true;
}

int64_t BlockFrame::bytes() const {
  int64_t sum = scratch_.bytes() + view_.bytes() + facts_.bytes() + records_.bytes() + rows_.bytes() + counts_.bytes() + reach_.bytes() +
                unsorted_items_.bytes() + items_.bytes() + camera_parts_.bytes() + background_parts_.bytes();
  for (const DeviceBuffer<uint32_t>* b : {&tiles_, &first_entry_, &depth_, &sorted_depth_, &number_, &order_,
                                          &ordered_tiles_, &place_, &tile_, &sorted_tile_, &tile_begin_})
    sum += b->bytes();
  for (const DeviceBuffer<float>* b : {&transmittance_, &first_z_, &m1_, &m2_, &entry_sums_}) sum += b->bytes();
  return sum + last_.bytes() + median_.bytes();
}

void BlockFrame::backward(const Queue& queue, const SurfelArrays& surfels, const Images& out, const ImageGradients& g,
                          const room2dgs::SurfelGradients& to, double* to_pose, double* to_K, double* to_background) {
  const Turn::Mine mine(turn_, queue);
  blend_backward(queue, out, g);
  project_backward(queue, surfels, to, to_pose, to_K);
  if (to_background) background_backward(queue, g.color, to_background);
}

}  // namespace R2_ISA
