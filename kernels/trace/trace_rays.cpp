// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the nearest triangle along each ray, by descent of a tree of boxes: rays [R, 8] -> hits [R, 4]
#include "kernels/trace.h"

#include "trace_rays.spv.h"

namespace semrover {

Tensor trace_rays(Graph& g, const TraceScene& scene, Tensor rays, bool any)
{
    SR_ASSERT(rays.dtype == DType::f32 && rays.ld == 8, "trace_rays: rays [{}, {}]", rays.rows, rays.ld);
    const TraceRaysPush push{.rows = rays.rows};
    const Tensor hits = g.array(rays.rows, DType::u32, "ray hits", 4);
    DispatchOptions options;
    options.constants = {{"kAny", any}};
    options.banded = {"Rays", "Hits"};
    options.max_flops = rays.rows * kOperationsPerRay;
    g.dispatch(kernel::trace_rays,
               {{"Nodes", scene.nodes}, {"Triangles", scene.triangles}, {"Rays", rays}, {"Hits", hits}}, push,
               threads(rays.rows), std::move(options));
    return hits;
}

} // namespace semrover
