// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/generate_along.h"

#include "engine/format/camera_path.h"
#include "engine/scene/cell_reach.h"
#include "engine/scene/path_windows.h"
#include "engine/scene/tile_cache.h"
#include "engine/voxfield/sub_grid.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"
#include "tools/cli/open_device.h"
#include "tools/cli/progress.h"
#include "tools/cli/version.h"
#include "tools/host_memory.h"

#include <algorithm>
#include <chrono>
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstring>
#include <ctime>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr int32_t kContextCells = 16; // known cells farther than this from what is new do not matter to a window
constexpr double kLegMetres = 100;    // of path, between two lines of figures

// a window's result on its way to the tiles
Path piece_path(const RunFolder& run, size_t window)
{
    return run.path() / "windows" / fmt::format("{:06}.safetensors", window);
}

Status save_piece(RunFolder& run, size_t window, const GrownCells& grown)
{
    std::error_code ignored;
    fs::create_directories(run.path() / "windows", ignored);
    const uint64_t v = grown.cells.size();
    const TensorData tensors[] = {
        {"cells", DType::i32, {v, 3}, std::as_bytes(std::span(grown.cells))},
        {"points", DType::f16, {grown.points.size()}, std::as_bytes(std::span(grown.points))},
        {"colors", DType::u8, {grown.colors.size()}, std::as_bytes(std::span(grown.colors))},
    };
    return write_safetensors(piece_path(run, window), tensors);
}

template <typename T>
Status copy_tensor(const Safetensors& file, const char* name, DType dtype, std::vector<T>& values)
{
    SR_TRY(const TensorInfo* info, file.get(name));
    if (info->dtype != dtype || info->bytes() % sizeof(T))
        return fail(ErrorCode::bad_input, "{}: {} has another type", quote_path(file.path()), name);
    values.resize(info->bytes() / sizeof(T));
    if (!values.empty())
        std::memcpy(values.data(), file.bytes(*info).data(), info->bytes());
    return {};
}

Result<GrownCells> load_piece(const Path& path, int points_per_voxel)
{
    SR_TRY(const Safetensors file, Safetensors::open(path));
    GrownCells grown;
    SR_CHECK(copy_tensor(file, "cells", DType::i32, grown.cells));
    SR_CHECK(copy_tensor(file, "points", DType::f16, grown.points));
    SR_CHECK(copy_tensor(file, "colors", DType::u8, grown.colors));
    if (grown.points.size() != grown.cells.size() * size_t(points_per_voxel) * 3 ||
        grown.colors.size() != grown.points.size())
        return fail(ErrorCode::bad_input, "{}: arrays disagree", quote_path(path));
    return grown;
}

GrownCells grown_cells(const SubGrid& part, std::span<const uint32_t> targets)
{
    GrownCells grown;
    const size_t width = size_t(part.grid.points_per_voxel) * 3;
    for (size_t i = 0; i < part.cells.size(); ++i) {
        if (!std::ranges::binary_search(targets, part.cells[i]))
            continue;
        const auto at = ptrdiff_t(i * width), end = ptrdiff_t((i + 1) * width);
        grown.cells.push_back(part.grid.cells[i]);
        grown.points.insert(grown.points.end(), part.grid.points.begin() + at, part.grid.points.begin() + end);
        grown.colors.insert(grown.colors.end(), part.grid.colors.begin() + at, part.grid.colors.begin() + end);
    }
    return grown;
}

// the target nearest to where the window begins: where the very first region grows
int64_t first_seed(const VoxelGrid& grid, const GroundPoint& start)
{
    const double edge = decimal_voxel_size(grid.voxel_size);
    int64_t best = 0;
    double nearest = 1e300;
    for (size_t c = 0; c < grid.cells.size(); ++c) {
        const double x = (grid.cells[c][0] + 0.5) * edge - start[0], y = (grid.cells[c][1] + 0.5) * edge - start[1];
        if (x * x + y * y < nearest) {
            nearest = x * x + y * y;
            best = int64_t(c);
        }
    }
    return best;
}

class AlongRun {
  public:
    AlongRun(const AlongFiles& files, const AlongOptions& along, const GenerationOptions& options,
             const Globals& globals)
        : files_(files), along_(along), options_(options), globals_(globals), generation_(options, globals)
    {
    }

    Status run();

