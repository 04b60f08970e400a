// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// bytes, depths, labels and directions of what splats look like: [P, ..] -> three words a pixel
#include "kernels/picture.h"

#include "splat_pixels.spv.h"

namespace semrover {

PixelWords splat_pixels(Graph& g, const SplatImages& images, const SplatPixelsOptions& options)
{
    const uint32_t pixels = images.color.rows;
    SR_ASSERT(images.color.ld == 4 && images.surface.ld == 4 && images.depth.ld == 2 && images.ids.ld == 2 &&
                  images.surface.rows == pixels && images.depth.rows == pixels && images.ids.rows == pixels,
              "splat_pixels: {}, {}, {} and {} pixels", pixels, images.surface.rows, images.depth.rows,
              images.ids.rows);
    const PixelWords y{g.array(pixels, DType::u32, "seen"), g.array(pixels, DType::u32, "depths"),
                       g.array(pixels, DType::u32, "normals")};
    const auto& [red, green, blue] = options.background;
    const SplatPixelsPush push{.pixels = pixels,
                               .red = float(red),
                               .green = float(green),
                               .blue = float(blue),
                               .visible_alpha = options.visible_alpha,
                               .depth_units = options.depth_units};
    g.dispatch(kernel::splat_pixels,
               {{"Color", images.color},
                {"Surface", images.surface},
                {"Depth", images.depth},
                {"Ids", images.ids},
                {"Seen", y.seen},
                {"Depths", y.depths},
                {"Normals", y.normals}},
               push, threads(pixels));
    return y;
}

} // namespace semrover
