// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/tiles.h"

#include <functional>
#include <memory>

namespace semrover {

// Where a world's labels come from. They may have no end; what is asked for twice is answered alike.
class WorldLabels {
  public:
    virtual ~WorldLabels() = default;
    virtual float voxel_size() const = 0;
    // The cells of a window with their labels, without points, sorted; none where nothing is. Errors: the source's
    virtual Result<VoxelGrid> read(const CellWindow& window) = 0;
};

std::unique_ptr<WorldLabels> labels_of_grid(VoxelGrid grid);

// Of a folder of tiles (tiles.h), of which a few stay in memory. Errors: bad_input, as TileFolder::open
Result<std::unique_ptr<WorldLabels>> labels_of_folder(const Path& folder);

// Of a callback, which adds the cells of a window to a grid in any order. Errors: of the callback; bad_input for cells
// that are not in the window, come twice, or have an unknown label
using LabelCallback = std::function<Status(const CellWindow& window, VoxelGrid& grid)>;
std::unique_ptr<WorldLabels> labels_of_callback(float voxel_size, LabelCallback callback);

} // namespace semrover
