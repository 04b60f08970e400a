// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what mouse, panels and scripts ask of the viewer
#include "runtime/base/final_name.h"
#include "tools/view/viewer.h"

namespace semrover::view {

void Viewer::note(const Status& status)
{
    if (!status)
        notice_ = status.error().message;
}

Status Viewer::show(Shown shown)
{
    if (shown == Shown::refined && !refined_there_)
        return fail(ErrorCode::usage, "there is no refined frame of this view");
    if (shown == Shown::refined && shown_ != Shown::refined)
        before_refined_ = shown_;
    shown_ = shown;
    return {};
}

Status Viewer::click(double x, double y)
{
    if (!(x >= 0 && y >= 0 && x < picture_->width() && y < picture_->height()))
        return fail(ErrorCode::usage, "pixel ({}, {}) is outside of {} x {}", x, y, picture_->width(),
                    picture_->height());
    picked_.reset();
    SR_CHECK(draw_alone());
    const auto column = uint32_t(x), row = uint32_t(y);
    SR_TRY(const float depth, picture_->depth_at(column, row));
    if (!(depth > 0))
        return {};
    const Vector place = drawn_camera_.place(column + 0.5, row + 0.5, depth, picture_->width(), picture_->height());
    SR_TRY(picked_, pick(*street_, place));
    repick_ = false;
    camera.distance = depth;
    return {};
}

Status Viewer::paint()
{
    if (!picked_)
        return fail(ErrorCode::usage, "no voxel is picked");
    SR_TRY(const size_t cells, brush.paint(*street_, picked_->cell));
    repick_ = true;
    note(fmt::format("{} voxels changed", cells));
    return {};
}

Status Viewer::undo()
{
    SR_TRY(const size_t cells, brush.undo(*street_));
    repick_ = true;
    note(fmt::format("{} voxels changed back", cells));
    return {};
}

Status Viewer::refine()
{
    SR_CHECK(refiner_->begin(*street_, camera, *picture_));
    refined_camera_ = camera;
    return {};
}

void Viewer::play()
{
    recorder.on = false;
    playing_ = 0;
}

Status Viewer::check_replace(const Path& path) const
{
    return refuse_existing(path, request_.replace);
}

Status Viewer::save_path(const Path& path) const
{
    SR_CHECK(check_replace(path));
    return recorder.save(path, picture_->width(), picture_->height());
}

Status Viewer::save_grid(const Path& path) const
{
    SR_CHECK(check_replace(path));
    return street_->save(path);
}

Status Viewer::save_picture(const Path& path)
{
    SR_CHECK(check_replace(path));
    wanted_picture_ = path;
    return {};
}

} // namespace semrover::view
