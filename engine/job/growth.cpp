// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/growth.h"

#include "engine/format/path_format.h"
#include "engine/job/grid_filling.h"
#include "engine/job/growth_pieces.h"
#include "engine/job/outputs.h"
#include "engine/job/version.h"
#include "engine/scene/cell_reach.h"
#include "runtime/base/bytes_text.h"
#include "runtime/base/hash.h"
#include "runtime/base/host_memory.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr int32_t kContextCells = 16; // known cells farther than this from what is new do not matter to a window
constexpr double kLegMetres = 100;    // of path, between two lines of figures

double seconds_now()
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double cpu_seconds_now() // of all threads: what other programs do not change
{
    return double(std::clock()) / CLOCKS_PER_SEC;
}

class Growth : public Job {
  public:
    Growth(Device& device, GrowthPlan plan, const JobCallbacks& callbacks)
        : plan_(std::move(plan)), callbacks_(callbacks), filling_(device, plan_.settings),
          cache_(plan_.source, plan_.request.output, points_per_voxel())
    {
    }

    // results of the same run, where it is done and its tiles are there. usage: tiles of another
    Result<std::optional<Json>> finished_before() const;
    Status begin();
    Result<Json> estimate();

    Result<bool> step(const JobBudget& budget) override;
    Result<Json> finish() override;
    void cancel() override;
    Path kept_in() const override { return plan_.request.output; }

  private:
    Path run_folder() const { return plan_.request.output.string() + ".run"; }
    int points_per_voxel() const { return int(plan_.settings.model.config.points_per_voxel); }
    Result<Json> settings() const;
    Status clear_output() const;
    Status take_up();
    Status cut_window();
    Status load();
    Status begin_window();
    Result<bool> advance(const JobBudget& budget);
    Status finish_window();
    void end_window();
    void note_leg();
    void say(bool ended = false) const;
    Result<std::map<TileIndex, uint64_t>> written_tiles() const;

    const GrowthPlan plan_;
    const JobCallbacks callbacks_;
    GridFilling filling_;
    TileCache cache_;
    std::optional<RunFolder> run_;
    VoxelGrid around_;              // what is around the window at work
    std::vector<uint32_t> targets_; // of it
    SubGrid part_;                  // what the window needs of it
    size_t first_ = 0, window_ = 0; // window that this start began with, and the one at work
    bool window_begun_ = false;
    size_t cells_ = 0, regions_ = 0;
    uint64_t bound_ = 0; // device bytes that no window exceeds
    double begun_ = 0, leg_begun_ = 0, leg_cpu_ = 0;
    Json legs_ = Json::array();
};

Result<Json> Growth::settings() const
{
    const GrowthRequest& r = plan_.request;
    SR_TRY(const uint64_t grid, fs::is_directory(r.scaffold) ? hash_folder(r.scaffold) : hash_file(r.scaffold));
    SR_TRY(Json settings, settings_json(plan_.settings, filling_.device(), "generate --along", grid));
    const Path drive = find_path(r.path).value().path; // plan_growth has read it
    SR_TRY(const uint64_t path, fs::is_directory(drive) ? hash_folder(drive) : hash_file(drive));
    settings["seed"] = r.seed;
    settings["path"] = hash_text(path);
    if (const PathPlacement& p = r.placement;
        p.relative_to || p.lidar_to_camera || p.world != kIdentity || p.origin != Point3{})
        settings["path_placement"] = {{"relative_to", p.relative_to ? Json(*p.relative_to) : Json()},
                                      {"lidar_to_camera", p.lidar_to_camera ? Json(*p.lidar_to_camera) : Json()},
                                      {"world", p.world},
                                      {"origin", p.origin}};
    settings["horizon"] = r.horizon;
    settings["window"] = r.window;
    settings["tile_cells"] = plan_.source.tile_cells();
    if (!plan_.objects.empty())
        settings["objects"] = hash_text(hash_objects(plan_.objects));
    return settings;
}

Result<std::optional<Json>> Growth::finished_before() const
{
    const GrowthRequest& r = plan_.request;
    if (r.replace || !TileFolder::is_one(r.output))
        return std::optional<Json>();
    SR_TRY(const Json wanted, settings());
    std::optional<Json> results = finished_results(run_folder(), wanted);
    if (!results)
        return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(r.output));
    return results;
}

// a run that begins finds no tiles of another
Status Growth::clear_output() const
{
    const GrowthRequest& r = plan_.request;
    SR_CHECK(make_folder(r.output));
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(r.output, error)) {
        if (!r.replace)
            return fail(ErrorCode::usage, "'{}' is not empty; -y replaces the tiles in it", r.output.string());
        const std::string name = entry.path().filename().string();
        if (name == "index.json" || (name.starts_with("tile_") && name.ends_with(".sgrid")))
            fs::remove(entry.path(), error);
    }
    return {};
}

