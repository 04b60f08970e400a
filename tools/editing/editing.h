// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "engine/world/world_objects.h"
#include "runtime/base/json.h"
#include "tools/editing/grid_editor.h"

namespace semrover {

// a grid of which some voxels are to be generated anew, all the rest staying byte for byte: the end of edit and inpaint
struct Regeneration {
    std::string command; // "edit"
    Path input;          // the file that `before` was read from
    VoxelGrid before;
    VoxelGrid grid;                // what is written, but for the targets
    std::vector<uint32_t> targets; // ascending indices into `grid`
    GivenObjects objects = {};     // what conditions a model; written beside each output (objects_beside)
    bool needs_objects = false;    // a model that cannot be conditioned on them is an error
    Json request;                  // what was asked for, for the settings of the run
    Json counts;                   // for the report
};

// what `edit` asks for: operations in order, and how far around what they change is generated anew
struct EditRequest {
    Path grid;
    std::vector<EditOperation> operations;
    double halo = 3;           // metres
    GivenObjects objects = {}; // of the grid: what a tint is for, and what conditions a model
    // false: nothing around the change is thrown away, only voxels that changed wait for points
    bool generates = true;
};
// usage: an operation or a halo that cannot be; reads no file
Status check_edit(const EditRequest& request);
// the edited grid, and what of it is to be generated. Errors: as check_edit; bad_input (the files, no voxel left)
Result<Regeneration> edit_grid(const EditRequest& request);

// what `inpaint` asks for: the voxels that are selected and, where there is a mask, that it has too
struct InpaintRequest {
    Path grid;
    CellSelection where;
    Path mask;                 // .sgrid; empty: none
    GivenObjects objects = {}; // of the grid, for the model
};
// bad_input: the files, no voxel selected
Result<Regeneration> select_for_inpainting(const InpaintRequest& request);

// Writes the selected voxels as a stamp; `cells` and `origin` of it. Errors: bad_input
Result<Json> write_stamp(const Path& grid, const CellSelection& where, const Path& output);

// Edits as JSON: an array of operations (or an object with the array as "operations"), each
//   {"op": "remove"|"delete", "class": "car", "box": [x0,y0,z0,x1,y1,z1], "sphere": [x,y,z,r], "object": [i,j,k]}
//   {"op": "paint", "label": "road", ..., "fill": true}
//   {"op": "insert", "stamp": "car.sgrid", "at": [x,y,z], "rotate": 90, "points": "keep"|"regenerate"}
//   {"op": "tint", "color": "#aa4433", "class": "building", ...}
//   {"op": "copy"|"move", ..., "by": [x,y,z], "rotate": 90, "points": "keep"|"regenerate"}
// Metres, voxels for "object", degrees; a stamp's path is relative to the file's folder and stays
// inside it. Unknown keys are refused.
// Errors: bad_input, with the number of the operation.
Result<std::vector<EditOperation>> read_edit_script(const Path& path);
Result<std::vector<EditOperation>> parse_edit_script(const Json& json, const Path& folder, std::string_view where);

// in the same form, with every default written out: equal text means equal operations
Json operation_json(const EditOperation& operation);
Json selection_json(const CellSelection& selection);

// 0, 90, 180, 270 -> quarter turns; "keep" or "regenerate" -> keep. Errors: usage
Result<int> quarter_turns(double degrees);
Result<bool> keeps_points(std::string_view text);

// What an edit changed, and what was there before: a safetensors file (metadata format "semrover.undo", version "1").
//   cells [C, 3] i32, labels [C] u8, points [C, n, 3] f16, colors [C, n, 3] u8, generated [C] u8: voxels of the grid
//   before that are gone or differ; points, colors and generated when that grid had points
//   added [A, 3] i32: voxels that were not there
//   original [B] u8: all bytes of the file before, when it was not as write_grid writes (another program's): only then
// metadata: before and after (hashes of the two files), voxel_size and points_per_voxel of the grid before, metadata
// (its own, as JSON).

// before_path: the file that `before` was read from; after_path: `after` as it was written
Status write_undo(const Path& path, const Path& before_path, const VoxelGrid& before, const Path& after_path,
                  const VoxelGrid& after);

// writes the file before the edit, byte for byte. bad_input when `edited` is not the file that the record was made for,
// or the record is damaged; nothing is written then.
Status undo_edit(const Path& record, const Path& edited, const Path& output);

} // namespace semrover
