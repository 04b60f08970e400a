// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// pictures of a textured scene in daylight, by rays: scene, view [8, 4] -> light, ambient, surfaces [pixels, 4] ->
// picture [pixels, 4]
#include "kernels/trace.h"

#include "shade.spv.h"
#include "shade_resolve.spv.h"

namespace semrover {

Tensor shade(Graph& g, const TraceScene& scene, Tensor view, const ShadeOptions& options)
{
    const uint32_t pixels = options.width * options.height;
    SR_ASSERT(pixels > 0 && options.samples > 0 && options.ambient_rays > 0 && view.ld == 4 && view.rows == 8,
              "shade: {} x {} pixels, {} samples, {} rays, view [{}, {}]", options.width, options.height,
              options.samples, options.ambient_rays, view.rows, view.ld);
    const ShadePush push{.rows = pixels,
                         .first_row = 0,
                         .width = options.width,
                         .height = options.height,
                         .samples = options.samples,
                         .ambient_rays = options.ambient_rays,
                         .seed = options.seed};
    const Tensor light = g.array(pixels, DType::f32, "straight light", 4);
    const Tensor ambient = g.array(pixels, DType::f32, "light from around", 4);
    const Tensor surfaces = g.array(pixels, DType::u32, "surfaces", 4);
    DispatchOptions dispatch;
    dispatch.banded = {"Light", "Ambient", "Surfaces"};
    dispatch.max_flops = double(pixels) * options.samples * (2.5 + options.ambient_rays) * kOperationsPerRay;
    g.dispatch(kernel::shade,
               {{"Nodes", scene.nodes},
                {"Triangles", scene.triangles},
                {"Corners", scene.corners},
                {"Materials", scene.materials},
                {"Texels", scene.texels},
                {"View", view},
                {"Light", light},
                {"Ambient", ambient},
                {"Surfaces", surfaces}},
               push, threads(pixels), std::move(dispatch));
    const Tensor picture = g.array(pixels, DType::u32, "picture", 4);
    g.dispatch(kernel::shade_resolve,
               {{"Light", light}, {"Ambient", ambient}, {"Surfaces", surfaces}, {"View", view}, {"Picture", picture}},
               push, threads(pixels));
    return picture;
}

} // namespace semrover