// windows that are in the journal are done; the last one's tiles may not have been written
Status Growth::take_up()
{
    Json last;
    for (const Json& entry : run_->entries()) {
        if (!entry.is_object() || entry.value("window", Json()) != Json(first_) ||
            !entry.value("cells", Json(0u)).is_number_unsigned() ||
            !entry.value("regions", Json(0u)).is_number_unsigned())
            return fail(ErrorCode::bad_input, "the journal in {} is damaged; -y starts over", quote_path(run_->path()));
        ++first_;
        cells_ += entry.value("cells", size_t(0));
        regions_ += entry.value("regions", size_t(0));
        last = entry;
    }
    window_ = first_;
    if (first_ == 0)
        return clear_output();
    remove_temporary_files(plan_.request.output);
    const Path piece = piece_path(*run_, first_ - 1);
    if (!fs::exists(piece))
        return {}; // it goes when the tiles are written
    SR_TRY(const uint64_t hash, hash_file(piece));
    if (last.value("xxh64", Json()) != hash_text(hash))
        return fail(ErrorCode::bad_input, "{} is damaged; -y starts over", quote_path(piece));
    SR_TRY(const GrownCells grown, load_piece(piece, points_per_voxel()));
    SR_CHECK(cache_.bring(grown.cells));
    return cache_.store(grown);
}

// targets_ and, where there are any, part_ in regions
Status Growth::cut_window()
{
    const float edge = plan_.source.voxel_size();
    const std::vector<GroundPoint> piece = plan_.windows.piece(window_);
    const double margin = plan_.request.horizon + kContextCells * decimal_voxel_size(edge);
    SR_TRY(around_, cache_.window(window_around(piece, margin, edge)));
    targets_ = cells_to_grow(around_, piece, plan_.request.horizon);
    if (targets_.empty())
        return {};
    RegionOptions regions = plan_.settings.regions;
    SR_TRY(part_, cut_sub_grid(around_, targets_, cells_considered(regions)));
    regions.from_known = true;
    regions.first_cell = nearest_cell(part_.grid, piece.front());
    return filling_.cut(part_.grid, regions, plan_.objects);
}

Status Growth::load()
{
    SR_CHECK(filling_.load(plan_.request.seed, callbacks_));
    if (bound_)
        return {};
    SR_TRY(bound_, filling_.bound_bytes());
    return {};
}

Status Growth::begin_window()
{
    SR_CHECK(cut_window());
    window_begun_ = true;
    if (targets_.empty())
        return {};
    SR_CHECK(load());
    return filling_.start(nullptr);
}

Status Growth::begin()
{
    SR_TRY(const Json wanted, settings());
    SR_TRY(RunFolder run, open_run(run_folder(), wanted, plan_.request.replace, {{"windows"}}));
    run_.emplace(std::move(run));
    SR_CHECK(take_up());
    begun_ = leg_begun_ = seconds_now();
    leg_cpu_ = cpu_seconds_now();
    say();
    if (window_ == plan_.windows.count())
        return {};
    const Status begun = begin_window(); // memory is planned here
    if (!begun)
        cancel();
    return begun;
}

void Growth::say(bool ended) const
{
    if (!callbacks_.progress)
        return;
    JobProgress p{.stage = "generate", .unit = "windows"};
    p.done = window_;
    p.total = plan_.windows.count();
    p.done_before = first_;
    p.device_bytes = ended ? 0 : filling_.device().allocated_bytes();
    p.ended = ended;
    callbacks_.progress(p);
}

Result<bool> Growth::step(const JobBudget& budget)
{
    Result<bool> done = advance(budget);
    if (!done)
        cancel();
    else if (*done)
        say(true);
    return done;
}

Result<bool> Growth::advance(const JobBudget& budget)
{
    if (window_ == plan_.windows.count())
        return true;
    if (!window_begun_)
        SR_CHECK(begin_window());
    if (targets_.empty()) {
        SR_CHECK(run_->append({{"window", window_}, {"cells", 0}, {"regions", 0}}));
    } else {
        SR_TRY(const bool filled, filling_.step(budget, [this] { say(); }));
        if (!filled)
            return false;
        SR_CHECK(finish_window());
    }
    end_window();
    return window_ == plan_.windows.count();
}

// first safe on the disk, then in the tiles
Status Growth::finish_window()
{
    const GrownCells grown = grown_cells(part_, targets_);
    const size_t regions = filling_.region_count();
    SR_CHECK(save_piece(*run_, window_, grown));
    SR_TRY(const uint64_t hash, hash_file(piece_path(*run_, window_)));
    SR_CHECK(run_->append(
        {{"window", window_}, {"cells", grown.cells.size()}, {"regions", regions}, {"xxh64", hash_text(hash)}}));
    SR_CHECK(cache_.store(grown));
    std::error_code ignored;
    fs::remove(piece_path(*run_, window_), ignored);
    cells_ += grown.cells.size();
    regions_ += regions;
    return {};
}

