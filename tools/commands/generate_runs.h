// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/export_ply.h"
#include "tools/cli/path_options.h"
#include "tools/cli/run_job.h"
#include "tools/commands/generation_options.h"
#include "tools/commands/scene_input.h"

namespace semrover {

struct GenerateArguments {
    std::string grid, output, objects = "auto", order = "scene";
    std::optional<double> tile_size;
    uint64_t seed = 0;
    GenerationArguments generation;
    PlyExports ply;
    SceneInputOptions input;
    std::string along;     // a camera path; empty: the whole grid
    double horizon = 30;   // metres to either side and ahead
    PathOptions placement; // of the path
};

// `generate` of a whole grid: from the command line to the files that it writes. begin, then steps of the world until
// it is done, then end.
class GridRun {
  public:
    GridRun(const GenerateArguments& arguments, const Globals& globals)
        : o_(arguments), globals_(globals), display_(globals)
    {
    }

    // Refuses what cannot be before any work, loads, and takes over what an interrupted run of the same left. true:
    // nothing is left to do, as for a dry run, or a run that was finished before
    Result<bool> begin();
    World& world() { return *world_; }
    Path folder() const { return o_.output + ".run"; } // keeps what is done
    Status end();

  private:
    std::vector<Path> written_files(bool with_objects) const;
    Status check_outputs() const;
    Status read();
    Status look();
    bool finished_before();
    Status open_world_in_run();
    VoxelGrid filled() const;

    const GenerateArguments& o_;
    const Globals& globals_;
    JobDisplay display_;
    std::unique_ptr<Device> device_;
    GenerationSettings generation_;
    GivenObjects objects_; // that condition the model, from look() on
    VoxelGrid grid_;       // its metadata alone once the world is there
    uint64_t grid_hash_ = 0;
    Json settings_;
    std::optional<Json> finished_; // results of such a run
    std::optional<RunFolder> run_;
    std::unique_ptr<World> world_;
    double begun_ = 0;
};

// `generate --along`: the tiles near a trajectory, from the command line to the folder of tiles. begin, then steps of
// the world until it is done, then end.
class TilesRun {
  public:
    TilesRun(const GenerateArguments& arguments, const Globals& globals)
        : o_(arguments), globals_(globals), display_(globals)
    {
    }

    // as GridRun::begin
    Result<bool> begin();
    World& world() { return *world_; }
    Status end();

  private:
    Path folder() const { return o_.output + ".run"; }
    Status check() const;
    Status read();
    Result<Json> settings() const;
    Result<bool> finished_before();
    Status clear_output() const;
    Status open();
    void remove_run();

    const GenerateArguments& o_;
    const Globals& globals_;
    JobDisplay display_;
    std::unique_ptr<Device> device_;
    GenerationSettings generation_;
    GivenObjects objects_;
    std::vector<GroundPoint> track_;
    std::unique_ptr<WorldLabels> labels_; // of the scaffold, until the world takes them
    std::map<std::string, std::string> metadata_;
    PathPlacement placement_;
    std::optional<Json> finished_;
    std::optional<RunFolder> run_;
    std::unique_ptr<World> world_;
    double begun_ = 0;
};

} // namespace semrover
