// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// worlds: opened, walked through, edited
#include "engine/capi/edits.h"
#include "engine/capi/exchange.h"
#include "engine/capi/posts.h"
#include "engine/scene/cell_reach.h"
#include "engine/scene/palette.h"
#include "engine/scene/tiles.h"

#include <set>

using namespace semrover;
using namespace semrover::capi;

namespace {

constexpr double kMostMetres = 1e6; // of lengths

constexpr std::array kSamplers = {"ddpm", "ddim", "dpm++2m"};                       // of SR_SAMPLER_..
constexpr std::array kStrategies = {RegionStrategy::complete, RegionStrategy::rim}; // of SR_REGIONS_..

Result<GenerationOptions> options_of(const sr_generation& g)
{
    const auto whole = [](double value, double low, double high, const char* field) {
        return number_in<int>(value, low, high, "sr_generation", field);
    };
    const auto real = [](double value, double high, const char* field) {
        return number_in(value, 0, high, "sr_generation", field);
    };
    GenerationOptions o;
    SR_TRY(const int sampler, whole(g.sampler, 0, kSamplers.size() - 1, "sampler"));
    o.sampler = kSamplers[size_t(sampler)];
    SR_TRY(const int known, whole(g.known, 0, 1, "known"));
    o.known = known ? KnownTokens::clean : KnownTokens::noised;
    SR_TRY(const int strategy, whole(g.regions, 0, kStrategies.size() - 1, "regions"));
    o.strategy = kStrategies[size_t(strategy)];
    SR_TRY(o.region_size, whole(g.region_size, 1, 4096, "region_size"));
    SR_TRY(o.coverage_threshold, whole(g.least_uncovered, 1, 4096, "least_uncovered"));
    SR_TRY(o.jump_length, whole(g.jump_length, 0, 10000, "jump_length"));
    SR_TRY(o.jump_n_sample, whole(g.jump_count, 1, 10000, "jump_count"));
    SR_TRY(o.guidance_from, whole(g.guidance_from, 0, kLastTimestep, "guidance_from"));
    SR_TRY(o.guidance_until, whole(g.guidance_until, 0, kLastTimestep, "guidance_until"));
    SR_TRY(o.eta, real(g.eta, 1, "eta"));
    SR_TRY(const double scale, real(g.guidance_scale, kMaxGuidance, "guidance_scale"));
    o.guidance_scale = float(scale);
    SR_TRY(o.guidance_radius, real(g.guidance_radius, kMostMetres, "guidance_radius"));
    return o;
}

Result<SceneObject> object_of(const sr_object& o, const std::string& where)
{
    SceneObject object{.id = o.id, .heading = o.heading, .part = o.part == 1};
    if (o.label >= kClassCount || o.colored > 1 || o.part > 1 || o.reserved)
        return fail(ErrorCode::usage, "{}: label {}, colored {}, part {} or reserved {}", where, o.label, o.colored,
                    o.part, o.reserved);
    object.label = uint8_t(o.label);
    std::ranges::copy(o.center, object.center.begin());
    std::ranges::copy(o.size, object.size.begin());
    if (o.colored)
        object.tint = {o.color[0], o.color[1], o.color[2]};
    for (const float channel : o.color)
        if (!(channel >= 0 && channel <= 1))
            return fail(ErrorCode::bad_input, "{}: a colour of {}, expected 0 to 1", where, channel);
    SR_CHECK(check_object(object, where));
    return object;
}

sr_object described(const SceneObject& object)
{
    sr_object o{};
    o.id = object.id;
    o.label = object.label;
    o.heading = object.heading;
    o.colored = object.tint.has_value();
    std::ranges::copy(object.center, o.center);
    std::ranges::copy(object.size, o.size);
    for (size_t c = 0; c < 3 && object.tint; ++c)
        o.color[c] = float((*object.tint)[c]);
    o.part = object.part;
    return o;
}

Result<GivenObjects> objects_of(const sr_world_desc& d)
{
    if (d.conditioning > SR_CONDITIONING_GIVEN)
        return fail(ErrorCode::usage, "sr_world_desc: conditioning is {}, expected SR_CONDITIONING_..", d.conditioning);
    if ((d.conditioning == SR_CONDITIONING_GIVEN) != (d.objects && d.object_count))
        return fail(ErrorCode::usage, "sr_world_desc: objects and SR_CONDITIONING_GIVEN come together");
    if (d.conditioning == SR_CONDITIONING_GUESSED)
        return GivenObjects();
    std::vector<SceneObject> objects;
    std::set<uint32_t> ids;
    for (uint64_t n = 0; n < d.object_count; ++n) {
        SR_TRY(objects.emplace_back(), object_of(d.objects[n], fmt::format("sr_world_desc: object {}", n)));
        if (!ids.insert(objects.back().id).second)
            return fail(ErrorCode::bad_input, "sr_world_desc: object {} has the id {} of another", n,
                        objects.back().id);
    }
    return GivenObjects(std::move(objects));
}

double tile_size_of(const sr_world_desc& d)
{
    return d.tile_size == 0 ? kUsualTileSize : d.tile_size;
}

Result<GenerationSettings> settings_of(const sr_world_desc& d, const Model& model)
{
    if (d.steps > 1'000'000)
        return fail(ErrorCode::usage, "sr_world_desc: {} steps", d.steps);
    GenerationOptions o;
    if (d.generation) {
        SR_TRY(const sr_generation generation, read_struct(d.generation, "sr_generation"));
        SR_TRY(o, options_of(generation));
    }
    o.model = model.path();
    o.preset = model.preset();
    o.precision = model.precision();
    if (d.steps)
        o.steps = int(d.steps);
    o.tile_size = tile_size_of(d);
    return resolve_generation(o);
}

// the application's callback as the engine calls it
LabelCallback labels_callback(const sr_world_desc& d, float voxel_size)
{
    return [labels = d.labels, user = d.user, voxel_size](const CellWindow& window, VoxelGrid& grid) -> Status {
        sr_grid cells;
        cells.grid.voxel_size = voxel_size;
        const sr_cell_rect asked{{window.low[0], window.low[1]}, {window.high[0], window.high[1]}};
        const sr_status status = labels(user, &asked, &cells);
        if (status == SR_NOT_YET)
            return fail(kNotYet, "the labels are not there yet");
        if (status != SR_OK)
            return fail(ErrorCode(status), "the application's labels callback returned {}", sr_status_name(status));
        grid.cells = std::move(cells.read().cells);
        grid.labels = std::move(cells.read().labels);
        return {};
    };
}

Result<std::unique_ptr<WorldLabels>> labels_of(const sr_world_desc& d, float voxel_size)
{
    if ((d.grid != nullptr) + (d.folder != nullptr) + (d.labels != nullptr) != 1)
        return fail(ErrorCode::usage, "sr_world_desc: one of grid, folder and labels must be given");
    if (d.folder)
        return labels_of_folder(d.folder);
    if (d.labels)
        return labels_of_callback(voxel_size, labels_callback(d, voxel_size));
    if (!d.model)
        return labels_of_grid(d.grid->read());
    VoxelGrid grid;
    grid.voxel_size = d.grid->read().voxel_size;
    grid.cells = d.grid->read().cells;
    grid.labels = d.grid->read().labels;
    return labels_of_grid(std::move(grid));
}

Result<std::unique_ptr<sr_world>> make_world(sr_context& context, const sr_world_desc& d)
{
    auto world = std::make_unique<sr_world>();
    world->context = &context;
    world->number = ++context.worlds;
    const auto metres = [](double value, const char* field) {
        return number_in(value, 0, kMostMetres, "sr_world_desc", field);
    };
    if (d.reserved)
        return fail(ErrorCode::usage, "sr_world_desc: reserved is not 0");
    SR_CHECK(metres(d.tile_size, "tile_size").map([](double) {}));
    SR_TRY(const double splat_radius, metres(d.splat_radius, "splat_radius"));
    WorldRequest request;
    SR_TRY(request.detail_distance, metres(d.detail_distance, "detail_distance"));
    SR_TRY(request.any_device, number_in<bool>(d.portable_cache, 0, 1, "sr_world_desc", "portable_cache"));
    request.seed = d.seed;
    if (d.model) {
        SR_TRY(world->model, model_of(context, d.model, "sr_world_desc"));
        if (!world->model->voxfield())
            return fail(ErrorCode::usage, "sr_world_desc: the model has no voxfield transformer");
        SR_TRY(request.settings, settings_of(d, *world->model));
        request.transformer = world->model->transformer();
    } else if (d.labels || d.cache) {
        return fail(ErrorCode::usage, "sr_world_desc: without a model a world shows the points of a grid or a folder");
    }
    SR_TRY(auto labels, labels_of(d, request.settings.model.config.voxel_size));
    if (!d.model) {
        SR_TRY(request.settings.regions.tile_cells, tile_cells_of(tile_size_of(d), labels->voxel_size()));
    }
    SR_TRY(request.objects, objects_of(d));
    request.store = d.cache ? Path(d.cache) : Path();
    request.host_bytes = d.host_bytes;
    request.splat_bytes = d.splat_bytes;
    request.tiles_at_once = d.tiles_at_once;
    if (splat_radius > 0)
        request.splats = {.sigma = float(splat_radius)};
    JobCallbacks callbacks;
    if (d.message)
        callbacks.warning = [message = d.message, user = d.user](std::string_view line) {
            message(user, std::string(line).c_str());
        };
    SR_TRY(world->world, open_world(*context.device, std::move(request), std::move(labels), callbacks));
    world->objects = by_id(world->world->objects());
    return world;
}

// calls f with the world; an error is its context's
template <Use use, typename F>
sr_status with_world(sr_world* world, const char* name, F f) noexcept
{
    return guarded<use>(world ? world->context : nullptr, [&]() -> Status {
        if (!world)
            return fail(ErrorCode::usage, "{}: world is NULL", name);
        return f();
    });
}

Status post_foci(sr_world& world, std::span<const sr_focus> given)
{
    WorldFoci foci;
    for (const sr_focus& one : given) {
        WorldFocus& focus = foci.emplace_back();
        std::ranges::copy(one.position, focus.position.begin());
        std::ranges::copy(one.direction, focus.direction.begin());
        focus.radius = one.radius;
    }
    SR_CHECK(check_foci(foci, world.world->voxel_size()));
    const std::lock_guard lock(world.post);
    world.foci = std::move(foci);
    return {};
}

sr_world_info info_of(const sr_world& world)
{
    const WorldFigures f = world.world->figures();
    const SplatPool* splats = world.world->splats();
    sr_world_info info{};
    info.full = f.full;
    info.wanted = f.wanted;
    info.finished = f.finished;
    info.in_memory = f.in_memory;
    info.host_bytes = f.host_bytes;
    info.generated = f.generated;
    info.loaded = f.loaded;
    info.dropped = f.dropped;
    info.splats = splats ? splats->splats() : 0;
    info.voxel_size = decimal_voxel_size(world.world->voxel_size());
    info.tile_cells = uint32_t(world.world->tile_cells());
    info.points_per_voxel = uint32_t(world.world->points_per_voxel());
    return info;
}

void keep_info(sr_world& world)
{
    const sr_world_info info = info_of(world);
    const std::lock_guard lock(world.post);
    world.info = info;
}

} // namespace

