// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/view/street.h"

#include <optional>

namespace semrover::view {

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
