// One rendered view: everything that the backward pass needs, in buffers that are used again for the next view.
#pragma once

#if defined(__linux__)
#include <sys/mman.h>
#endif

#include <atomic>
#include <cstdlib>
#include <new>
#include <utility>
#include <vector>

#include "raster.h"

namespace room2dgs {

const Kernels& kernels();
const Kernels& gaussian_kernels();

// Uninitialised memory that only grows; trivially copyable elements.
template <class T>
class Buffer {
 public:
  Buffer() = default;
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Buffer() { std::free(data_); }
  void grow(int64_t count) {
    if (count <= capacity_) return;
    std::free(data_);
    capacity_ = count + count / 4 + 64;
    // in whole huge pages: scattered records would miss in the address cache, and small pages fault one by one
    constexpr size_t kPage = size_t{2} << 20;
    const size_t bytes = (sizeof(T) * static_cast<size_t>(capacity_) + kPage - 1) / kPage * kPage;
    data_ = static_cast<T*>(bytes < 2 * kPage ? std::malloc(bytes) : std::aligned_alloc(kPage, bytes));
#if defined(MADV_HUGEPAGE)
    if (data_ && bytes >= 2 * kPage) madvise(data_, bytes, MADV_HUGEPAGE);
#endif
    if (!data_) {
      capacity_ = 0;
      throw std::bad_alloc();
    }
  }
  T* data() { return data_; }
  T& operator[](int64_t i) { return data_[i]; }

 private:
  void swap(Buffer& other) {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
  }
  T* data_ = nullptr;
  int64_t capacity_ = 0;
};

// Limits of the index types: entries and records are uint32, positions in a tile's list share an int with 5 bits.
constexpr int kMaxSide = 16384;  // pixels
constexpr int64_t kMaxSurfels = (int64_t{1} << 26) - 1;

struct RasterFrame {
  static constexpr int64_t kScales = 2;  // of each that it draws
  const Kernels* table = &kernels();  // of what it draws
  // What a view left here; 0: nothing, or a forward pass that failed. Every forward pass has a number of its own.
  uint64_t view = 0, views = 0;
  bool has_normal = false, has_distortion = false;
  std::atomic<bool> busy{false};

  Camera camera{};
  float background[3] = {0, 0, 0};
  int64_t count = 0, visible = 0;
  uint32_t entries = 0;  // (surfel, tile) pairs

  Buffer<Record> records;
  Buffer<Extent> extents;
  std::vector<std::vector<Span>> spans;  // a list a block of surfels
  Buffer<uint32_t> first_entry, tile_begin, block_counts;
  struct Keyed {
    uint32_t key, index;
  };
  Buffer<Keyed> order, order_scratch;
  // Visible surfels in depth order, as the tile lists need them: read in a row, where `extents` lie scattered.
  struct Placed {
    const Span* spans;
    uint32_t record, entry;
    uint16_t row, rows;
  };
  Buffer<Placed> placed;
  Buffer<Item> items;
  Buffer<float> transmittance, first_z, m1, m2, entry_sums;
  Buffer<int32_t> last, median;

  int64_t tile_count() const { return static_cast<int64_t>(camera.tiles_x()) * camera.tiles_y(); }

  // The stages of `forward`, in order.
  // Raises std::length_error where the (surfel, tile) pairs outnumber their index.
  void project(const Camera& view, const SurfelArrays& surfels);
  void sort_by_depth();
  void list_tiles();
  BlendArgs blend_args();

  void forward(const Camera& view, const SurfelArrays& surfels, const Images& out);
  void backward(const SurfelArrays& surfels, const Images& out, const ImageGradients& gradients,
                const SurfelGradients& to, CameraGradient<double>& to_camera);
  // The background's gradient: the light that passes all surfels times the colour's, summed over pixels.
  void background_backward(const float* g_color, double* to);
  int64_t count_pairs(const Images& out);
};

// The same of 3D Gaussians.
struct GaussianFrame : RasterFrame {
  static constexpr int64_t kScales = 3;
  GaussianFrame() { table = &gaussian_kernels(); }
};

}  // namespace room2dgs
