// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "tools/view/camera.h"

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace semrover::view {

struct StreetRequest {
    Path grid; // a .sgrid or a folder of tiles
    std::string model, objects, cache;
    uint64_t seed = 0, host_bytes = 0, splat_bytes = 0;
    uint32_t steps = 0;         // 0: as the model says
    double splat_radius = 0;    // metres; 0: from the points
    double detail_distance = 0; // as sr_world_desc has it
    double radius = 20;         // metres around the camera that are generated
    std::function<void(const std::string&)> warning;
};

// a finished voxel
struct PlacedCell {
    sr_cell cell{};
    std::vector<std::array<float, 6>> points; // x, y, z, r, g, b
};

Result<sr_model*> load_model(sr_context* context, const std::string& folder, uint32_t part);

// The world that is looked at: a sr_world of the library.
class Street {
  public:
    static Result<std::unique_ptr<Street>> open(sr_context* context, const StreetRequest& request);
    ~Street();

    sr_world* world() const { return world_; }
    const Camera& start() const { return start_; } // over a road, where there is one
    double radius = 20;

    Status focus(const Camera& camera);
    Result<bool> step(uint64_t budget_us); // true: all that is wanted is there
    Result<sr_world_info> info() const;
    Result<std::vector<PlacedCell>> cells(const sr_cell_rect& window) const; // those that are finished
    Status edit(const std::vector<sr_cell>& cells);
    Status save(const Path& path) const; // all finished voxels in memory, as .sgrid

  private:
    explicit Street(sr_context* context) : context_(context) {}
    Status create(const StreetRequest& request);

    sr_context* context_;
    sr_world* world_ = nullptr;
    Camera start_;
};

// the voxel that was clicked
struct PickedCell : PlacedCell {
    std::array<int32_t, 2> tile{}; // the region of the world that it was generated with
    std::array<float, 3> color{};  // mean of its points
};

// The finished voxel with the point nearest to a place, of those that the place lies in or beside; none where there is
// no such voxel.
Result<std::optional<PickedCell>> pick(const Street& street, const Vector& place);

// the same of a voxel whose place is known; none where it is not finished
Result<std::optional<PickedCell>> pick(const Street& street, const sr_cell& cell);

// Changes labels of the voxels around one, and takes it back.
class Brush {
  public:
    int reach = 0;      // voxels on each side
    uint32_t label = 8; // SR_NO_CELL: takes voxels away

    // Returns how many voxels were changed: those that are there and have another label.
    Result<size_t> paint(Street& street, const sr_cell& around);
    Result<size_t> undo(Street& street); // the last stroke
    size_t strokes() const { return strokes_.size(); }

  private:
    std::vector<std::vector<sr_cell>> strokes_; // the voxels as they were before
};

} // namespace semrover::view
