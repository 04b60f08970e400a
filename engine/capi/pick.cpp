// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what lies under a pixel: a draw of it alone
#include "engine/camera/camera_view.h"
#include "engine/capi/draws.h"
#include "engine/scene/cell_number.h"
#include "engine/scene/cell_reach.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

Result<sr_pick> pick(sr_world& world, sr_draw_desc d, uint32_t x, uint32_t y)
{
    SR_CHECK(check_size({d.width, d.height}, "sr_draw_desc"));
    if (x >= d.width || y >= d.height)
        return fail(ErrorCode::usage, "sr_world_pick: pixel {}, {} of {} x {}", x, y, d.width, d.height);
    d.depth_test.image = nullptr;
    PictureFormats formats;
    formats[1].texels = Texels::none;
    formats[4].texels = Texels::word;
    SR_CHECK(splats_of(world, "sr_world_pick").map([](SplatPool*) {}));
    SR_TRY(WorldDraw draw, draw_of(world, d, formats));
    if (draw.options.model == CameraModel::pinhole) { // others may depend on where in the picture a pixel is
        Intrinsics& alone = draw.frame.intrinsics;
        alone.cx -= std::exchange(x, 0);
        alone.cy -= std::exchange(y, 0);
        alone.width = alone.height = 1;
    }
    SR_CHECK(show_updates(world, true));
    SR_TRY(const std::vector<SplatSlots> images, draw_splats(world, {&draw, 1}, "sr_world_pick"));
    Device& device = *world.context->drawing;
    const auto pixel = [at = y * draw.size().width + x](const DeviceTensor& slot) { return slot.row_range(at, 1); };
    SR_TRY(const std::vector<float> color, pixel(images[0].color).read<float>(device));
    SR_TRY(const std::vector<float> depth, pixel(images[0].depth).read<float>(device));
    SR_TRY(const std::vector<uint32_t> ids, pixel(images[0].ids).read<uint32_t>(device));
    SR_TRY(const std::vector<uint32_t> instances, pixel(images[0].owners).read<uint32_t>(device));
    sr_pick found{};
    found.cell.label = SR_NO_CELL;
    // note: a pixel on the edge of a lens may be drawn in fp32, and not be seen here
    const std::optional<Point3> position = CameraView(draw.frame).surface(x + 0.5, y + 0.5, depth[1]);
    if (ids[0] == SR_NO_CELL || !position)
        return found;
    std::ranges::copy(*position, found.position);
    const auto [i, j, k] = cell_of_number(ids[1], cell_at(*position, world.world->voxel_size()));
    found.cell = {i, j, k, ids[0]};
    found.alpha = color[3];
    found.instance = instances[0];
    return found;
}

} // namespace

sr_status sr_world_pick(sr_world* world, const sr_draw_desc* draw, uint32_t x, uint32_t y, sr_pick* found)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world || !found)
            return fail(ErrorCode::usage, "sr_world_pick: {} is NULL", world ? "found" : "world");
        SR_TRY(const sr_draw_desc known, read_struct(draw, "sr_draw_desc"));
        SR_TRY(const sr_pick picked, pick(*world, known, x, y));
        return write_result(picked, found, "sr_world_pick");
    });
}

static_assert(sizeof(sr_pick) == 56);
