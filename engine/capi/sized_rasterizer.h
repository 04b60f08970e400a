// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/image_size.h"
#include "engine/splat/rasterizer.h"

namespace semrover::capi {

// A rasterizer for one camera, of one kind, and the size of the last pictures, made anew when another size is asked
// for.
class SizedRasterizer {
  public:
    Result<Rasterizer*> of(Device& device, const SurfelScene& scene, const ImageSize& size,
                           const RasterizerOptions& options)
    {
        if (rasterizer_ && size_ == size && alpha_ == options.visible_alpha)
            return rasterizer_.get();
        rasterizer_.reset(); // its memory goes before the next one's comes
        SR_TRY(rasterizer_, Rasterizer::create(device, scene, size.width, size.height, 1, options));
        size_ = size;
        alpha_ = options.visible_alpha;
        return rasterizer_.get();
    }

    Rasterizer* last() const { return rasterizer_.get(); } // or null

  private:
    std::unique_ptr<Rasterizer> rasterizer_;
    ImageSize size_;
    float alpha_ = 0;
};

} // namespace semrover::capi
