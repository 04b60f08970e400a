// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/frame_rasterizers.h"

namespace semrover {

Result<Rasterizer*> FrameRasterizers::of(const CameraFrame& like, uint32_t frames)
{
    const Intrinsics& size = like.intrinsics;
    const bool moves = moving(like);
    const CameraModel model = drawn_model(size.model, moves);
    auto& rasterizer = rasterizers_[{size.width, size.height, model, moves}];
    if (!rasterizer) {
        RasterizerOptions options = options_;
        options.model = model;
        options.moving = moves;
        SR_TRY(rasterizer, Rasterizer::create(device_, scene_.splats, size.width, size.height, frames, options));
    }
    return rasterizer.get();
}

Result<SplatSlots> FrameRasterizers::draw(const CameraFrame& frame)
{
    SR_TRY(Rasterizer * rasterizer, of(frame, 1));
    const SplatCamera camera = splat_camera(frame, moving(frame));
    SR_CHECK(rasterizer->draw({&camera, 1}, scene_.actors.seen_by({&frame, 1}, moving(frame))).map([](uint32_t) {}));
    return rasterizer->images(0);
}

} // namespace semrover