void Growth::end_window()
{
    window_begun_ = false;
    ++window_;
    say();
    note_leg();
}

// figures of each hundred metres, and of the rest
void Growth::note_leg()
{
    const size_t window = window_ - 1;
    const bool last = window_ == plan_.windows.count();
    const double end = plan_.windows.end(window);
    if (!last && std::floor(end / kLegMetres) == std::floor(plan_.windows.begin(window) / kLegMetres))
        return;
    const double now = seconds_now(), cpu = cpu_seconds_now();
    const HostMemory host = host_memory();
    const uint64_t peak = filling_.device().peak_bytes();
    legs_.push_back({{"metres", end},
                     {"seconds", now - leg_begun_},
                     {"cpu_seconds", cpu - leg_cpu_},
                     {"cells", cells_},
                     {"regions", regions_},
                     {"cells_in_memory", cache_.cells_in_memory()},
                     {"peak_device_bytes", peak},
                     {"host_bytes", host.resident},
                     {"peak_host_bytes", host.peak}});
    if (callbacks_.detail)
        callbacks_.detail(fmt::format("{:6.0f} m {:8.1f} s, {} cells so far, device {} at most, host {} ({} at most)",
                                      end, now - leg_begun_, cells_, bytes_text(peak), bytes_text(host.resident),
                                      bytes_text(host.peak)));
    leg_begun_ = now;
    leg_cpu_ = cpu;
}

void Growth::cancel()
{
    (void)filling_.cancel(); // what fails then will fail again
    run_->drop_if_empty();
    std::error_code ignored;
    fs::remove(plan_.request.output, ignored); // only when nothing is in it
}

Result<Json> Growth::estimate()
{
    for (window_ = 0; window_ < plan_.windows.count(); ++window_) {
        SR_CHECK(cut_window());
        if (targets_.empty())
            continue;
        SR_CHECK(load());
        cells_ += targets_.size();
        regions_ += filling_.region_count();
        SR_CHECK(cache_.mark(grown_cells(part_, targets_)));
    }
    return Json{{"metres", plan_.windows.length()},
                {"windows", plan_.windows.count()},
                {"cells", cells_},
                {"regions", regions_},
                {"peak_device_bytes", bound_},
                {"device", filling_.device().name()}};
}

Result<std::map<TileIndex, uint64_t>> Growth::written_tiles() const
{
    std::map<TileIndex, uint64_t> written;
    for (const TileIndex& tile : plan_.source.all_tiles()) {
        const Path path = plan_.request.output / tile_name(tile);
        if (!fs::exists(path))
            continue;
        SR_TRY(written[tile], cells_in_file(path));
    }
    return written;
}

Result<Json> Growth::finish()
{
    const GrowthRequest& r = plan_.request;
    SR_TRY(const auto written, written_tiles());
    if (written.empty()) {
        std::error_code ignored;
        fs::remove_all(run_->path(), ignored);
        fs::remove(r.output, ignored); // empty
        return fail(ErrorCode::bad_input, "no cell of {} lies within {} m of the path", quote(r.scaffold.string()),
                    r.horizon);
    }
    TileFolderInfo info{plan_.source.voxel_size(), plan_.source.tile_cells(), points_per_voxel(), true,
                        plan_.source.metadata()};
    info.metadata["seed"] = std::to_string(r.seed);
    info.metadata["tool"] = kProgram;
    SR_CHECK(write_tile_index(r.output, info, written));
    const Json results{{"metres", plan_.windows.length()},
                       {"windows", plan_.windows.count()},
                       {"tiles", written.size()},
                       {"cells", cells_},
                       {"regions", regions_},
                       {"seconds", seconds_now() - begun_},
                       {"planned_device_bytes", bound_},
                       {"peak_device_bytes", filling_.device().peak_bytes()},
                       {"peak_host_bytes", host_memory().peak},
                       {"legs", legs_}};
    SR_CHECK(run_->finish(results));
    return results;
}

class FinishedGrowth : public Job {
  public:
    explicit FinishedGrowth(Json results) : results_(std::move(results)) {}
    Result<bool> step(const JobBudget&) override { return true; }
    Result<Json> finish() override { return results_; }
    void cancel() override {}

  private:
    Json results_;
};

} // namespace

Result<std::unique_ptr<Job>> begin_growth(Device& device, GrowthPlan plan, const JobCallbacks& callbacks)
{
    auto job = std::make_unique<Growth>(device, std::move(plan), callbacks);
    SR_TRY(std::optional<Json> finished, job->finished_before());
    if (finished)
        return std::make_unique<FinishedGrowth>(std::move(*finished));
    SR_CHECK(job->begin());
    return job;
}

Result<Json> estimate_growth(Device& device, GrowthPlan plan, const JobCallbacks& callbacks)
{
    return Growth(device, std::move(plan), callbacks).estimate();
}

} // namespace semrover