  private:
    Status check() const;
    Status prepare();
    Result<Json> settings() const;
    Status clear_output() const;
    Status take_up(const RunFolder& run);
    Status begin_window(size_t window);
    Status load();
    Status grow(RunFolder& run, size_t window, Progress& progress);
    Status grow_all(RunFolder& run);
    void note_leg(size_t window);
    Status dry_run();
    Status finish(RunFolder& run);

    const AlongFiles& files_;
    const AlongOptions& along_;
    const GenerationOptions& options_;
    const Globals& globals_;
    Generation generation_;
    std::optional<PathWindows> windows_;
    std::optional<TileSource> source_;
    std::optional<TileCache> cache_;
    VoxelGrid around_;              // what is around the window at work
    std::vector<uint32_t> targets_; // of it
    SubGrid part_;                  // what the window needs of it
    size_t first_ = 0;              // window to go on with
    size_t cells_ = 0, regions_ = 0;
    uint64_t bound_ = 0; // device bytes that no window exceeds
    double begun_ = 0, leg_begun_ = 0, leg_cpu_ = 0;
    Json legs_ = Json::array();
};

double seconds_now()
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Status AlongRun::check() const
{
    if (files_.output.empty() && !options_.dry_run)
        return fail(ErrorCode::usage, "-o/--output is required");
    if (options_.first_cell != 0 || options_.strategy != "complete")
        return fail(ErrorCode::usage, "--first-cell and --strategy have no meaning with --along");
    if (!(along_.horizon > 0 && along_.horizon <= 1000))
        return fail(ErrorCode::usage, "--horizon: expected metres above 0 and up to 1000, found {}", along_.horizon);
    if (!(along_.window > 0 && along_.window <= 1000))
        return fail(ErrorCode::usage, "--window: expected metres above 0 and up to 1000, found {}", along_.window);
    if (options_.dry_run)
        return {};
    if (TileFolder::is_one(files_.output) && !globals_.yes)
        return fail(ErrorCode::usage, "'{}' exists; -y replaces it", files_.output);
    if (fs::exists(files_.output) && !fs::is_directory(files_.output))
        return fail(ErrorCode::bad_input, "{} is a file; --along writes a folder of tiles", quote(files_.output));
    return {};
}

Status AlongRun::prepare()
{
    SR_CHECK(generation_.resolve());
    SR_TRY(const CameraPath path, read_camera_path(along_.path, pinhole_from_fov(73, 616, 424)));
    SR_TRY(windows_, PathWindows::cut(path, along_.window));
    SR_TRY(const int32_t edge, tile_cells_of(along_.tile_size, generation_.settings().model.config.voxel_size));
    SR_TRY(source_, TileSource::open(files_.scaffold, edge));
    cache_.emplace(*source_, files_.output, int(generation_.settings().model.config.points_per_voxel));
    return generation_.open();
}

Result<Json> AlongRun::settings() const
{
    const Path scaffold = files_.scaffold;
    SR_TRY(const uint64_t grid, fs::is_directory(scaffold) ? hash_folder(scaffold) : hash_file(scaffold));
    SR_TRY(Json settings, generation_.settings_json("generate --along", grid));
    SR_TRY(const uint64_t path, hash_file(along_.path));
    settings["seed"] = files_.seed;
    settings["path"] = hash_text(path);
    settings["horizon"] = along_.horizon;
    settings["window"] = along_.window;
    settings["tile_cells"] = source_->tile_cells();
    return settings;
}

// a run that begins finds no tiles of another
Status AlongRun::clear_output() const
{
    SR_CHECK(make_folder(files_.output));
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(files_.output, error)) {
        if (!globals_.yes)
            return fail(ErrorCode::usage, "'{}' is not empty; -y replaces the tiles in it", files_.output);
        const std::string name = entry.path().filename().string();
        if (name == "index.json" || (name.starts_with("tile_") && name.ends_with(".sgrid")))
            fs::remove(entry.path(), error);
    }
    return {};
}

// what a killed process was writing
void remove_temporaries(const Path& folder)
{
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder, ignored)) {
        const std::string name = entry.path().filename().string();
        if (name.starts_with(".semrover-") && name.ends_with(".tmp"))
            fs::remove(entry.path(), ignored);
    }
}

