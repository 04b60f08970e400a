// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/tiles.h"

#include <functional>
#include <memory>

namespace semrover {

// The code of the error of a source that does not know what it was asked for yet: the tiles that need it wait for
// World::labels_ready, and no other does.
constexpr ErrorCode kNotYet{8};

// Where a world's labels come from, with the points that some voxels have already. They may have no end; what is asked
// for twice is answered alike.
class WorldLabels {
  public:
    virtual ~WorldLabels() = default;
    virtual float voxel_size() const = 0;
    virtual int points_per_voxel() const { return 0; } // of voxels that have points; 0: none has
    // The voxels of a window, sorted; none where nothing is. With points: arrays for all of them, generated says which
    // voxels have some. Errors: the source's, or kNotYet
    virtual Result<VoxelGrid> read(const CellWindow& window) = 0;
    // All tiles of this edge that may have voxels, in order. usage: the source has no end
    virtual Result<std::vector<TileIndex>> tiles(int32_t tile_cells) const = 0;
    // Everything, with its metadata; the last call. usage: the source has no end
    virtual Result<VoxelGrid> take() = 0;
};

std::unique_ptr<WorldLabels> labels_of_grid(VoxelGrid grid);

// Of a folder of tiles (tiles.h), of which a few stay in memory. Errors: bad_input, as TileFolder::open
Result<std::unique_ptr<WorldLabels>> labels_of_folder(const Path& folder);

// Of a callback, which adds the voxels of a window to a grid in any order, without points. Errors: of the callback;
// bad_input for voxels that are not in the window, come twice, or have an unknown label
using LabelCallback = std::function<Status(const CellWindow& window, VoxelGrid& grid)>;
std::unique_ptr<WorldLabels> labels_of_callback(float voxel_size, LabelCallback callback);

} // namespace semrover
