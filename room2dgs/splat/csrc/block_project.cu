// Surfels to records and counts of tiles; and back from their pixel sums to their parameters and the camera.
#include "block_frame.h"

namespace R2_ISA {
namespace {

// The camera, from the arrays that Python has of it.
template <class Kind>
struct ReadView {
  static constexpr int kThreads = kWarp;
  struct Shared {};
  ViewInput in;
  BlockView* view;
  ViewFacts* facts;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    block.threads([&](int thread) {
      if (thread != 0) return;
      BlockView v;
      const double *m = in.cam_from_world, *k = in.K;
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) v.camera.R[3 * row + column] = m[4 * row + column];
        v.camera.t[row] = m[4 * row + 3];
      }
      v.camera.fx = k[0], v.camera.fy = k[4], v.camera.cx = k[2], v.camera.cy = k[5];
      v.camera.near = in.near, v.camera.opacity_floor = in.opacity_floor;
      v.camera.width = in.width, v.camera.height = in.height;
      v.camera.filter_px2 = in.filter_px2, v.camera.compensated = in.compensated;
      v.frustum = Kind::frustum(v.camera);
      for (int i = 0; i < 3; ++i) v.background[i] = in.background[i];
      *view = v;
      for (int i = 0; i < 16; ++i) facts->cam_from_world[i] = m[i];
      for (int i = 0; i < 9; ++i) facts->K[i] = k[i];
      for (int i = 0; i < 3; ++i) facts->background[i] = in.background[i];
      facts->unused = 0;
    });
  }
};

constexpr int kCounts = 3;  // surfels that are seen, their tiles, centres that are moved

template <class Kind>
struct ProjectSurfels {
  static constexpr int kThreads = 128;
  struct Shared {
    uint64_t parts[kThreads / kWarp][kCounts], sums[kCounts];
  };
  const BlockView* view;
  SurfelArrays surfels;
  const float* center_px;  // null, or what must be 0
  Record* records;
  uint32_t *tiles, *depth, *number;
  KeptRows* rows;
  uint64_t* counts;  // of a block

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    Own<Sums<uint64_t, kCounts>, kThreads> seen;
    block.threads([&](int thread) {
      const int64_t i = block.place(thread);
      uint32_t reached = 0, key = ~uint32_t{0};  // hidden surfels come last by depth
      if (i < surfels.count) {
        Record record;
        KeptRows kept;
        reached = draw(i, record, kept);
        if (reached) {
          memcpy(&key, &record.z, 4);  // positive floats sort as their bits do
          store_pieces(records + i, record);
          store_pieces(rows + i, kept);
        }
        tiles[i] = reached, depth[i] = key, number[i] = static_cast<uint32_t>(i);
      }
      const bool moved = center_px && i < surfels.count && !(center_px[2 * i] == 0 && center_px[2 * i + 1] == 0);
      seen[thread].value[0] = reached != 0, seen[thread].value[1] = reached, seen[thread].value[2] = moved;
    });
    block.sums(seen, s.parts, s.sums);
    block.threads([&](int thread) {
      if (thread < kCounts) counts[block.index() * kCounts + thread] = s.sums[thread];
    });
  }

  // How many tiles the surfel reaches; fills the record and the rows where there are any.
  R2_KERNEL uint32_t draw(int64_t i, Record& record, KeptRows& kept) const {
    const View& camera = view->camera;
    const float *c = surfels.centers + 3 * i, *e = surfels.scales + Kind::kScales * i;
    if (!maybe_seen<float>(view->frustum, c[0], c[1], c[2], Kind::largest(e), surfels.opacities[i])) return 0;
    const auto surfel = stand<double>(Kind::load(surfels, i), surfels.opacities[i], camera);
    if (!surfel.seen) return 0;
    const Reach<double> reach = reach_of(surfel, camera);
    const Box<double> box = box_of(reach, camera);
    if (!box.some) return 0;
    const PixelRange pixels = range_of(box);
    uint32_t reached = 0;
    const int first = pixels.y0 / kTile;
    kept.first = static_cast<uint16_t>(first), kept.count = static_cast<uint16_t>(pixels.y1 / kTile - first + 1);
    for_tile_rows(surfel.disc, reach, camera, pixels, [&](int ty, int begin, int end) {
      reached += static_cast<uint32_t>(end - begin);
      const room2dgs::Span span = {static_cast<uint16_t>(begin), static_cast<uint16_t>(end)};
      // written out: an index that is not known before would put the spans into slow memory
      for (int k = 0; k < kKeptRows; ++k)
        if (ty - first == k) kept.spans[k] = span;
    });
    if (!reached) return 0;
    static_cast<RecordNumbers<float>&>(record) = numbers_of(surfel, reach, camera, sh_of(surfels, i), surfels.sh_count);
    put_box(pixels, record);
    return reached;
  }
};

