// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what lies under a pixel: a draw of it alone
#include "engine/capi/exchange.h"
#include "engine/scene/cell_number.h"
#include "engine/scene/cell_reach.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

// of the centre of the only pixel, `depth` metres along z
std::array<double, 3> position_of(const sr_draw_desc& d, double depth)
{
    const double at[3] = {(0.5 - d.cx) / d.fx * depth, (0.5 - d.cy) / d.fy * depth, depth};
    std::array<double, 3> position{};
    for (size_t row = 0; row < 3; ++row)
        for (size_t axis = 0; axis < 3; ++axis) // the rotation back
            position[axis] += d.world_to_camera[row * 4 + axis] * (at[row] - d.world_to_camera[row * 4 + 3]);
    return position;
}

Result<sr_pick> pick(sr_world& world, sr_draw_desc d, uint32_t x, uint32_t y)
{
    SR_CHECK(check_size({d.width, d.height}, "sr_draw_desc"));
    if (x >= d.width || y >= d.height)
        return fail(ErrorCode::usage, "sr_world_pick: pixel {}, {} of {} x {}", x, y, d.width, d.height);
    d.cx -= x;
    d.cy -= y;
    d.width = d.height = 1;
    d.depth_test.image = nullptr;
    PictureFormats formats;
    formats[1].texels = Texels::none;
    formats[4].texels = Texels::word;
    SR_CHECK(splats_of(world, "sr_world_pick").map([](SplatPool*) {}));
    SR_CHECK(show_updates(world, true));
    SR_TRY(const std::vector<SplatSlots> images, draw_splats(world, {&d, 1}, formats, "sr_world_pick"));
    Device& device = *world.context->drawing;
    SR_TRY(const std::vector<float> color, images[0].color.read<float>(device));
    SR_TRY(const std::vector<float> depth, images[0].depth.read<float>(device));
    SR_TRY(const std::vector<uint32_t> ids, images[0].ids.read<uint32_t>(device));
    SR_TRY(const std::vector<uint32_t> instances, images[0].owners.read<uint32_t>(device));
    sr_pick found{};
    found.cell.label = ids[0];
    if (ids[0] == SR_NO_CELL)
        return found;
    const std::array<double, 3> position = position_of(d, depth[1]);
    std::ranges::copy(position, found.position);
    const auto [i, j, k] = cell_of_number(ids[1], cell_at(position, world.world->voxel_size()));
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
