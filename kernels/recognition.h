// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/network.h"

#include <array>

// Ops of networks that recognise what is in images and point clouds, as those of kernels/network.h
namespace semrover {

// -- images ----------------------------------------------------------------------------------------------------------

// y = max, or mean, of the pixels of a window that lie inside the image (count_include_pad = False)
struct PoolOptions {
    bool mean = false;
    uint32_t kernel_height = 3, kernel_width = 3;
    uint32_t stride_y = 1, stride_x = 1;
    uint32_t padding_y = 0, padding_x = 0; // less than the kernel
};
FeatureMap pool2d(Graph& g, FeatureMap x, const PoolOptions& options, const PartOf& part = {});

// y = (2 / 255 image - 1 - shift) / scale at another size or the same, bilinear between the two nearest pixels each
// way, with pixels as squares (align_corners = False) and no antialiasing
struct ResizeOptions {
    uint32_t in_height = 0, in_width = 0, out_height = 0, out_width = 0; // pixels, up to 16384
    DType dtype = DType::f32;                                            // of y
    std::array<float, 3> shift = {0, 0, 0}, scale = {1, 1, 1};           // of R, G, B
};
constexpr uint32_t rgb_words(uint32_t height, uint32_t width) // of an image of bytes
{
    return divide_up(height * width * 3, 4);
}
[[nodiscard]] FeatureMap resize_bilinear(Graph& g,
                                         Tensor pixels, // [images, rgb_words()] u32 array: bytes R G B R ..
                                         const ResizeOptions& options); // 3 channels

// y = sum over channels of w (a / (|a| + eps) - b / (|b| + eps))^2 of every pixel: how far apart two images' directions
// are
[[nodiscard]] FeatureMap unit_distance(Graph& g, FeatureMap a,
                                       FeatureMap b, // as a
                                       Tensor w,     // [1, C] fp32, or padded to kRowPadding
                                       float eps);   // 1 channel, fp32

// -- networks of points: sets of equally many points, one after the other ---------------------------------------------

// point 0 of every set, then again and again the one that is farthest from those chosen, ties to the lower index
struct PointSamples {
    Tensor index;  // [sets * samples] u32, within the set
    Tensor points; // [sets * samples, 4] fp32: those points
};
[[nodiscard]] PointSamples farthest_point(Graph& g,
                                          Tensor points, // [sets * N, 4] fp32 array: xyz
                                          uint32_t sets, uint32_t samples);

// the first points, in their order, of a center's set with d^2 <= radius^2; too few: the first of them again
struct BallOptions {
    uint32_t sets = 1;
    float radius = 0;
    uint32_t neighbors = 0;
};
[[nodiscard]] Tensor ball_query(Graph& g,
                                Tensor points,               // [sets * N, 4] fp32 array
                                Tensor centers,              // [sets * S, 4] fp32 array
                                const BallOptions& options); // [sets * S * neighbors] u32: rows of `points`

// y = [point - center of its group, features of the point]
[[nodiscard]] Tensor group_points(Graph& g,
                                  Tensor points,   // [P, 4] fp32 array
                                  Tensor centers,  // [G, 4] fp32 array
                                  Tensor features, // [P or more, D] fp32
                                  Tensor index);   // [G * members] u32 -> [G * members, 3 + D]

} // namespace semrover
