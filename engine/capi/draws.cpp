// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/capi/draws.h"

#include <bit>
#include <cmath>

namespace semrover::capi {

namespace {

// what the frame is seen from; none of a global shutter
Result<std::optional<Readout>> readout_of(const sr_draw_desc& d)
{
    if (d.shutter > SR_SHUTTER_LEFT)
        return fail(ErrorCode::usage, "sr_draw_desc: shutter is {}, expected SR_SHUTTER_..", d.shutter);
    if (d.shutter == SR_SHUTTER_GLOBAL)
        return std::nullopt;
    Readout readout{.direction = ShutterDirection(d.shutter - SR_SHUTTER_DOWN)};
    SR_TRY(readout.from.world_to_camera,
           rigid_from_matrix(d.world_to_camera_start, "sr_draw_desc: world_to_camera_start"));
    SR_TRY(readout.to.world_to_camera, rigid_from_matrix(d.world_to_camera_end, "sr_draw_desc: world_to_camera_end"));
    if (std::ranges::equal(d.world_to_camera_start, d.world_to_camera_end)) // seen from what is given, to the bit
        for (Pose* pose : {&readout.from, &readout.to})
            std::ranges::copy(d.world_to_camera_start, pose->world_to_camera.begin());
    SR_TRY(readout.start, number_in(d.readout_start, -kMostSeconds, kMostSeconds, "sr_draw_desc", "readout_start"));
    SR_TRY(readout.end, number_in(d.readout_end, readout.start, kMostSeconds, "sr_draw_desc", "readout_end"));
    return readout;
}

} // namespace

CameraFrame camera_frame(const double (&pinhole)[4], const double (&world_to_camera)[12], const ImageSize& size,
                         double time)
{
    CameraFrame frame;
    frame.time = time;
    Intrinsics& i = frame.intrinsics;
    i.fx = pinhole[0];
    i.fy = pinhole[1];
    i.cx = pinhole[2];
    i.cy = pinhole[3];
    i.width = size.width;
    i.height = size.height;
    std::copy_n(world_to_camera, 12, frame.pose.world_to_camera.begin());
    return frame;
}

Status check_camera(const CameraFrame& frame, const char* name)
{
    SR_CHECK(number_in(frame.time, -kMostSeconds, kMostSeconds, name, "time").map([](double) {}));
    for (const double v : frame.pose.world_to_camera)
        if (!std::isfinite(v))
            return fail(ErrorCode::bad_input, "{}: a number of world_to_camera is not finite", name);
    return check_intrinsics(frame.intrinsics, name);
}

Result<CameraFrame> frame_of(const sr_draw_desc& d)
{
    SR_CHECK(check_size({d.width, d.height}, "sr_draw_desc"));
    CameraFrame frame = camera_frame({d.fx, d.fy, d.cx, d.cy}, d.world_to_camera, {d.width, d.height}, d.time);
    SR_CHECK(number_in(d.time, -kMostSeconds, kMostSeconds, "sr_draw_desc", "time").map([](double) {}));
    if (d.camera_model > SR_CAMERA_FTHETA)
        return fail(ErrorCode::usage, "sr_draw_desc: camera_model is {}, expected SR_CAMERA_..", d.camera_model);
    Intrinsics& i = frame.intrinsics;
    i.model = CameraModel(d.camera_model);
    std::ranges::copy(d.distortion, i.distortion.begin());
    SR_TRY(frame.readout, readout_of(d));
    // note: other pinholes may turn pictures over, by focal lengths below 0
    if (i.model != CameraModel::pinhole || i.distortion != Distortion() || frame.readout)
        SR_CHECK(check_intrinsics(i, "sr_draw_desc"));
    i = simplified(i);
    return frame;
}

// note: in steps, so that a rasterizer is seldom made anew
RasterizerOptions with_actors(const sr_world& world, RasterizerOptions options)
{
    if (!world.actors.size())
        return options;
    options.movers = std::bit_ceil(std::max(world.actors.size(), 16u));
    options.mover_numbers = std::bit_ceil(std::max(uint32_t(world.actors.rows().size()), 256u));
    return options;
}

RasterizerOptions drawing_options(const sr_world& world, const CameraFrame& frame, RasterizerOptions options)
{
    options.moving = world.actors.moving(frame);
    options.model = drawn_model(frame.intrinsics.model, options.moving);
    return with_actors(world, std::move(options));
}

bool WorldDraw::goes_with(const WorldDraw& other) const
{
    return size() == other.size() && options == other.options && !options.depth_tested &&
           depth_scale == other.depth_scale;
}

Result<WorldDraw> draw_of(const sr_world& world, const sr_draw_desc& d, const PictureFormats& formats)
{
    SR_TRY(CameraFrame frame, frame_of(d));
    const bool tested = d.depth_test.image;
    RasterizerOptions options = drawing_options(world, frame, {.depth_tested = tested, .formats = formats});
    if (tested && options.model != CameraModel::pinhole)
        return fail(ErrorCode::usage, "sr_draw_desc: depth_test is for pinholes, where nothing moves during a readout");
    return WorldDraw{std::move(frame), std::move(options), depth_scale(d), d.depth_test};
}

} // namespace semrover::capi
