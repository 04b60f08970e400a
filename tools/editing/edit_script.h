// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "tools/editing/grid_editor.h"

namespace semrover {

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

} // namespace semrover
