// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/street.h"

#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/view/gpu.h"

#include <cmath>
#include <limits>

namespace semrover::view {

namespace {

struct GridDeleter {
    void operator()(sr_grid* grid) const { sr_grid_destroy(grid); }
};
using Grid = std::unique_ptr<sr_grid, GridDeleter>;

Status grid_call(sr_status status)
{
    return checked(status, static_cast<const sr_context*>(nullptr));
}

Result<Grid> read_grid(const Path& path)
{
    sr_grid* grid = nullptr;
    SR_CHECK(grid_call(sr_grid_read(path.c_str(), &grid)));
    return Grid(grid);
}

Result<sr_grid_info> info_of(const sr_grid* grid)
{
    sr_grid_info info{};
    info.struct_size = sizeof info;
    SR_CHECK(grid_call(sr_grid_get_info(grid, &info)));
    return info;
}

Result<std::vector<sr_cell>> cells_of(const sr_grid* grid)
{
    SR_TRY(const sr_grid_info info, info_of(grid));
    std::vector<sr_cell> cells(info.cells);
    uint64_t written = 0;
    SR_CHECK(grid_call(sr_grid_get_cells(grid, 0, cells.size(), cells.data(), &written)));
    return cells;
}

// a road's voxel near the middle of all of them, or any voxel
sr_cell middle_of(const std::vector<sr_cell>& cells)
{
    constexpr uint32_t kRoad = 0;
    std::array<double, 2> mean{};
    for (const sr_cell& c : cells) {
        mean[0] += double(c.i) / double(cells.size());
        mean[1] += double(c.j) / double(cells.size());
    }
    sr_cell best{};
    double least = std::numeric_limits<double>::infinity();
    for (const sr_cell& c : cells) {
        const double away = std::hypot(c.i - mean[0], c.j - mean[1]) + (c.label == kRoad ? 0 : 1e6);
        if (away < least)
            best = c;
        least = std::min(least, away);
    }
    return best;
}

Result<Camera> start_over(const sr_grid* grid)
{
    SR_TRY(const sr_grid_info info, info_of(grid));
    SR_TRY(const std::vector<sr_cell> cells, cells_of(grid));
    if (cells.empty())
        return fail(ErrorCode::bad_input, "a grid without voxels");
    const sr_cell at = middle_of(cells);
    Camera camera;
    camera.position = {(at.i + 0.5) * info.voxel_size, (at.j + 0.5) * info.voxel_size, at.k * info.voxel_size + 1.9};
    camera.pitch = -0.08;
    return camera;
}

// the first tile that the index of a folder names (docs/formats.md §2.2)
Result<Path> a_tile_of(const Path& folder)
{
    SR_TRY(const Json index, read_json(folder / "index.json"));
    const Json tiles = index.is_object() ? index.value("tiles", Json()) : Json();
    if (!tiles.is_array() || tiles.empty() || !tiles[0].is_array() || tiles[0].size() < 2 ||
        !tiles[0][0].is_number_integer() || !tiles[0][1].is_number_integer())
        return fail(ErrorCode::bad_input, "{}: no tiles", quote_path(folder / "index.json"));
    return folder / fmt::format("tile_{}_{}.sgrid", tiles[0][0].get<int>(), tiles[0][1].get<int>());
}

} // namespace

// none without a path
Result<std::vector<sr_object>> read_objects(const std::string& path)
{
    std::vector<sr_object> objects;
    uint64_t count = 0;
    if (path.empty())
        return objects;
    SR_CHECK(grid_call(sr_read_objects(path.c_str(), nullptr, &count)));
    objects.resize(count);
    SR_CHECK(grid_call(sr_read_objects(path.c_str(), objects.data(), &count)));
    return objects;
}

Result<sr_model*> load_model(sr_context* context, const std::string& folder, uint32_t part)
{
    sr_model_desc desc{};
    desc.struct_size = sizeof desc;
    desc.path = folder.c_str();
    desc.parts = part;
    sr_model* model = nullptr;
    SR_CHECK(checked(sr_model_load(context, &desc, &model), context));
    return model;
}

Result<std::unique_ptr<Street>> Street::open(sr_context* context, const StreetRequest& request)
{
    std::unique_ptr<Street> street(new Street(context));
    street->radius = request.radius;
    SR_CHECK(street->create(request));
    return street;
}

Street::~Street()
{
    sr_world_destroy(world_);
}

Status Street::create(const StreetRequest& r)
{
    const bool tiles = is_folder(r.grid);
    Path looked_at = r.grid;
    if (tiles) {
        SR_TRY(looked_at, a_tile_of(r.grid));
    }
    SR_TRY(const Grid grid, read_grid(looked_at));
    SR_TRY(start_, start_over(grid.get()));
    SR_TRY(const sr_grid_info info, info_of(grid.get()));
    if (info.points_per_voxel && r.warning)
        r.warning("the points of " + quote_path(r.grid) + " are not shown: a world generates its own");

    SR_TRY(sr_model* const model, load_model(context_, r.model, SR_MODEL_VOXFIELD));
    sr_world_desc desc{};
    desc.struct_size = sizeof desc;
    desc.model = model;
    desc.steps = r.steps;
    desc.grid = tiles ? nullptr : grid.get();
    desc.folder = tiles ? r.grid.c_str() : nullptr;
    desc.message = [](void* user, const char* line) {
        if (const auto& warning = *static_cast<const std::function<void(const std::string&)>*>(user))
            warning(line);
    };
    desc.user = const_cast<std::function<void(const std::string&)>*>(&r.warning);
    desc.cache = r.cache.empty() ? nullptr : r.cache.c_str();
    SR_TRY(const std::vector<sr_object> objects, read_objects(r.objects));
    desc.conditioning = objects.empty() ? SR_CONDITIONING_GUESSED : SR_CONDITIONING_GIVEN;
    desc.objects = objects.empty() ? nullptr : objects.data();
    desc.object_count = objects.size();
    desc.seed = r.seed;
    desc.host_bytes = r.host_bytes;
    desc.splat_bytes = r.splat_bytes;
    desc.splat_radius = r.splat_radius;
    desc.detail_distance = r.detail_distance;
    const Status created = checked(sr_world_create(context_, &desc, &world_), context_);
    sr_model_destroy(model); // the world has it, too
    return created;
}

Status Street::focus(const Camera& camera)
{
    return checked(sr_world_focus(world_, camera.position.data(), camera.forward().data(), radius), context_);
}

Result<bool> Street::step(uint64_t budget_us)
{
    uint32_t done = 0;
    SR_CHECK(checked(sr_world_step(world_, budget_us, &done), context_));
    return done != 0;
}

Result<sr_world_info> Street::info() const
{
    sr_world_info info{};
    info.struct_size = sizeof info;
    SR_CHECK(checked(sr_world_get_info(world_, &info), context_));
    return info;
}

Result<std::vector<PlacedCell>> Street::cells(const sr_cell_rect& window) const
{
    sr_grid* copy = nullptr;
    SR_CHECK(checked(sr_world_copy_cells(world_, &window, &copy), context_));
    const Grid grid(copy);
    SR_TRY(const std::vector<sr_cell> found, cells_of(grid.get()));
    SR_TRY(const sr_grid_info info, info_of(grid.get()));
    std::vector<std::array<float, 6>> points(found.size() * info.points_per_voxel);
    uint64_t written = 0;
    if (!points.empty())
        SR_CHECK(grid_call(sr_grid_get_points(grid.get(), 0, found.size(), points.data()->data(), &written)));
    std::vector<PlacedCell> cells;
    for (size_t c = 0; c < found.size(); ++c) {
        const auto first = points.begin() + ptrdiff_t(c * info.points_per_voxel);
        cells.push_back({found[c], {first, first + info.points_per_voxel}});
    }
    return cells;
}

Status Street::edit(const std::vector<sr_cell>& cells)
{
    return checked(sr_world_edit(world_, cells.data(), cells.size()), context_);
}

Status Street::save(const Path& path) const
{
    const sr_cell_rect all = {{-(1 << 20), -(1 << 20)}, {1 << 20, 1 << 20}};
    sr_grid* copy = nullptr;
    SR_CHECK(checked(sr_world_copy_cells(world_, &all, &copy), context_));
    const Grid grid(copy);
    return grid_call(sr_grid_write(grid.get(), path.c_str()));
}

} // namespace semrover::view
