// Adam (Kingma and Ba) without weight decay: m and v decay to the gradient and its square, p moves by
// rate m' / (sqrt(v') + epsilon), where m' = m / (1 - beta1^t) and v' = v / (1 - beta2^t).
#include "block_adam.h"

#include <cmath>

namespace R2_ISA {
namespace {

struct AdamRows {
  static constexpr int kThreads = 256;
  struct Shared {};
  float *parameters, *first, *second;
  const float* gradients;
  const uint8_t* seen;
  int64_t count, width;
  float toward1, toward2;  // 1 - beta
  float step_size, inverse_root, epsilon;  // rate / (1 - beta1^t), 1 / sqrt(1 - beta2^t)

  R2_KERNEL void operator()(const Block<kThreads>& block, Shared&) const {
    block.threads([&](int thread) {
      const int64_t i = block.place(thread);
      if (i >= count || (seen && !seen[i / width])) return;
      const float g = gradients[i];
      const float m = fma(toward1, g - first[i], first[i]);
      const float v = fma(toward2, fma(g, g, -second[i]), second[i]);
      first[i] = m, second[i] = v;
      parameters[i] = parameters[i] - step_size * m / fma(vsqrt(v), inverse_root, epsilon);
    });
  }
};

}  // namespace

void adam_rows(const Queue& queue, const AdamStep& s) {
  const double t = static_cast<double>(s.step);
  const int64_t count = s.rows * s.width;
  launch(queue, blocks_for(count, AdamRows::kThreads),
         AdamRows{s.parameters, s.first, s.second, s.gradients, s.seen, count, s.width,
                  static_cast<float>(1 - s.beta1), static_cast<float>(1 - s.beta2),
                  static_cast<float>(s.rate / (1 - std::pow(s.beta1, t))),
                  static_cast<float>(1 / std::sqrt(1 - std::pow(s.beta2, t))), static_cast<float>(s.epsilon)});
}

}  // namespace R2_ISA
