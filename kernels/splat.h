// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/graph.h"

#include <array>

// Ops that make splats of points and draw them; what ops are and how they are called: kernels/network.h
namespace semrover {

// the k nearest points of every point, itself included, nearest first, ties by index; 2^32 - 1 where there is none
constexpr uint32_t kMaxNeighbors = 32;
struct KnnOptions {
    uint32_t neighbors = 16;
    float cell_size = 0.45f;     // metres, of the search grid: about ten points per cell are best
    float radius = 0;            // metres, no neighbour is further away; 0: no limit
    Tensor labels = {};          // [P] u32, or none: prefer neighbours of the same label
    uint32_t min_same_label = 4; // if there are fewer of those, neighbours of any label
    Tensor queries = {};         // [Q, 3 or more] fp32 array, or none: of these instead, [Q, neighbors]; no labels
};
[[nodiscard]] Tensor knn(Graph& g,
                         Tensor points, // [P, 3 or more] fp32 array; one that is not finite has no neighbours
                         const KnnOptions& options = {}); // [P, neighbors] u32 array

// the plane through a point's neighbours, by principal components; its normal's largest component is positive
struct PcaNormalOptions {
    bool fallbacks = false;   // where neighbours form a thin line, its outward direction; where there is no plane, +z
    Tensor labels = {};       // [P] u32, or none
    uint32_t line_labels = 0; // bit per label: things that count as lines more readily (poles)
};
struct PcaNormals {
    Tensor normals;     // [P, 4] fp32: unit normal; 0 plane, 1 line, 2 neither
    Tensor eigenvalues; // [P, 4] fp32: of the covariance, m^2, ascending; number of neighbours
};
[[nodiscard]] PcaNormals pca_normal(Graph& g,
                                    Tensor points,    // [P, 3 or more] fp32 array
                                    Tensor neighbors, // [P, k] u32 array, 2^32 - 1 for none
                                    const PcaNormalOptions& options = {});

// normals and sizes of the splats of points
struct SplatSize {
    float sigma = 0.04f; // metres
    float spacing = 0;   // sigma = spacing times the rms distance of the nearest three points; 0: `sigma`
    float smallest = 0.01f, largest = 0.3f; // of such a sigma, metres
};
[[nodiscard]] Tensor splat_shape(Graph& g,
                                 Tensor points,               // [P, 4] fp32 array
                                 Tensor colors,               // [P, 4] fp32 array: rgb; the fourth number becomes sigma
                                 Tensor neighbors,            // [P, k] u32 array, nearest first
                                 Tensor planes,               // [P, 4] fp32 array: normal
                                 const SplatSize& size = {}); // [P, 4] fp32: normal, sigma

// splats: 2D Gaussians in the plane across a normal, axes t_u = normalize(e x n) with e the axis least aligned with n,
// and t_v = n x t_u. One that is not finite, or without normal, size or opacity, is skipped.
struct SplatTensors {
    Tensor positions;   // [N, 4] fp32: metres, opacity
    Tensor normals;     // [N, 4] fp32: unit normal, sigma_u in metres
    Tensor colors;      // [N, 4] fp32: rgb, sigma_v in metres
    Tensor labels;      // [N] u32
    Tensor cells;       // [N] u32
    Tensor owners;      // [N] u32: number of the thing that a splat is of, 0 of none
    Tensor blocks = {}; // [N / 64, rounded up] u32, or none: splats of a block that has 0 are skipped
};
// how rays become pixels, of all cameras of one call: engine/camera/lens.h; spinning: a part of a lidar's sweep, of
// less than a turn (SweepPicture, engine/camera/lidar.h)
enum class SplatLens : uint32_t { pinhole, opencv, fisheye, equirectangular, ftheta, spinning };
constexpr uint32_t kLensCameraFloats = 40;
constexpr uint32_t splat_camera_floats(SplatLens lens)
{
    return lens == SplatLens::pinhole ? 16 : kLensCameraFloats;
}
constexpr uint32_t splat_record_bytes(SplatLens lens, bool moving)
{
    return lens == SplatLens::pinhole ? 64 : moving ? 96 : 80;
}

// rules where published rasterizers differ: docs/method.md §5.3; lenses but the pinhole: §5.4
struct SplatOptions {
    uint32_t width = 0, height = 0; // pixels
    SplatLens lens = SplatLens::pinhole;
    bool moving = false;      // cameras move while their pictures are read out; not of pinholes
    uint32_t max_visible = 0; // records of (camera, splat) that are kept; one too many and the image is wrong
    uint32_t max_pairs = 0;   // pairs of a record and a tile that it touches; likewise
    uint32_t tile = 16;       // pixels, a multiple of 16; the image does not depend on it
    float near = 0.2f;        // metres
    float alpha_min = 1.f / 255, alpha_max = 0.99f;
    float transmittance_min = 1e-4f;
    float screen_variance = 0.5f; // pixels^2, of the screen filter; 0: none
    float cutoff = 0;             // sigmas; 0: as far as alpha_min
    // [cameras * height * width] fp32 array, or none, of pinholes: metres along z, what lies farther is not seen
    Tensor limits = {};
    Tensor rows = {}; // [height, 4] fp32 array of a sweep: shaders/splat/splat.h
    // [cameras * movers, 12] fp32 array, or none: things that move, as each camera sees them. A row takes what a
    // mover's splats are given in to the camera's frame, [3, 4] row-major; zeros hide it. Without them nothing has
    // moved. Where cameras move while they are read out, [cameras * movers * 2, 12]: a row to the camera's frame in the
    // middle of the readout, then in that frame a turn (axis times radians) and a shift from its start to its end, and
    // the point that it turns about, at places 0, 4 and 8
    Tensor movers = {};
    // [numbers] u32, beside movers: by the number of a thing its mover + 1; 0, and beyond the end: it stands
    Tensor mover_rows = {};
    // which of color, surface, depth, ids and owners are made; the others are [1] and nothing is written to them
    std::array<bool, 5> made = {true, true, true, true, true};
};
struct SplatImages { // [cameras * height * width] rows; w = weight of a splat in a pixel
    Tensor color;    // [.., 4] fp32: sum of w rgb; alpha = sum of w
    Tensor surface;  // [.., 4] fp32: sum of w normal, camera frame, towards the camera; sum of w depth
    Tensor depth;    // [.., 2] fp32: expected (sum of w depth / alpha), median (of the splat that passes one half)
    Tensor ids;      // [.., 2] u32: label and voxel of the splat with the largest w, 2^32 - 1 for none. In a sweep of
                     // that of the median depth
    Tensor owners;   // [..] u32: what that splat is of, as SplatTensors has it; 0 for none
    Tensor visible, pairs; // [1] u32: the numbers that had to fit the two maxima
};
// such limits of z-buffers: scale / (z - offset); infinite where that is not above 0
[[nodiscard]] Tensor splat_limits(Graph& g,
                                  Tensor z,      // [P] fp32 array
                                  Tensor scale); // [1, 2] fp32: scale, offset -> [P] fp32 array
[[nodiscard]] SplatImages
splat(Graph& g, const SplatTensors& scene,
      // [C, 16] fp32: fx fy cx cy, world to camera [3, 4]; fx = 0: sees nothing. With another lens [C, 40], then
      // 12 numbers of distortion; limit of the lens, 1 where depth is from the camera instead of along z, r, reach of
      // the lens; turn of the camera during its readout (axis times radians), p; shift (metres), q. Turn and shift are
      // of its frame in the middle of the readout, which is that of `world to camera`. The line of a pixel at (x, y) is
      // read at the part p x + q y + r, from -1/2 to 1/2.
      Tensor cameras, const SplatOptions& options);

} // namespace semrover
