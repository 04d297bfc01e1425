// The surfels of each tile, front to back: seen surfels by depth, their tiles written down in that order, and a stable
// sort by tile. That moves a third of the bytes of one sort by tile and depth.
#include <stdexcept>

#include "block_frame.h"

namespace R2_ISA {
namespace {

// to[k] = from[order[k]]
struct Gather {
  static constexpr int kThreads = 256;
  struct Shared {};
  const uint32_t *from, *order;
  uint32_t* to;
  int64_t count;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    block.threads([&](int thread) {
      const int64_t k = block.place(thread);
      if (k < count) to[k] = from[order[k]];
    });
  }
};

// What the lists are written from and to: the k-th seen surfel by depth writes its tiles from place[k] on.
struct Lists {
  const uint32_t *order, *tiles, *first_entry, *place;
  const KeptRows* rows;
  int64_t visible;
  int tiles_x;
  uint32_t* tile;
  uint64_t* items;
};

// One surfel's entries, a row after the other.
struct Writer {
  const Lists& to;
  uint32_t surfel, entry, first, count, n;
  R2_KERNEL Writer(const Lists& lists, int64_t k)
      : to(lists), surfel(lists.order[k]), entry(lists.first_entry[surfel]), first(lists.place[k]),
        count(lists.tiles[surfel]), n(0) {}
  R2_KERNEL void row(int ty, int begin, int end) {
    for (int tx = begin; tx < end && n < count; ++tx, ++n) {  // no more than were counted, whatever happens
      to.tile[first + n] = static_cast<uint32_t>(ty * to.tiles_x + tx);
      to.items[first + n] = item_of(surfel, entry + n);
    }
  }
};

struct ListTiles {
  static constexpr int kThreads = 128;
  struct Shared {};
  Lists lists;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    block.threads([&](int thread) {
      const int64_t k = block.place(thread);
      if (k >= lists.visible) return;
      Writer writer(lists, k);
      const KeptRows& kept = lists.rows[writer.surfel];
      if (kept.count > kKeptRows) return;
      for (int row = 0; row < kept.count; ++row) writer.row(kept.first + row, kept.spans[row].x0, kept.spans[row].x1);
    });
  }
};

// The rest: a kernel of its own, since so much arithmetic takes many registers.
template <class Kind>
struct ListTallTiles {
  static constexpr int kThreads = 128;
  struct Shared {};
  Lists lists;
  const BlockView* view;
  SurfelArrays surfels;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    block.threads([&](int thread) {
      const int64_t k = block.place(thread);
      if (k >= lists.visible || lists.rows[lists.order[k]].count <= kKeptRows) return;
      Writer writer(lists, k);
      const auto surfel =
          stand<double>(Kind::load(surfels, writer.surfel), surfels.opacities[writer.surfel], view->camera);
      if (!surfel.seen) return;
      const Reach<double> reach = reach_of(surfel, view->camera);
      const Box<double> box = box_of(reach, view->camera);
      if (!box.some) return;
      for_tile_rows(surfel.disc, reach, view->camera, range_of(box),
                    [&](int ty, int begin, int end) { writer.row(ty, begin, end); });
    });
  }
};

// Where each tile's list begins in what is sorted by tile.
struct FindTiles {
  static constexpr int kThreads = 128;
  struct Shared {};
  const uint32_t* tile;
  uint32_t count;
  uint32_t* begin;
  int64_t tiles;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    block.threads([&](int thread) {
      const int64_t t = block.place(thread);
      if (t > tiles) return;
      uint32_t low = 0, high = count;
      while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (tile[middle] < t) low = middle + 1;
        else high = middle;
      }
      begin[t] = low;
    });
  }
};

}  // namespace

void BlockFrame::sort_by_depth(const Queue& queue) {
  for (DeviceBuffer<uint32_t>* buffer : {&sorted_depth_, &order_, &ordered_tiles_, &place_}) buffer->grow(queue, count);
  exclusive_sum(queue, scratch_, tiles_.data(), first_entry_.data(), count);
  sort_pairs(queue, scratch_, depth_.data(), sorted_depth_.data(), number_.data(), order_.data(), count, 32);
  launch(queue, blocks_for(count, Gather::kThreads), Gather{tiles_.data(), order_.data(), ordered_tiles_.data(), count});
  exclusive_sum(queue, scratch_, ordered_tiles_.data(), place_.data(), count);
}

void BlockFrame::list_tiles(const Queue& queue, const SurfelArrays& surfels) {
  const int64_t entries = static_cast<int64_t>(facts.entries), visible = static_cast<int64_t>(facts.visible);
  const int64_t tiles = input.tiles();
  for (DeviceBuffer<uint32_t>* buffer : {&tile_, &sorted_tile_}) buffer->grow(queue, entries);
  for (DeviceBuffer<uint64_t>* buffer : {&unsorted_items_, &items_}) buffer->grow(queue, entries);
  tile_begin_.grow(queue, tiles + 1);
  const Lists lists{order_.data(), tiles_.data(), first_entry_.data(), place_.data(), rows_.data(), visible,
                    input.tiles_x(), tile_.data(), unsorted_items_.data()};
  launch(queue, blocks_for(visible, ListTiles::kThreads), ListTiles{lists});
  with_kind([&](auto kind) {
    using Tall = ListTallTiles<decltype(kind)>;
    launch(queue, blocks_for(visible, Tall::kThreads), Tall{lists, view_.data(), surfels});
  });
  int bits = 1;
  while ((tiles - 1) >> bits) ++bits;
  sort_pairs(queue, scratch_, tile_.data(), sorted_tile_.data(), unsorted_items_.data(), items_.data(), entries, bits);
  launch(queue, blocks_for(tiles + 1, FindTiles::kThreads),
         FindTiles{sorted_tile_.data(), static_cast<uint32_t>(entries), tile_begin_.data(), tiles});
}

}  // namespace R2_ISA