// windows that are in the journal are done; the last one's tiles may not have been written
Status AlongRun::take_up(const RunFolder& run)
{
    Json last;
    for (const Json& entry : run.entries()) {
        if (!entry.is_object() || entry.value("window", Json()) != Json(first_))
            return fail(ErrorCode::bad_input, "the journal in {} is damaged; -y starts over", quote_path(run.path()));
        ++first_;
        cells_ += entry.value("cells", size_t(0));
        regions_ += entry.value("regions", size_t(0));
        last = entry;
    }
    if (first_ == 0)
        return clear_output();
    remove_temporaries(files_.output);
    const Path piece = piece_path(run, first_ - 1);
    if (!fs::exists(piece))
        return {}; // it goes when the tiles are written
    SR_TRY(const uint64_t hash, hash_file(piece));
    if (hash_text(hash) != last.value("xxh64", ""))
        return fail(ErrorCode::bad_input, "{} is damaged; -y starts over", quote_path(piece));
    SR_TRY(const GrownCells grown, load_piece(piece, int(generation_.settings().model.config.points_per_voxel)));
    SR_CHECK(cache_->bring(grown.cells));
    return cache_->store(grown);
}

Status AlongRun::begin_window(size_t window)
{
    const std::vector<GroundPoint> piece = windows_->piece(window);
    const double margin = along_.horizon + kContextCells * decimal_voxel_size(source_->voxel_size());
    SR_TRY(around_, cache_->window(window_around(piece, margin, source_->voxel_size())));
    targets_ = cells_to_grow(around_, piece, along_.horizon);
    if (targets_.empty())
        return {};
    RegionOptions regions = generation_.settings().regions;
    SR_TRY(part_, cut_sub_grid(around_, targets_, regions.region_size));
    regions.from_known = true;
    regions.first_seed = first_seed(part_.grid, piece.front());
    return generation_.begin(part_.grid, regions);
}

Status AlongRun::load()
{
    SR_CHECK(generation_.load(files_.seed));
    if (bound_)
        return {};
    SR_TRY(bound_, generation_.bound_bytes());
    return {};
}

Status AlongRun::grow(RunFolder& run, size_t window, Progress& progress)
{
    SR_CHECK(begin_window(window));
    if (targets_.empty())
        return run.append({{"window", window}, {"cells", 0}, {"regions", 0}});
    SR_CHECK(load());
    const Status filled = generation_.fill([&](size_t) {
        progress.update(window, generation_.device().allocated_bytes());
        return !interrupt_requested();
    });
    if (!filled && filled.error().code == ErrorCode::interrupted)
        return fail(ErrorCode::interrupted, "interrupted; what is done is in '{}', the same command goes on",
                    files_.output);
    SR_CHECK(filled);
    const GrownCells grown = grown_cells(part_, targets_);
    const size_t regions = generation_.outpainter().region_count();
    SR_CHECK(save_piece(run, window, grown));
    SR_TRY(const uint64_t hash, hash_file(piece_path(run, window)));
    SR_CHECK(run.append(
        {{"window", window}, {"cells", grown.cells.size()}, {"regions", regions}, {"xxh64", hash_text(hash)}}));
    SR_CHECK(cache_->store(grown));
    std::error_code ignored;
    fs::remove(piece_path(run, window), ignored);
    cells_ += grown.cells.size();
    regions_ += regions;
    return {};
}

// figures of each hundred metres, and of the rest
void AlongRun::note_leg(size_t window)
{
    const bool last = window + 1 == windows_->count();
    const double end = windows_->end(window);
    if (!last && std::floor(end / kLegMetres) == std::floor(windows_->begin(window) / kLegMetres))
        return;
    const double now = seconds_now();
    const double cpu = double(std::clock()) / CLOCKS_PER_SEC; // of all threads: what other programs do not change
    const HostMemory host = host_memory();
    const Json leg{{"metres", end},
                   {"seconds", now - leg_begun_},
                   {"cpu_seconds", cpu - leg_cpu_},
                   {"cells", cells_},
                   {"regions", regions_},
                   {"cells_in_memory", cache_->cells_in_memory()},
                   {"peak_device_bytes", generation_.device().peak_bytes()},
                   {"host_bytes", host.resident},
                   {"peak_host_bytes", host.peak}};
    legs_.push_back(leg);
    leg_begun_ = now;
    leg_cpu_ = cpu;
    if (globals_.verbose && !globals_.quiet)
        fmt::print(stderr, "{:6.0f} m {:8.1f} s, {} cells so far, device {} at most, host {} ({} at most)\n", end,
                   double(leg["seconds"]), cells_, bytes_text(generation_.device().peak_bytes()),
                   bytes_text(host.resident), bytes_text(host.peak));
}

