#include "tile_pixels.h"  // first: gaussian_pixel.h's templates see what stands before them

#include "blend_forward.h"
#include "gaussian_pixel.h"

namespace R2_ISA {

void set_gaussian_blend(room2dgs::Kernels& k) {
  k.blend = &blend<GaussianHits>, k.count_pairs = &count_pairs<GaussianHits>;
}

}  // namespace R2_ISA
