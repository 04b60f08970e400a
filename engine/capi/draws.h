// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/exchange.h"

// cameras of the application's as the engine has them, and what they see of a world
namespace semrover::capi {

// fx, fy, cx, cy in pixels and [3, 4] row by row; seconds
CameraFrame camera_frame(const double (&pinhole)[4], const double (&world_to_camera)[12], const ImageSize& size,
                         double time);

// Errors: bad_input for numbers that are not finite, and focal lengths that are not above 0. name: of the structure
Status check_camera(const CameraFrame& frame, const char* name);

// Errors: as sr_world_draw has them
Result<CameraFrame> frame_of(const sr_draw_desc& draw);

constexpr double kMostSeconds = 1e12; // of times

// options of a rasterizer that draws the world's actors, too, and of one that draws a frame
RasterizerOptions with_actors(const sr_world& world, RasterizerOptions options);
RasterizerOptions drawing_options(const sr_world& world, const CameraFrame& frame, RasterizerOptions options);

struct WorldDraw {
    CameraFrame frame;
    RasterizerOptions options; // of what draws it; formats of what is wanted
    std::array<float, 2> depth_scale{};
    sr_depth_image depth_test{};

    ImageSize size() const { return {frame.intrinsics.width, frame.intrinsics.height}; }
    SplatCamera camera() const { return splat_camera(frame, options.moving); }
    bool goes_with(const WorldDraw& other) const; // in one submit
};
// Targets are not looked at. Errors: as sr_world_draw has them
Result<WorldDraw> draw_of(const sr_world& world, const sr_draw_desc& desc, const PictureFormats& formats);

// What cameras see, on the device, until the next draw of the world: at once, or by commands that are being recorded.
// draws: that go together; as many of the first are drawn as there is room for, one at least. What is new is shown
// before, by show_updates(). Errors: as sr_world_draw has them. name: of the call
Result<std::vector<SplatSlots>> draw_splats(sr_world& world, std::span<const WorldDraw> draws, const char* name);
Result<SplatSlots> record_splats(sr_world& world, const WorldDraw& draw, VkCommandBuffer commands, const char* name);

} // namespace semrover::capi
