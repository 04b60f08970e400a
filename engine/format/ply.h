// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/palette.h"
#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <vector>

namespace semrover {

// N flat Gaussian splats; every array has N entries, but writing points needs only position, color and label
struct Splats {
    std::vector<std::array<float, 3>> position = {}; // metres
    std::vector<std::array<float, 3>> normal = {};   // unit
    std::vector<std::array<float, 3>> color = {};    // sRGB, 0..1
    std::vector<float> sigma_u = {}, sigma_v = {};   // metres, standard deviations along the tangents
    std::vector<float> opacity = {};                 // 0..1
    std::vector<uint8_t> label = {};
};

// the tangents of a splat: u = normalize(e x n), e the axis that n leans on least (x before y before z); v = n x u, so
// (u, v, n) is right-handed
struct Tangents {
    std::array<float, 3> u, v;
};
Tangents tangents_of(const std::array<float, 3>& normal);

// rotation that takes x, y, z to u, v, n; w, x, y, z with w >= 0
std::array<float, 4> splat_rotation(const std::array<float, 3>& normal);

// binary little-endian PLY, written atomically, the same bytes for the same splats. bad_input for no splats, or a
// number that is not finite (or a sigma not above 0), naming the splat. Arrays of different lengths are the caller's
// bug.

// x y z (float), red green blue label (uchar): CloudCompare, MeshLab, Open3D
Status write_points_ply(const Path& path, const Splats& splats);

// bad_input as above: what every writer of splats refuses
Status check_splats(const Path& path, const Splats& splats);

// what splat viewers read: x y z nx ny nz f_dc_0..2 opacity scale_* rot_0..3, all float, colour as the degree 0
// harmonic (rgb - 0.5) / 0.28209479, opacity as a logit, scales as logarithms, the quaternion w first. 3DGS readers
// know three scales, so a thin third one, ln(1e-4), follows scale_1; 2DGS files stop at scale_1 and say
// `SplatRenderMode: 2dgs`; inria_62 is 3DGS with f_rest_0..44, all 0, after f_dc_2, for readers that expect the 62
// floats of the first program's files. Source: graphdeco-inria/gaussian-splatting and hbb1/2d-gaussian-splatting,
// save_ply
enum class SplatPly { gaussian_3d, gaussian_2d, inria_62 };
constexpr float kHarmonic0 = 0.28209479177387814f; // sqrt(1 / (4 pi))
constexpr float kThinScale = 1e-4f;                // metres: what a splat's third scale is in formats that want one
// `labels`: a last property, uchar label, which rigid readers do not expect
Status write_splats_ply(const Path& path, const Splats& splats, SplatPly variant, bool labels = false);

} // namespace semrover
