// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/generate_runs.h"

#include "engine/format/ply.h"
#include "engine/job/input_hashes.h"
#include "engine/job/outputs.h"
#include "engine/job/version.h"
#include "engine/splat/splat_scene.h"
#include "runtime/base/final_name.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "runtime/system/process.h"
#include "tools/cli/open_device.h"
#include "tools/cli/option_facts.h"
#include "tools/cli/session.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/path_format.h"

#include <algorithm>
#include <chrono>

namespace semrover {

Status export_ply(Device& device, const VoxelGrid& grid, const PlyExports& exports)
{
    SR_TRY(const SplatScene scene, SplatScene::create(device, points_of(grid)));
    SR_TRY(const Splats s, scene.read());
    if (!exports.points.empty())
        SR_CHECK(write_points_ply(exports.points, s));
    if (!exports.splats_3d.empty())
        SR_CHECK(write_splats_ply(exports.splats_3d, s, SplatPly::gaussian_3d));
    if (!exports.splats_2d.empty())
        SR_CHECK(write_splats_ply(exports.splats_2d, s, SplatPly::gaussian_2d));
    return {};
}

namespace {

namespace fs = std::filesystem;

double seconds_now()
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Result<uint64_t> hash_input(const Path& path)
{
    return is_folder(path) ? hash_folder(path) : hash_file(path);
}

} // namespace

Status GenerateRun::end()
{
    if (o_.generation.dry_run)
        return {};
    if (!finished_) {
        SR_TRY(const Json results, write());
        SR_CHECK(run_->finish(results));
        finished_ = results;
    }
    SR_CHECK(write_profile(*device_, o_.generation.profile, globals_));
    print_results(*finished_, globals_);
    return {};
}

std::vector<Path> GridRun::written_files(bool with_objects) const
{
    std::vector<Path> files = {o_.output};
    if (with_objects)
        files.push_back(objects_beside(o_.output));
    for (const std::string& path : {o_.ply.points, o_.ply.splats_3d, o_.ply.splats_2d})
        if (!path.empty())
            files.emplace_back(path);
    return files;
}

Status GridRun::check_outputs(bool replace) const
{
    for (const Path& path : written_files(!generation_.model.config.condition.empty()))
        SR_CHECK(check_writable(path, replace));
    return {};
}

Result<bool> GridRun::begin()
{
    const bool dry_run = o_.generation.dry_run;
    if (o_.output.empty() && !dry_run)
        return fail(ErrorCode::usage, "-o/--output is required");
    if (o_.order == "scene" && o_.tile_size)
        return fail(ErrorCode::usage, "--tile-size has a meaning with --order tiles and --along");
    SR_CHECK(refuse_given(*o_.input.command, placement_options(), "a grid without --along"));
    if (!dry_run && !is_there(folder() / "run.json")) // that one may be the same
        SR_CHECK(check_outputs(globals_.yes));
    SR_CHECK(read());
    SR_TRY(device_, open_device(globals_, o_.generation.profile));
    SR_CHECK(look());
    if (!dry_run && finished_before())
        return true;
    if (!dry_run)
        SR_CHECK(check_outputs(globals_.yes || goes_on(folder(), settings_)));
    warn_of_placement(generation_.model, grid_, display_.callbacks());
    SR_CHECK(open_world_in_run());
    if (!dry_run)
        return false;
    SR_TRY(const Json expected, world_->estimate());
    print_estimate(expected, globals_);
    return true;
}

Status GridRun::read()
{
    GenerationOptions options = o_.generation.options;
    if (o_.order == "tiles")
        options.tile_size = o_.tile_size.value_or(kUsualTileSize);
    SR_TRY(generation_, resolve_generation(options));
    SR_TRY(objects_, given_objects(o_.objects));
    SR_TRY(grid_, load_grid(o_.grid, o_.input, globals_));
    // what another program's file became depends on options and on other files
    const bool is_ours = o_.input.from.empty() && Path(o_.grid).extension() == ".sgrid";
    grid_hash_ = is_ours ? 0 : hash_grid(grid_);
    if (is_ours) {
        SR_TRY(grid_hash_, hash_file(o_.grid));
    }
    return {};
}

// at what decides the bytes
Status GridRun::look()
{
    const bool by_blocks = generation_.regions.tile_cells > 0;
    SR_TRY(objects_, conditioning_objects(generation_.model, objects_, grid_, o_.seed, by_blocks));
    SR_TRY(settings_, settings_json(generation_, *device_, "generate", grid_hash_));
    settings_["seed"] = o_.seed;
    if (!objects_->empty())
        settings_["objects"] = hash_text(hash_objects(*objects_));
    return {};
}

// the same was generated before, and what it wrote is there
bool GridRun::finished_before()
{
    if (globals_.yes)
        return false;
    finished_ = finished_results(folder(), settings_, o_.output);
    for (const Path& path : written_files(!objects_->empty()))
        if (!is_written(path))
            finished_.reset();
    return finished_.has_value();
}

// regions are kept in the run's folder, or tiles
Status GridRun::open_world_in_run()
{
    const bool by_tiles = generation_.regions.tile_cells > 0;
    WorldRequest request{.settings = generation_, .seed = o_.seed, .objects = objects_};
    request.tiles_at_once = o_.generation.options.batch;
    if (globals_.session) {
        SR_TRY(request.transformer, globals_.session->transformer(o_.generation.options.model, generation_.precision));
    }
    if (!o_.generation.dry_run) {
        SR_TRY(RunFolder run, open_run(folder(), settings_, globals_.yes, {{"regions", "tiles"}}));
        run_.emplace(std::move(run));
        if (by_tiles)
            request.store = folder() / "tiles";
    }
    auto metadata = grid_.metadata;
    auto world =
        open_world(*device_, std::move(request), labels_of_grid(std::exchange(grid_, {})), display_.callbacks());
    if (!world && run_)
        run_->drop_if_empty();
    SR_TRY(world_, std::move(world));
    grid_.metadata = std::move(metadata);
    if (by_tiles && run_ && !run_->resumed())
        SR_CHECK(run_->append({{"order", "tiles"}}));
    if (by_tiles || run_)
        SR_CHECK(world_->everywhere(run_ ? &*run_ : nullptr));
    if (run_)
        keep_in(folder());
    begun_ = seconds_now();
    return {};
}

VoxelGrid GridRun::filled() const
{
    constexpr CellWindow kAll{{-kMaxCoordinate, -kMaxCoordinate}, {kMaxCoordinate, kMaxCoordinate}};
    VoxelGrid grid = world_->tile_cells() ? world_->cells(kAll) : world_->scene();
    grid.metadata = grid_.metadata;
    grid.metadata["seed"] = std::to_string(o_.seed);
    grid.metadata["tool"] = kProgram;
    grid.metadata["model"] = settings_["model"];
    if (const std::string& placement = generation_.model.config.placement; placement != "shifted")
        grid.metadata["placement"] = placement;
    if (const int32_t edge = world_->tile_cells())
        grid.metadata["tile_cells"] = std::to_string(edge);
    return grid;
}

Result<Json> GridRun::write()
{
    const VoxelGrid grid = filled();
    if (o_.ply.any())
        SR_CHECK(export_ply(*device_, grid, o_.ply));
    Json results = world_->results();
    results.emplace("seconds", seconds_now() - begun_);
    SR_CHECK(write_grid(o_.output, grid));
    if (!objects_->empty())
        SR_CHECK(write_objects(objects_beside(o_.output), *objects_));
    SR_TRY(const uint64_t hash, hash_file(o_.output));
    results["output"] = Path(o_.output).filename().string();
    results["xxh64"] = hash_text(hash);
    (void)world_->flush(); // the grid has them: no matter if the store has not
    return results;
}

Status TilesRun::check() const
{
    if (o_.output.empty() && !o_.generation.dry_run)
        return fail(ErrorCode::usage, "-o/--output is required");
    if (o_.ply.any())
        return fail(ErrorCode::usage, "--ply and its like have no meaning with --along: convert what it writes");
    if (is_given(*o_.input.command, "--order"))
        return fail(ErrorCode::usage, "--order has no meaning with --along, which is in the order of tiles");
    for (const std::string_view& name : scene_input_options())
        if (name != "--origin") // the path's: the scaffold has its place
            SR_CHECK(refuse_given(*o_.input.command, {&name, 1}, "--along, whose scaffold is a grid of ours"));
    if (o_.generation.dry_run)
        return {};
    // of a run, the settings say whether it is this one
    SR_TRY(const bool there, has_folder(o_.output));
    if (there && TileFolder::is_one(o_.output) && !is_there(folder() / "run.json"))
        return refuse_existing(o_.output, globals_.yes);
    return {};
}

Status TilesRun::read()
{
    GenerationOptions options = o_.generation.options;
    options.tile_size = o_.tile_size.value_or(kUsualTileSize);
    SR_TRY(generation_, resolve_generation(options));
    SR_TRY(objects_, given_objects(o_.objects));
    PathOptions placement = o_.placement;
    if (placement.origin.empty())
        placement.origin = o_.input.origin;
    SR_TRY(placement_, placement_of(placement));
    PathLens lens(pinhole_from_fov(73, 616, 424));
    lens.matters = false; // where the camera is
    SR_TRY(const CameraPath path, read_camera_path(o_.along, lens, placement_));
    track_ = ground_track(path);
    if (is_folder(o_.grid)) {
        SR_TRY(const TileFolder tiles, TileFolder::open(o_.grid));
        metadata_ = tiles.metadata();
        SR_TRY(labels_, labels_of_folder(o_.grid));
        return {};
    }
    SR_TRY(VoxelGrid grid, read_grid(o_.grid));
    metadata_ = grid.metadata;
    labels_ = labels_of_grid(std::move(grid));
    return {};
}

Result<Json> TilesRun::settings() const
{
    SR_TRY(const uint64_t grid, hash_input(o_.grid));
    SR_TRY(Json settings, settings_json(generation_, *device_, "generate --along", grid));
    SR_TRY(const std::optional<FoundPath> found, find_path(o_.along)); // read() has read it
    SR_TRY(const uint64_t path, hash_input(found.value().path));
    settings["seed"] = o_.seed;
    settings["path"] = hash_text(path);
    if (const PathPlacement& p = placement_;
        p.relative_to || p.lidar_to_camera || p.world != kIdentity || p.origin != Point3{})
        settings["path_placement"] = {{"relative_to", p.relative_to ? Json(*p.relative_to) : Json()},
                                      {"lidar_to_camera", p.lidar_to_camera ? Json(*p.lidar_to_camera) : Json()},
                                      {"world", p.world},
                                      {"origin", p.origin}};
    settings["horizon"] = o_.horizon;
    if (objects_)
        settings["objects"] = hash_text(hash_objects(*objects_));
    return settings;
}

// each tile that the index names is there, as it was written
bool TilesRun::is_whole() const
{
    const auto tiles = TileFolder::open(o_.output);
    return tiles &&
           std::ranges::all_of(tiles->tiles(), [&](const auto& entry) { return tiles->read(entry.first).has_value(); });
}

// removes the tiles in the output but those that are named
void TilesRun::remove_tiles_but(const std::set<std::string>& names) const
{
    std::error_code ignored;
    for (const Path& path : list_files(o_.output).value_or(std::vector<Path>())) {
        const std::string name = path.filename().string();
        if (!names.contains(name) && name.starts_with("tile_") && name.ends_with(".sgrid"))
            fs::remove(path, ignored);
    }
}

// a run that begins finds no tiles of another
Status TilesRun::clear_output() const
{
    SR_CHECK(make_folder(o_.output));
    std::error_code error;
    const bool empty = fs::is_empty(o_.output, error);
    if (!globals_.yes && !empty && !error)
        return fail(ErrorCode::usage, "{} is not empty; -y replaces the tiles in it", quote(o_.output));
    if (!error)
        fs::remove(Path(o_.output) / "index.json", error); // first: without it no tile is
    if (error)
        return fail(ErrorCode::bad_input, "cannot write to {}: {}", quote(o_.output), error.message());
    remove_tiles_but({});
    return {};
}

// nothing was generated: nothing is left behind
void TilesRun::remove_run()
{
    run_->drop_if_empty();
    std::error_code ignored;
    fs::remove(o_.output, ignored); // only when nothing is in it
}

Status TilesRun::open()
{
    WorldRequest request{.settings = generation_, .seed = o_.seed, .objects = objects_};
    request.tiles_at_once = o_.generation.options.batch;
    request.metadata = metadata_;
    request.metadata["seed"] = std::to_string(o_.seed);
    request.metadata["tool"] = kProgram;
    if (run_) {
        SR_CHECK(run_->resumed() ? Status() : clear_output());
        remove_temporary_files(o_.output);
        request.store = o_.output;
    }
    SR_TRY(world_, open_world(*device_, std::move(request), std::move(labels_), display_.callbacks()));
    SR_CHECK(world_->can_store());
    SR_CHECK(world_->follow(track_, o_.horizon));
    return run_ && !run_->resumed() ? run_->append({{"order", "tiles"}}) : Status();
}

Result<bool> TilesRun::begin()
{
    SR_CHECK(check());
    SR_CHECK(read());
    SR_TRY(device_, open_device(globals_, o_.generation.profile));
    if (o_.generation.dry_run) {
        SR_CHECK(open());
        SR_TRY(const Json expected, world_->estimate());
        print_estimate(expected, globals_);
        return true;
    }
    SR_TRY(const Json wanted, settings());
    SR_TRY(RunFolder run, open_run(folder(), wanted, globals_.yes, {{}}, true));
    run_.emplace(std::move(run));
    if (run_->results() && is_whole()) { // else what is not there is made again
        finished_ = run_->results();
        return true;
    }
    if (const Status opened = open(); !opened) {
        remove_run();
        return tl::make_unexpected(opened.error());
    }
    keep_in(o_.output);
    begun_ = seconds_now();
    return false;
}

Result<Json> TilesRun::write()
{
    Json results = world_->results();
    if (results["tiles"] == 0) {
        world_.reset();
        std::error_code ignored;
        fs::remove_all(folder(), ignored);
        fs::remove(o_.output, ignored); // empty
        return fail(ErrorCode::bad_input, "no voxel of {} lies within {} m of the path", quote(o_.grid), o_.horizon);
    }
    SR_CHECK(world_->flush());
    SR_TRY(const TileFolder tiles, TileFolder::open(o_.output));
    std::set<std::string> wanted; // and not what they see beside them: one that resumes need not have looked at it
    for (const auto& [index, entry] : tiles.tiles())
        wanted.insert(tile_name(index, entry.key));
    remove_tiles_but(wanted);
    results["tiles"] = tiles.tiles().size();
    results["cells"] = tiles.cell_count();
    results["metres"] = length_of(track_);
    results["seconds"] = seconds_now() - begun_;
    results["peak_host_bytes"] = system::host_memory().peak;
    return results;
}

} // namespace semrover
