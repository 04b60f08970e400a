// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "runtime/device/device.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/run_job.h"
#include "tools/commands/generation_options.h"
#include "tools/commands/scene_input.h"

#include <set>
#include <string>

namespace semrover {

// where a grid's points go as PLY; empty paths are not written
struct PlyExports {
    std::string points;    // x y z, colour, label
    std::string splats_3d; // 3DGS
    std::string splats_2d; // 2DGS
    bool any() const { return !points.empty() || !splats_3d.empty() || !splats_2d.empty(); }
};

// normals come from the device; sigma as `render` draws it by default
Status export_ply(Device& device, const VoxelGrid& grid, const PlyExports& exports);

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

// `generate`, from the command line to what it writes: begin, then steps of the world until it is done, then end
class GenerateRun {
  public:
    GenerateRun(const GenerateArguments& arguments, const Globals& globals)
        : o_(arguments), globals_(globals), display_(globals)
    {
    }
    virtual ~GenerateRun() = default;

    // Refuses what cannot be before any work, loads, and takes over what an interrupted run of the same left. true:
    // nothing is left to do, as for a dry run, or a run that was finished before
    virtual Result<bool> begin() = 0;
    World& world() { return *world_; }
    virtual Path kept_in() const = 0;      // what is done
    virtual Status check_step() const = 0; // after each
    Status end();

  protected:
    Path folder() const { return o_.output + ".run"; }
    virtual Result<Json> write() = 0; // what was generated, once; its figures

    const GenerateArguments& o_;
    const Globals& globals_;
    JobDisplay display_;
    std::shared_ptr<Device> device_;
    GenerationSettings generation_;
    GivenObjects objects_;
    std::optional<Json> finished_; // results of a run that was finished before
    std::optional<RunFolder> run_;
    std::unique_ptr<World> world_;
    double begun_ = 0;
};

// of a whole grid
class GridRun : public GenerateRun {
  public:
    using GenerateRun::GenerateRun;

    Result<bool> begin() override;
    Path kept_in() const override { return folder(); }
    Status check_step() const override { return {}; }

  private:
    std::vector<Path> written_files(bool with_objects) const;
    Status check_outputs(bool replace) const;
    Status read();
    Status look(); // from here on objects_ are those that condition the model
    bool finished_before();
    Status open_world_in_run();
    VoxelGrid filled() const;
    Result<Json> write() override;

    VoxelGrid grid_; // its metadata alone once the world is there
    uint64_t grid_hash_ = 0;
    Json settings_;
};

// --along: the tiles near a trajectory, into a folder of tiles
class TilesRun : public GenerateRun {
  public:
    using GenerateRun::GenerateRun;

    Result<bool> begin() override;
    Path kept_in() const override { return o_.output; }
    Status check_step() const override { return world_->stored(); } // it is what the run is for

  private:
    Status check() const;
    Status read();
    Result<Json> settings() const;
    bool is_whole() const;
    void remove_tiles_but(const std::set<std::string>& names) const;
    Status clear_output() const;
    Status open();
    void remove_run();
    Result<Json> write() override;

    std::vector<GroundPoint> track_;
    std::unique_ptr<WorldLabels> labels_; // of the scaffold, until the world takes them
    std::map<std::string, std::string> metadata_;
    PathPlacement placement_;
};

} // namespace semrover
