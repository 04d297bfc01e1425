#include "tile_pixels.h"  // first: gaussian_pixel.h's templates see what stands before them

#include "blend_backward.h"
#include "gaussian_pixel.h"

namespace R2_ISA {

void set_gaussian_blend_backward(room2dgs::Kernels& k) { k.blend_backward = &blend_backward<GaussianHits>; }

}  // namespace R2_ISA
