// The depth prior's loss (losses/depth_prior.py), a pixel at a time: which pixels are compared, what the prior is
// aligned by, and differences of neighbours at strides 1, 2, 4, 8.
#pragma once

#include "scalar.h"

namespace R2_ISA {

constexpr int kDepthLevels = 4;
// As losses/depth_prior.py has them.
constexpr float kDepthMinAlpha = 0.5f, kDepthRounding = 1e-6f;
constexpr double kDepthMinPixels = 64, kDepthMinSpread = 1e-4, kDepthMinCorrelation = 0.1;

struct DepthMaps {
  const float *depth, *alpha, *prior, *confidence;  // confidence: null for 1
  const uint8_t* valid;
  int64_t height, width;
  bool disparity;  // what the prior is; of the rendering its inverse is compared then
};

struct DepthPixel {
  bool compared;
  float rendered, prior, weight;
};

R2_HD DepthPixel depth_pixel(const DepthMaps& maps, int64_t i) {
  const float depth = maps.depth[i], prior = maps.prior[i];
  if (!maps.valid[i] || !(prior > 0.0f && prior <= 3.402823466e38f) || !(maps.alpha[i] >= kDepthMinAlpha) || !(depth > 0.0f))
    return {false, 1.0f, 0.0f, 0.0f};
  return {true, maps.disparity ? 1.0f / depth : depth, prior, maps.confidence ? maps.confidence[i] : 1.0f};
}

// Of all compared pixels: number, w, w p, w x, w p p, w p x, w x x; then pairs along rows and along columns, by level.
constexpr int kDepthSums = 7 + 2 * kDepthLevels;

struct DepthAlignment {
  float scale, shift, inverse_unit;
  float mean;  // 1 / number of pixels; 0 where too few are compared: no loss, no gradient
};

struct DepthFit {
  DepthAlignment alignment;
  float shares[kDepthLevels][2];   // of a pair of neighbours, along rows and along columns
};

R2_HD DepthFit depth_fit(const double* sums, bool align, double gradient_weight, int levels) {
  DepthFit fit = {};
  const double count = sums[0], weight = sums[1];
  if (!(count >= kDepthMinPixels) || !(weight > 0)) return fit;
  const double prior = sums[2] / weight, rendered = sums[3] / weight;
  double scale = 1, shift = 0;
  if (align) {
    const double priors = sums[4] / weight - prior * prior, covariance = sums[5] / weight - prior * rendered;
    const double renderings = sums[6] / weight - rendered * rendered;
    const double spread = vsqrt(priors > 0 ? priors : 0.0), other = vsqrt(renderings > 0 ? renderings : 0.0);
    const bool told = spread > kDepthMinSpread * prior && other > kDepthMinSpread * rendered &&
                      covariance > kDepthMinCorrelation * spread * other;
    scale = told ? covariance / priors : rendered / prior;
    shift = told ? rendered - scale * prior : 0.0;
  }
  fit.alignment = {static_cast<float>(scale), static_cast<float>(shift),
                   static_cast<float>(1 / (scale * prior + shift)), static_cast<float>(1 / count)};
  for (int level = 0; level < levels; ++level)
    for (int along = 0; along < 2; ++along) {
      const double pairs = sums[7 + 2 * level + along];
      fit.shares[level][along] = static_cast<float>(gradient_weight / (pairs > 1 ? pairs : 1.0));
    }
  return fit;
}

R2_HD float depth_residual(const DepthPixel& p, const DepthAlignment& fit) {
  return (p.rendered - fma(fit.scale, p.prior, fit.shift)) * fit.inverse_unit;
}

// The trusted difference of a pair; 0 where one of the two is not compared.
struct DepthPair {
  float difference, trust;
};

R2_HD DepthPair depth_pair(const DepthPixel& before, const DepthPixel& after, const DepthAlignment& fit) {
  const float trust = before.compared && after.compared ? vmin(before.weight, after.weight) : 0.0f;
  const float d = depth_residual(after, fit) - depth_residual(before, fit);
  const bool counts = trust > 0.0f && (d > kDepthRounding || d < -kDepthRounding);
  return {counts ? d * trust : 0.0f, trust};
}

}  // namespace R2_ISA