extern "C" {

sr_status sr_read_objects(const char* path, sr_object* objects, uint64_t* count)
{
    return guarded(nullptr, [&]() -> Status {
        if (!path || !count)
            return fail(ErrorCode::usage, "sr_read_objects: NULL");
        SR_TRY(const std::vector<SceneObject> all, read_objects(path));
        const uint64_t room = std::exchange(*count, all.size());
        if (!objects)
            return {};
        *count = std::min<uint64_t>(room, all.size());
        std::transform(all.begin(), all.begin() + ptrdiff_t(*count), objects, described);
        if (*count < all.size())
            return fail(ErrorCode::partial, "sr_read_objects: {} objects, room for {}", all.size(), room);
        return {};
    });
}

sr_status sr_world_create(sr_context* context, const sr_world_desc* desc, sr_world** world)
{
    return guarded<kWork>(context, [&]() -> Status {
        if (!context || !world)
            return fail(ErrorCode::usage, "sr_world_create: NULL");
        *world = nullptr;
        SR_TRY(const sr_world_desc known, read_struct(desc, "sr_world_desc"));
        SR_TRY(auto made, make_world(*context, known));
        *world = made.release();
        return {};
    });
}

void sr_world_destroy(sr_world* world)
{
    destroy(world);
}

sr_status sr_world_focus(sr_world* world, const double position[3], const double direction[3], double radius)
{
    return with_world<kAnyTime>(world, "sr_world_focus", [&]() -> Status {
        if (!position || !direction)
            return fail(ErrorCode::usage, "sr_world_focus: NULL");
        sr_focus one{{}, {}, radius};
        std::copy_n(position, 3, one.position);
        std::copy_n(direction, 3, one.direction);
        return post_foci(*world, {&one, 1});
    });
}

sr_status sr_world_foci(sr_world* world, const sr_focus* foci, uint32_t count)
{
    return with_world<kAnyTime>(world, "sr_world_foci", [&]() -> Status {
        if (!foci && count)
            return fail(ErrorCode::usage, "sr_world_foci: foci is NULL");
        return post_foci(*world, {foci, count});
    });
}

sr_status sr_world_step(sr_world* world, uint64_t budget_us, uint32_t* done)
{
    return with_world<kWork>(world, "sr_world_step", [&]() -> Status {
        const std::lock_guard lock(world->work);
        SR_CHECK(take_posts(*world));
        const Result<bool> all = world->world->step(timed_budget(budget_us));
        keep_info(*world);
        if (!all)
            return tl::make_unexpected(all.error());
        if (done)
            *done = *all;
        return {};
    });
}

sr_status sr_world_edit(sr_world* world, const sr_cell* cells, uint64_t count)
{
    return with_world<kAnyTime>(world, "sr_world_edit", [&]() -> Status {
        SR_TRY(const LabelEdits edits, edits_of(cells, count, "sr_world_edit"));
        SR_CHECK(world->world->check_edits(edits));
        const std::lock_guard lock(world->post);
        for (const auto& [cell, label] : edits)
            world->edits.insert_or_assign(cell, label);
        return {};
    });
}

sr_status sr_world_labels_ready(sr_world* world, const sr_cell_rect* window)
{
    return with_world<kAnyTime>(world, "sr_world_labels_ready", [&]() -> Status {
        if (!window)
            return fail(ErrorCode::usage, "sr_world_labels_ready: NULL");
        const std::lock_guard lock(world->post);
        world->labels_ready.push_back({{window->low[0], window->low[1]}, {window->high[0], window->high[1]}});
        return {};
    });
}

sr_status sr_world_get_info(sr_world* world, sr_world_info* info)
{
    return with_world<kAnyTime>(world, "sr_world_get_info", [&]() -> Status {
        if (const std::unique_lock lock(world->work, std::try_to_lock); lock) {
            SR_CHECK(take_posts(*world));
            keep_info(*world);
        }
        const std::lock_guard lock(world->post);
        return write_result(world->info, info, "sr_world_get_info");
    });
}

sr_status sr_world_copy_cells(sr_world* world, const sr_cell_rect* window, sr_grid** grid)
{
    return with_world<kAnyTime>(world, "sr_world_copy_cells", [&]() -> Status {
        if (!window || !grid)
            return fail(ErrorCode::usage, "sr_world_copy_cells: NULL");
        *grid = nullptr;
        const std::lock_guard lock(world->work);
        SR_CHECK(take_posts(*world));
        const CellWindow asked{{window->low[0], window->low[1]}, {window->high[0], window->high[1]}};
        *grid = new sr_grid{world->world->cells(asked), {}};
        return {};
    });
}

sr_status sr_world_flush(sr_world* world)
{
    return with_world<kWork>(world, "sr_world_flush", [&]() -> Status {
        const std::lock_guard lock(world->work);
        return world->world->flush();
    });
}

} // extern "C"

static_assert(sizeof(sr_world_desc) == 160 && sizeof(sr_generation) == 64 && sizeof(sr_object) == 88 &&
              sizeof(sr_focus) == 56 && sizeof(sr_world_info) == 88);
