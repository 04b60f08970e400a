// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "tools/editing/cell_selection.h"

#include <map>
#include <span>

namespace semrover {

// one step of an edit
struct EditOperation {
    enum class Kind {
        remove, // voxels go, and the ground under them closes: what a car stood on is road again
        erase,  // voxels go, nothing else
        paint,  // voxels get a label; with `fill` empty places of the selection become voxels too
        insert, // a stamp's voxels replace what is at their places
        copy,   // the selection once more, elsewhere
        move,   // the same, and the selection is removed where it was
        tint,   // objects get a colour; voxels stay as they are
    };
    Kind kind = Kind::remove;
    CellSelection where;           // all but insert
    uint8_t label = 0;             // paint
    std::array<double, 3> color{}; // tint: sRGB 0..1
    bool fill = false;
    Path stamp;                              // insert
    std::optional<std::array<double, 3>> at; // insert: metres; the voxel there gets the stamp's lowest corner
    std::optional<std::array<double, 3>> by; // copy and move: metres, rounded to whole voxels
    int quarter_turns = 0;                   // counterclockwise seen from above
    bool keep_points = false;                // of the stamp or the copy; else they are generated anew
};
std::string_view operation_name(EditOperation::Kind kind); // erase is called "delete"
// usage: something that the operation needs is missing, or does not apply to it; `where` names the operation
Status check_operation(const EditOperation& operation, std::string_view where);

// The grid after an edit. `touched` voxels have another label, other occupancy, or points of a stamp; `kept` voxels are
// those with points of a stamp. Both are sorted. Changed voxels without points have generated = 0 and zeros.
struct EditedGrid {
    struct Tint {
        std::vector<Cell> cells; // sorted
        std::array<double, 3> color;
    };
    VoxelGrid grid;
    std::vector<Cell> touched, kept;
    std::vector<Tint> tints; // in order; for the caller, who knows the objects
};

// Applies operations in order, each to what the one before left. The ground closes thus: a column of removed voxels
// that has no ground within three voxels of its lowest removed voxel, and stood at most a voxel above the level of the
// nearest ground (6 voxels away at most, 2 up or down; the most frequent label of the nearest, the lower one of
// equals), gets one voxel of that ground at that level.
class GridEditor {
  public:
    explicit GridEditor(const VoxelGrid& grid); // kept by reference

    // errors: bad_input (a stamp that cannot be read or has other voxels, a selection without voxels, places beyond all
    // bounds)
    Status apply(const EditOperation& operation);

    EditedGrid finish() const;

  private:
    struct Content {
        std::vector<uint16_t> points;
        std::vector<uint8_t> colors;
    };
    Result<std::vector<uint32_t>> selected(const EditOperation& operation) const;
    Status check_room(const EditOperation& operation, size_t more, size_t kept) const;
    Status paint(const EditOperation& operation);
    Status insert(const VoxelGrid& stamp, const EditOperation& operation, const Cell& at);
    Status copy(const EditOperation& operation);
    void drop(std::span<const uint32_t> cells);
    void put(const std::map<Cell, uint8_t>& labels);
    void close_ground(std::span<const Cell> removed);
    std::optional<std::pair<Cell, uint8_t>> ground_for(const Cell& lowest) const;
    VoxelGrid with_points(std::span<const uint32_t> cells) const;
    const Content* kept_content(const Cell& cell) const;

    const VoxelGrid& base_;
    VoxelGrid view_; // voxels and labels as they are now
    std::map<Cell, Content> kept_;
    std::vector<EditedGrid::Tint> tints_;
    int points_per_voxel_;
};

// A stamp is a grid whose lowest corner is (0, 0, 0): a car, a facade, a crossing, cut out to be set elsewhere.

// the given voxels of a grid, with their points if the grid has any, moved to the origin; metadata "stamp_origin" says
// where they were. cells [n]: ascending indices, at least one.
VoxelGrid cut_stamp(const VoxelGrid& grid, std::span<const uint32_t> cells);

// turned counterclockwise seen from above, (x, y) -> (-y, x) each quarter, and moved to the origin again. Offsets of
// points turn with their voxels, exactly: four quarters give the same bytes.
VoxelGrid turned(const VoxelGrid& stamp, int quarter_turns);

// the lowest index along each axis
Cell lowest_corner(std::span<const Cell> cells);

} // namespace semrover
