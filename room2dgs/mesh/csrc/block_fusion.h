// Fusion of depth maps as block code (block.h).
#pragma once

#include "fusion.h"
#include "launch.h"

namespace R2_ISA {

void touch_blocks(const Queue& queue, const room2dgs::TouchJob& job);

// Takes a depth map into `blocks` blocks, whose rows all differ; a row outside of 0..rows is passed over.
void fuse_blocks(const Queue& queue, const room2dgs::FusionJob& job, int64_t blocks, int64_t rows);

}  // namespace R2_ISA
