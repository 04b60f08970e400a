// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/frame_rasterizers.h"

namespace semrover {

Result<Rasterizer*> FrameRasterizers::of(const CameraFrame& like, uint32_t frames)
{
    const Intrinsics& size = like.intrinsics;
    const CameraModel model = drawn_model(like);
    auto& rasterizer = rasterizers_[{size.width, size.height, model, like.moves()}];
    if (!rasterizer) {
        RasterizerOptions options = options_;
        options.model = model;
        options.moving = like.moves();
        SR_TRY(rasterizer, Rasterizer::create(device_, scene_.splats, size.width, size.height, frames, options));
    }
    return rasterizer.get();
}

} // namespace semrover
