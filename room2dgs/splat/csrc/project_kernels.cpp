// The surfels' copy of the loops of project_loops.h.
#include "project_loops.h"

namespace R2_ISA {
namespace {

struct SurfelKind {
  using Splat = Surfel<Doubles>;
  static constexpr int kScales = 2;
  static R2_INLINE float largest(const float* scales) { return scales[0] > scales[1] ? scales[0] : scales[1]; }
  static R2_INLINE Frustum frustum(const View& view) { return frustum_of(view); }
  template <class Scale>
  static R2_INLINE Splat of(Vec3<Doubles> center, Doubles w, Doubles x, Doubles y, Doubles z, Scale&& scale) {
    return {center, w, x, y, z, scale(0), scale(1)};
  }
};

}  // namespace

void set_blend(room2dgs::Kernels& k);
void set_blend_backward(room2dgs::Kernels& k);

room2dgs::Kernels raster_kernels() {
  room2dgs::Kernels k{};
  set_blend(k), set_blend_backward(k);
  k.project = &project<SurfelKind>;
  k.project_backward = &project_backward<SurfelKind>;
  return k;
}

}  // namespace R2_ISA
