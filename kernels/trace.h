// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/graph.h"

// Ops that send rays through triangle meshes, as those of kernels/network.h
namespace semrover {

// a triangle mesh that rays are sent through: a tree of boxes (engine/mesh/bvh.h) and its triangles in the tree's order
struct TraceScene {
    Tensor nodes;     // [nodes, 16] u32 array
    Tensor triangles; // [T, 12] fp32 array: corner, edges to the other two; the fourth numbers hold face, material, and
                      // label | thing << 8 as bits
    Tensor corners;   // [T, 12] u32 array: shaders/lib/surface.glsl; trace_rays does without it and what follows
    Tensor materials; // [M, 8] u32 array
    Tensor texels;    // [texels] u32
};
constexpr double kOperationsPerRay = 6000; // a guess for a street: some forty boxes and ten triangles

// the nearest triangle on each ray, or with `any` some triangle; edges belong to triangles, both sides count
[[nodiscard]] Tensor trace_rays(Graph& g, const TraceScene& scene,
                                Tensor rays,       // [R, 8] fp32 array: origin, near; direction, far
                                bool any = false); // [R, 4] u32: t, u, v as bits; triangle in the tree's order, or
                                                   // 2^32 - 1 (then t is `far`)

// daylight: the sun with soft shadows, sky and street shining on everything (by rays of a fixed pattern), glossy things
// mirror what is around
struct ShadeOptions {
    uint32_t width = 0, height = 0;
    uint32_t samples = 4;      // of a pixel; the first goes through its centre and decides depth, normal and label
    uint32_t ambient_rays = 2; // of a sample
    uint32_t seed = 0;
};
[[nodiscard]] Tensor shade(Graph& g, const TraceScene& scene,
                           Tensor view,                  // [8, 4] fp32 array: shaders/lib/view.glsl
                           const ShadeOptions& options); // [pixels, 4] u32: sRGB bytes; depth as bits, 0 for sky;
                                                         // normal as signed bytes, camera frame; label | thing << 8,
                                                         // sky where nothing is

} // namespace semrover
