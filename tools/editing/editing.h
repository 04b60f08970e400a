// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/world/conditioning_objects.h"
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

} // namespace semrover
