// The surfels' copy of the loops of project_loops.h.
#include "project_loops.h"

namespace R2_ISA {
namespace {

struct SurfelsAtOnce : SurfelKind {
  using Splat = Surfel<Doubles>;
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
  k.project = &project<SurfelsAtOnce>;
  k.project_backward = &project_backward<SurfelsAtOnce>;
  return k;
}

}  // namespace R2_ISA
