// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"

namespace semrover {

// stored points and colours of the target voxels of a finished region
struct RegionResult {
    uint32_t region = 0;
    std::vector<uint32_t> targets; // indices of voxels
    std::vector<uint16_t> points;  // [targets, n, 3] f16 bits
    std::vector<uint8_t> colors;   // [targets, n, 3]
};

// Saves a finished region in a run folder: regions/<region>.safetensors, and a line with its hash in the journal.
Status save_region(RunFolder& run, const RegionResult& result);

// Loads the regions that an interrupted run finished, without those whose file is missing or damaged: the run does
// them again.
std::vector<RegionResult> load_regions(const RunFolder& run);

} // namespace semrover