// the windows are walked through as if they had been filled
Status AlongRun::dry_run()
{
    for (size_t window = 0; window < windows_->count(); ++window) {
        SR_CHECK(begin_window(window));
        if (targets_.empty())
            continue;
        SR_CHECK(load());
        cells_ += targets_.size();
        regions_ += generation_.outpainter().region_count();
        SR_CHECK(cache_->mark(grown_cells(part_, targets_)));
    }
    const Json report{
        {"metres", windows_->length()}, {"windows", windows_->count()}, {"cells", cells_},
        {"regions", regions_},          {"peak_device_bytes", bound_},  {"device", generation_.device().name()}};
    if (globals_.json)
        fmt::print("{}\n", report.dump());
    else
        fmt::print("{:.0f} m in {} windows: {} cells in {} regions\npeak device memory {} at most\n",
                   windows_->length(), windows_->count(), cells_, regions_, bytes_text(bound_));
    return {};
}

Status AlongRun::finish(RunFolder& run)
{
    std::map<TileIndex, uint64_t> written;
    for (const TileIndex& tile : source_->all_tiles()) {
        const Path path = Path(files_.output) / tile_name(tile);
        if (!fs::exists(path))
            continue;
        SR_TRY(written[tile], cells_in_file(path));
    }
    if (written.empty()) {
        std::error_code ignored;
        fs::remove_all(run.path(), ignored);
        fs::remove(files_.output, ignored); // empty
        return fail(ErrorCode::bad_input, "no cell of {} lies within {} m of the path", quote(files_.scaffold),
                    along_.horizon);
    }
    TileFolderInfo info{source_->voxel_size(), source_->tile_cells(),
                        int(generation_.settings().model.config.points_per_voxel), true, source_->metadata()};
    info.metadata["seed"] = std::to_string(files_.seed);
    info.metadata["tool"] = kProgram;
    SR_CHECK(write_tile_index(files_.output, info, written));
    const Json results{{"metres", windows_->length()},
                       {"windows", windows_->count()},
                       {"tiles", written.size()},
                       {"cells", cells_},
                       {"regions", regions_},
                       {"seconds", seconds_now() - begun_},
                       {"planned_device_bytes", bound_},
                       {"peak_device_bytes", generation_.device().peak_bytes()},
                       {"peak_host_bytes", host_memory().peak},
                       {"legs", legs_}};
    SR_CHECK(run.finish(results));
    SR_CHECK(generation_.write_profile());
    if (globals_.json)
        fmt::print("{}\n", results.dump());
    return {};
}

Status AlongRun::run()
{
    SR_CHECK(check());
    SR_CHECK(prepare());
    if (options_.dry_run)
        return dry_run();
    SR_TRY(const Json wanted, settings());
    SR_TRY(RunFolder run, open_run(files_.output + ".run", wanted, globals_.yes, {{"windows"}, {}}));
    SR_CHECK(take_up(run));
    begun_ = leg_begun_ = seconds_now();
    leg_cpu_ = double(std::clock()) / CLOCKS_PER_SEC;
    if (const Status grown = grow_all(run); !grown) {
        run.drop_if_empty();
        std::error_code ignored;
        fs::remove(files_.output, ignored); // only when nothing is in it
        return grown;
    }
    return finish(run);
}

Status AlongRun::grow_all(RunFolder& run)
{
    Progress progress(progress_to_stderr(globals_), "generate", "windows", windows_->count(), first_);
    for (size_t window = first_; window < windows_->count(); ++window) {
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted; what is done is in '{}', the same command goes on",
                        files_.output);
        SR_CHECK(grow(run, window, progress));
        progress.update(window + 1, generation_.device().allocated_bytes());
        note_leg(window);
    }
    progress.finish();
    return {};
}

} // namespace

void add_along_options(CLI::App& c, AlongOptions& o)
{
    c.add_option("--along", o.path,
                 "camera path: grow the scaffold along it into a folder of tiles, with memory that does not grow");
    c.add_option("--horizon", o.horizon, "--along: metres from the path, seen from above, that are generated");
    c.add_option("--window", o.window, "--along: metres of path at a time; another value gives another world");
    c.add_option("--tile-size", o.tile_size, "--along: metres of a tile's edge, when the scaffold is one .sgrid");
}

Status generate_along(const AlongFiles& files, const AlongOptions& along, const GenerationOptions& generation,
                      const Globals& globals)
{
    return AlongRun(files, along, generation, globals).run();
}

} // namespace semrover