struct CountView : AddParts<uint64_t, kCounts> {
  ViewFacts* facts;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    add(block, s);
    block.threads([&](int thread) {
      if (thread == 0) facts->visible = s.sums[0], facts->entries = s.sums[1], facts->moved = s.sums[2];
    });
  }
};

// The camera's gradient as numbers of one array: R, t, fx, fy, cx, cy.
constexpr int kCameraNumbers = 16;

template <class Kind>
struct SurfelsBackward {
  static constexpr int kThreads = 128;
  struct Shared {
    double parts[kThreads / kWarp][kCameraNumbers], sums[kCameraNumbers];
  };
  const BlockView* view;
  SurfelArrays surfels;
  const uint32_t *tiles, *first_entry;
  const float* entries;
  room2dgs::SurfelGradients to;
  double* camera;  // a block's part

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    Own<Sums<double, kCameraNumbers>, kThreads> mine;
    block.threads([&](int thread) {
      const int64_t i = block.place(thread);
      room2dgs::CameraGradient<double> g = {};
      if (i < surfels.count) {
        const uint32_t count = tiles[i];
        if (count) {
          double sum[kGradients];
          sum_entries(entries + static_cast<int64_t>(first_entry[i]) * kGradients, count, sum);
          const auto put = [&](float* array, int numbers, int k, double gradient) {
            array[numbers * i + k] = static_cast<float>(gradient);
          };
          splat_backward<double>(view->camera, Kind::load(surfels, i), surfels.opacities[i], sum, sh_of(surfels, i),
                                 surfels.sh_count, to, put, g);
        } else {
          zero_gradients(to, i, Kind::kScales, 3 * surfels.sh_count);
        }
      }
      double* all = mine[thread].value;
      for (int k = 0; k < 9; ++k) all[k] = g.R[k];
      for (int k = 0; k < 3; ++k) all[9 + k] = g.t[k];
      all[12] = g.fx, all[13] = g.fy, all[14] = g.cx, all[15] = g.cy;
    });
    block.sums(mine, s.parts, s.sums);
    block.threads([&](int thread) {
      if (thread < kCameraNumbers) camera[block.index() * kCameraNumbers + thread] = s.sums[thread];
    });
  }
};

struct CameraBackward : AddParts<double, kCameraNumbers> {
  double *to_pose, *to_K;
  R2_KERNEL void operator()(const Block<kThreads>& block, Shared& s) const {
    add(block, s);
    block.threads([&](int thread) {
      if (thread < 16) {
        const int row = thread / 4, column = thread % 4;
        to_pose[thread] = row == 3 ? 0 : (column == 3 ? s.sums[9 + row] : s.sums[3 * row + column]);
      }
      if (thread < 9) {
        const double* f = s.sums + 12;
        to_K[thread] = thread == 0 ? f[0] : thread == 4 ? f[1] : thread == 2 ? f[2] : thread == 5 ? f[3] : 0;
      }
    });
  }
};

}  // namespace

void BlockFrame::project(const Queue& queue, const SurfelArrays& surfels, const float* center_px) {
  const int64_t blocks = blocks_for(count, ProjectSurfels<SurfelKind>::kThreads);
  view_.grow(queue, 1), facts_.grow(queue, 1);
  counts_.grow(queue, blocks * kCounts);
  records_.grow(queue, count), rows_.grow(queue, count);
  for (DeviceBuffer<uint32_t>* buffer : {&tiles_, &first_entry_, &depth_, &number_}) buffer->grow(queue, count);
  with_kind([&](auto kind) {
    using Kind = decltype(kind);
    launch(queue, 1, ReadView<Kind>{input, view_.data(), facts_.data()});
    launch(queue, blocks, ProjectSurfels<Kind>{view_.data(), surfels, center_px, records_.data(), tiles_.data(),
                                               depth_.data(), number_.data(), rows_.data(), counts_.data()});
  });
  CountView total;
  total.from = counts_.data(), total.count = blocks, total.facts = facts_.data();
  launch(queue, 1, total);
}

void BlockFrame::project_backward(const Queue& queue, const SurfelArrays& surfels, const room2dgs::SurfelGradients& to,
                                  double* to_pose, double* to_K) {
  const int64_t blocks = blocks_for(count, SurfelsBackward<SurfelKind>::kThreads);
  camera_parts_.grow(queue, blocks * kCameraNumbers);
  with_kind([&](auto kind) {
    launch(queue, blocks, SurfelsBackward<decltype(kind)>{view_.data(), surfels, tiles_.data(), first_entry_.data(),
                                                          entry_sums_.data(), to, camera_parts_.data()});
  });
  CameraBackward total;
  total.from = camera_parts_.data(), total.count = blocks, total.to_pose = to_pose, total.to_K = to_K;
  launch(queue, 1, total);
}

}  // namespace R2_ISA
