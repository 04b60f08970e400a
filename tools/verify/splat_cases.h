// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/splat/rasterizer.h"
#include "kernels/splat.h"

// the golden cases of the kinds splat_render and pca_normals as functions from host arrays to host arrays
namespace semrover {

struct SplatRenderCase {
    // input.*
    std::vector<float> positions;  // [N, 3]
    std::vector<float> normals;    // [N, 3]
    std::vector<float> colors;     // [N, 3]
    std::vector<float> opacities;  // [N]
    std::vector<float> scales;     // [N, 2]
    std::vector<float> view;       // [4, 4] world to camera
    std::vector<float> intrinsics; // [3, 3]
    // params
    uint32_t width = 0, height = 0;
    float near = 0.2f, alpha_min = 1.f / 255, alpha_max = 0.99f, transmittance_min = 1e-4f,
          screen_filter_variance = 0.5f;
    float cutoff_sigma = 0; // 0: none
};

// expect.color, .alpha, .depth, .normal are the image's color, alpha, depth_sum and normal
Result<SplatImage> run_splat_render(Device& device, const SplatRenderCase& c);

struct PcaNormalsResult {
    std::vector<float> normals;     // [N, 3], up to their sign
    std::vector<float> eigenvalues; // [N, 3], ascending
};

Result<PcaNormalsResult> run_pca_normals(Device& device, std::span<const float> positions, // [N, 3]
                                         uint32_t neighbors);

} // namespace semrover
