// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/growth.h"

#include "engine/format/camera_path.h"
#include "engine/job/outputs.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

namespace fs = std::filesystem;

Status check(const GrowthRequest& r, bool writes)
{
    if (r.generation.first_cell != 0 || r.generation.strategy || r.generation.tile_size != 0)
        return fail(ErrorCode::usage, "--first-cell, --strategy and --order have no meaning with --along");
    if (!(r.horizon > 0 && r.horizon <= 1000))
        return fail(ErrorCode::usage, "--horizon: expected metres above 0 and up to 1000, found {}", r.horizon);
    if (!(r.window > 0 && r.window <= 1000))
        return fail(ErrorCode::usage, "--window: expected metres above 0 and up to 1000, found {}", r.window);
    if (!writes)
        return {};
    // of a finished run, the settings say whether it is this one
    if (TileFolder::is_one(r.output) && !r.replace && !finished_results(r.output.string() + ".run", Json()))
        return fail(ErrorCode::usage, "'{}' exists; -y replaces it", r.output.string());
    if (fs::exists(r.output) && !fs::is_directory(r.output))
        return fail(ErrorCode::bad_input, "{} is a file; --along writes a folder of tiles", quote(r.output.string()));
    return {};
}

Result<std::vector<SceneObject>> objects_of(const GrowthRequest& r, const VoxfieldModel& model)
{
    if (r.objects || model.config.condition.empty() || fs::is_directory(r.scaffold))
        return told_objects(model, r.objects ? r.objects : GivenObjects(std::in_place), {}, r.seed);
    SR_TRY(const VoxelGrid grid, read_grid(r.scaffold));
    return told_objects(model, {}, grid, r.seed);
}

} // namespace

Result<GrowthPlan> plan_growth(const GrowthRequest& r, bool writes)
{
    SR_CHECK(check(r, writes));
    SR_TRY(GenerationSettings settings, resolve_generation(r.generation));
    PathLens lens(pinhole_from_fov(73, 616, 424));
    lens.matters = false; // where the camera is
    SR_TRY(const CameraPath path, read_camera_path(r.path, lens, r.placement));
    SR_TRY(PathWindows windows, PathWindows::cut(path, r.window));
    SR_TRY(const int32_t edge, tile_cells_of(r.tile_size, settings.model.config.voxel_size));
    SR_TRY(TileSource source, TileSource::open(r.scaffold, edge));
    SR_TRY(std::vector<SceneObject> objects, objects_of(r, settings.model));
    return GrowthPlan{r, std::move(settings), std::move(windows), std::move(source), std::move(objects)};
}

} // namespace semrover
