// Binds dense stereo by block code, under the names that the CPU's has in the module above.
#include "../../stereo/csrc/block_patchmatch.h"
#include "../stereo_match.h"
#include "bind_device.h"

namespace R2_ISA {

void bind_block_stereo(nb::module_& m) { bind_matching<BlockMatch>(m); }

}  // namespace R2_ISA
