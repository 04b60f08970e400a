// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/path_drawing.h"

#include "engine/splat/blocks.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

// end of the run of frames from `first` with the same time, size and camera model, all of which move or none
size_t end_of_moment(const CameraPath& path, size_t first)
{
    const CameraFrame& a = path.frames[first];
    size_t end = first + 1;
    for (; end < path.frames.size(); ++end) {
        const CameraFrame& b = path.frames[end];
        if (b.time != a.time || b.camera == a.camera || b.intrinsics.width != a.intrinsics.width ||
            b.intrinsics.height != a.intrinsics.height || b.intrinsics.model != a.intrinsics.model ||
            b.moves() != a.moves())
            break;
    }
    return end;
}

} // namespace

RasterizerOptions DrawOptions::rasterizer(const PictureEncoding& files) const
{
    RasterizerOptions options;
    options.visible_alpha = visible_alpha.value_or(options.visible_alpha);
    options.pixels_over = background;
    options.depth_units = float(units_per_metre(files.depth));
    return options;
}

Result<SplatScene> splats_of(Device& device, const VoxelGrid& grid, const Path& name, const DrawOptions& o)
{
    ScenePoints points = points_of(grid);
    if (points.size() == 0 && !o.semantic)
        return fail(ErrorCode::bad_input, "{} has no points yet: generate them, or draw its labels with `semantic`",
                    quote_path(name));
    if (points.size() == 0)
        return SplatScene::create(device, block_splats(grid));
    if (o.semantic)
        color_by_label(points);
    return SplatScene::create(device, points, o.splats);
}

Result<Rasterizer*> PathDrawing::rasterizer_of(const CameraFrame& like, uint32_t frames)
{
    const Intrinsics& size = like.intrinsics;
    const CameraModel model = drawn_model(like);
    auto& rasterizer = rasterizers_[{size.width, size.height, model, like.moves()}];
    if (!rasterizer) {
        RasterizerOptions options = options_;
        options.model = model;
        options.moving = like.moves();
        SR_TRY(rasterizer, Rasterizer::create(device_, scene_, size.width, size.height, frames, options));
    }
    return rasterizer.get();
}

Result<SplatImage> PathDrawing::image(const CameraFrame& frame)
{
    SR_TRY(Rasterizer * rasterizer, rasterizer_of(frame, 1));
    const SplatCamera camera = splat_camera(frame);
    SR_TRY(std::vector<SplatImage> images, rasterizer->render({&camera, 1}));
    return std::move(images.front());
}

Status PathDrawing::draw(std::span<const CameraFrame> frames, const Drawn& drawn)
{
    SR_TRY(Rasterizer * rasterizer, rasterizer_of(frames.front(), uint32_t(frames.size())));
    std::vector<SplatCamera> cameras;
    for (const CameraFrame& frame : frames)
        cameras.push_back(splat_camera(frame));
    for (size_t at = 0; at < cameras.size();) {
        SR_TRY(const uint32_t together, rasterizer->draw(std::span(cameras).subspan(at)));
        for (uint32_t i = 0; i < together; ++i, ++at)
            SR_CHECK(drawn(frames[at], rasterizer->pixels(i)));
    }
    return {};
}

std::span<const CameraFrame> PathDrawing::next() const
{
    SR_ASSERT(done_ < total(), "all {} frames are drawn", total());
    return std::span(path_.frames).subspan(done_, end_of_moment(path_, done_) - done_);
}

bool PathDrawing::skip()
{
    done_ += next().size();
    return done_ == total();
}

Result<bool> PathDrawing::step(const Drawn& drawn)
{
    SR_CHECK(draw(next(), drawn));
    return skip();
}

Path camera_folder(const Path& folder, const std::string& camera)
{
    return camera.empty() ? folder : folder / camera;
}

} // namespace semrover
