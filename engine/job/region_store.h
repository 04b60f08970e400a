// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"
#include "engine/voxfield/outpaint.h"

namespace semrover {

// Saves a finished region in a run folder: regions/<region>.safetensors, and a line with its hash in the journal.
Status save_region(RunFolder& run, const RegionResult& result);

// Loads the regions that an interrupted run finished, without those whose file is missing or damaged: the run does
// them again.
std::vector<RegionResult> load_regions(const RunFolder& run);

} // namespace semrover
