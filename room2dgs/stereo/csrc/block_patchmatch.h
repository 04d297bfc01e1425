// PatchMatch stereo as block code (patchmatch_maths.h): a job's arrays are moved to the device, and back what it found.
#pragma once

#include "launch.h"
#include "patchmatch.h"

namespace R2_ISA {

class BlockMatch {
 public:
  // `job` and all that it points to lie on the CPU; the planes there change in `give_back` alone.
  BlockMatch(const room2dgs::StereoJob& job, uint64_t queue);
  void start();
  void sweep(const room2dgs::StereoSweep& sweep);
  void costs(float* cost, float* variance);  // of the CPU
  void give_back();

 private:
  const room2dgs::StereoJob& job_;
  Queue queue_;
  OnDevice current_;
  int64_t plane_;  // floats of a map by colour
  room2dgs::StereoJob there_;  // the same, by the device's addresses
  DeviceBuffer<uint8_t> grey_;
  DeviceBuffer<uint32_t> quads_;
  DeviceBuffer<int32_t> judges_;
  DeviceBuffer<float> planes_, table_, depths_, maps_;
  DeviceBuffer<room2dgs::StereoJob> argument_;
};

}  // namespace R2_ISA
