// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/generation.h"

#include "engine/job/grid_filling.h"
#include "engine/job/input_hashes.h"
#include "engine/job/outputs.h"
#include "engine/job/told_objects.h"
#include "engine/job/version.h"
#include "runtime/base/hash.h"

namespace semrover {

namespace {

std::vector<Path> written_files(const GenerationRequest& r, bool with_objects)
{
    std::vector<Path> files;
    for (const Path& path : {r.output, with_objects && !r.output.empty() ? objects_beside(r.output) : Path(),
                             Path(r.ply.points), Path(r.ply.splats_3d), Path(r.ply.splats_2d)})
        if (!path.empty())
            files.push_back(path);
    return files;
}

class GridGeneration : public GenerationJob {
  public:
    GridGeneration(Device& device, VoxelGrid grid, const GenerationRequest& request, const JobCallbacks& callbacks)
        : request_(request), callbacks_(callbacks), grid_(std::move(grid)), filling_(device, request_.settings)
    {
    }

    Status look(); // at what decides the bytes
    // the same was generated before, and what it wrote is there
    bool finished_before();
    Status load();
    Status start();
    Result<Json> estimate() { return filling_.estimate(); }

    Result<bool> step(const JobBudget& budget) override;
    Result<Json> finish() override;
    void cancel() override { (void)filling_.cancel(); } // what fails then will fail again
    Path kept_in() const override { return request_.output.empty() ? Path() : run_folder(); }
    const VoxelGrid& grid() const override { return grid_; }

  private:
    Path run_folder() const { return request_.output.string() + ".run"; }

    const GenerationRequest request_;
    const JobCallbacks callbacks_;
    VoxelGrid grid_;
    GridFilling filling_;
    std::vector<SceneObject> objects_; // that the model is told of
    Json settings_;
    std::optional<Json> finished_; // results of such a run
    std::optional<RunFolder> run_;
};

// the grid's hash is taken before it gets room for points
Status GridGeneration::look()
{
    const uint64_t grid_hash = request_.grid_hash ? *request_.grid_hash : hash_grid(grid_);
    const bool by_blocks = request_.settings.regions.tile_cells > 0;
    SR_TRY(objects_, told_objects(request_.settings.model, request_.objects, grid_, request_.seed, by_blocks));
    SR_TRY(settings_, settings_json(request_.settings, filling_.device(), "generate", grid_hash));
    settings_["seed"] = request_.seed;
    if (!objects_.empty())
        settings_["objects"] = hash_text(hash_objects(objects_));
    return {};
}

bool GridGeneration::finished_before()
{
    if (request_.output.empty() || request_.replace)
        return false;
    finished_ = finished_results(run_folder(), settings_);
    const auto hash = hash_file(request_.output);
    if (!finished_ || !hash || finished_->value("xxh64", Json()) != hash_text(*hash))
        finished_.reset();
    for (const Path& path : written_files(request_, !objects_.empty()))
        if (!std::filesystem::exists(path))
            finished_.reset();
    return finished_.has_value();
}

Status GridGeneration::load()
{
    warn_of_placement(request_.settings.model, grid_, callbacks_);
    SR_CHECK(filling_.cut(grid_, request_.settings.regions, objects_));
    return filling_.load(request_.seed, callbacks_);
}

Status GridGeneration::start()
{
    if (!request_.output.empty()) {
        SR_TRY(RunFolder run, open_run(run_folder(), settings_, request_.replace));
        run_.emplace(std::move(run));
    }
    SR_CHECK(filling_.start(run_ ? &*run_ : nullptr));
    filling_.say(callbacks_);
    return {};
}

Result<bool> GridGeneration::step(const JobBudget& budget)
{
    if (finished_)
        return true;
    SR_TRY(const bool filled, filling_.step(budget, [this] { filling_.say(callbacks_); }));
    if (filled)
        filling_.say(callbacks_, true);
    return filled;
}

Result<Json> GridGeneration::finish()
{
    if (finished_)
        return *finished_;
    grid_.metadata["seed"] = std::to_string(request_.seed);
    grid_.metadata["tool"] = kProgram;
    grid_.metadata["model"] = settings_["model"];
    if (const std::string& placement = request_.settings.model.config.placement; placement != "shifted")
        grid_.metadata["placement"] = placement;
    if (const int32_t edge = request_.settings.regions.tile_cells)
        grid_.metadata["tile_cells"] = std::to_string(edge);
    if (request_.ply.any())
        SR_CHECK(export_ply(filling_.device(), grid_, request_.ply));
    Json results = filling_.results();
    if (request_.output.empty())
        return results;
    SR_CHECK(write_grid(request_.output, grid_));
    if (!objects_.empty())
        SR_CHECK(write_objects(objects_beside(request_.output), objects_));
    SR_TRY(const uint64_t hash, hash_file(request_.output));
    results["output"] = request_.output.filename().string();
    results["xxh64"] = hash_text(hash);
    SR_CHECK(run_->finish(results));
    return results;
}

} // namespace

Status check_generation_outputs(const GenerationRequest& request)
{
    const bool told = !request.settings.model.config.condition.empty();
    for (const Path& path : written_files(request, told))
        SR_CHECK(check_writable(path, request.replace));
    return {};
}

Result<std::unique_ptr<GenerationJob>> begin_generation(Device& device, VoxelGrid grid,
                                                        const GenerationRequest& request, const JobCallbacks& callbacks)
{
    auto job = std::make_unique<GridGeneration>(device, std::move(grid), request, callbacks);
    SR_CHECK(job->look());
    if (job->finished_before())
        return job;
    SR_CHECK(check_generation_outputs(request));
    SR_CHECK(job->load());
    SR_CHECK(job->start());
    return job;
}

Result<Json> estimate_generation(Device& device, VoxelGrid grid, const GenerationRequest& request,
                                 const JobCallbacks& callbacks)
{
    GridGeneration job(device, std::move(grid), request, callbacks);
    SR_CHECK(job.look());
    SR_CHECK(job.load());
    return job.estimate();
}

} // namespace semrover
