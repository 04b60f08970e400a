// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// sweeps of lidars through a world
#include "engine/capi/draws.h"
#include "engine/job/lidar_returns.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

// a lidar of the world's, whose table is read the first time
Result<WorldLidar*> lidar_of(sr_world& world, const char* name)
{
    const std::string known = name;
    const auto found = world.lidars.find(known);
    if (found != world.lidars.end())
        return &found->second;
    SR_TRY(Lidar table, known.ends_with(".json") ? read_lidar(known) : named_lidar(known));
    return &(world.lidars[known] = {std::make_shared<const Lidar>(std::move(table))});
}

Result<LidarSweep> sweep_of(const sr_sweep_desc& d, std::shared_ptr<const Lidar> lidar)
{
    if (d.reserved)
        return fail(ErrorCode::usage, "sr_sweep_desc: reserved is not 0");
    LidarSweep sweep;
    sweep.lidar = std::move(lidar);
    SR_TRY(sweep.time, number_in(d.time, -kMostSeconds, kMostSeconds, "sr_sweep_desc", "time"));
    SR_TRY(sweep.begin, rigid_from_matrix(d.sensor_to_world_begin, "sr_sweep_desc: sensor_to_world_begin"));
    SR_TRY(sweep.end, rigid_from_matrix(d.sensor_to_world_end, "sr_sweep_desc: sensor_to_world_end"));
    return sweep;
}

// made anew where there are more splats than it looks at, or more actors than it has room for
Result<SweepDrawing*> drawing_of(sr_world& world, WorldLidar& lidar, const SplatPool& splats)
{
    RasterizerOptions options = with_actors(world, {});
    if (lidar.drawing && lidar.options == options && splats.end() <= lidar.drawing->rows())
        return lidar.drawing.get();
    lidar.drawing.reset();
    lidar.options = options;
    options.rows = splats.end();
    SR_TRY(lidar.drawing,
           SweepDrawing::create(*world.context->drawing, splats.scene(), world.actors, lidar.table, options));
    return lidar.drawing.get();
}

uint64_t most_returns(const Lidar& lidar)
{
    uint64_t rays = 0;
    for (const LidarBeam& beam : lidar.beams)
        rays += divide_up(lidar.columns, beam.every);
    return rays;
}

sr_lidar_return return_of(const LidarPoint& p)
{
    return {p.x, p.y, p.z, p.intensity, p.ring, p.label, p.instance, p.time};
}

Status draw_sweep(sr_world& world, const sr_sweep_desc& d, sr_lidar_return* returns, uint64_t& count)
{
    SR_TRY(const SplatPool* splats, splats_of(world, "sr_world_sweep"));
    if (!d.lidar)
        return fail(ErrorCode::usage, "sr_sweep_desc: lidar is NULL");
    SR_TRY(const double least_alpha, number_in(d.least_alpha, 0, 1, "sr_sweep_desc", "least_alpha"));
    SR_TRY(WorldLidar * lidar, lidar_of(world, d.lidar));
    SR_TRY(const LidarSweep sweep, sweep_of(d, lidar->table));
    const uint64_t room = std::exchange(count, most_returns(*lidar->table));
    if (!returns)
        return {};
    count = 0;
    SR_CHECK(show_updates(world, true));
    SR_TRY(SweepDrawing * drawing, drawing_of(world, *lidar, *splats));
    SR_TRY(const SweepImage image, drawing->render(sweep));
    const float least = least_alpha > 0 ? float(least_alpha) : RasterizerOptions().visible_alpha;
    const std::vector<LidarPoint> points = lidar_returns(sweep, image, least);
    count = std::min<uint64_t>(room, points.size());
    std::transform(points.begin(), points.begin() + ptrdiff_t(count), returns, return_of);
    if (count < points.size())
        return fail(ErrorCode::partial, "sr_world_sweep: {} returns, room for {}", points.size(), room);
    return {};
}

} // namespace

sr_status sr_world_sweep(sr_world* world, const sr_sweep_desc* sweep, sr_lidar_return* returns, uint64_t* count)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world || !count)
            return fail(ErrorCode::usage, "sr_world_sweep: {} is NULL", world ? "count" : "world");
        SR_TRY(const sr_sweep_desc known, read_struct(sweep, "sr_sweep_desc"));
        return draw_sweep(*world, known, returns, *count);
    });
}

static_assert(sizeof(sr_sweep_desc) == 232 && sizeof(sr_lidar_return) == 32);
