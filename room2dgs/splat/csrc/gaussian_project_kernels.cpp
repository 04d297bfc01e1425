// The 3D Gaussians' copy of the loops of project_loops.h.
#include "doubles.h"  // first: the templates of gaussian_stages.h see what stands before them

#include "gaussian_stages.h"
#include "project_loops.h"

namespace R2_ISA {
namespace {

struct GaussiansAtOnce : GaussianKind {
  using Splat = Gaussian<Doubles>;
  template <class Scale>
  static R2_INLINE Splat of(Vec3<Doubles> center, Doubles w, Doubles x, Doubles y, Doubles z, Scale&& scale) {
    return {center, w, x, y, z, {scale(0), scale(1), scale(2)}};
  }
};

}  // namespace

void set_gaussian_blend(room2dgs::Kernels& k);
void set_gaussian_blend_backward(room2dgs::Kernels& k);

room2dgs::Kernels gaussian_kernels() {
  room2dgs::Kernels k{};
  set_gaussian_blend(k), set_gaussian_blend_backward(k);
  k.project = &project<GaussiansAtOnce>;
  k.project_backward = &project_backward<GaussiansAtOnce>;
  return k;
}

}  // namespace R2_ISA
