// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/call.h"
#include "engine/scene/label_edits.h"

namespace semrover::capi {

// what a caller sets, the last of equal voxels; none: SR_NO_CELL. name: of the call.
// Errors: usage; bad_input for coordinates and labels
Result<LabelEdits> edits_of(const sr_cell* cells, uint64_t count, const char* name);

} // namespace semrover::capi
