// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"
#include "engine/voxfield/outpaint.h"

namespace semrover {

// finished regions in a run folder: regions/<region>.safetensors and a journal line with its hash
Status save_region(RunFolder& run, const RegionResult& result);

// the regions that an interrupted run finished; one whose file is missing or damaged is left out, and will be done
// again
std::vector<RegionResult> load_regions(const RunFolder& run);

} // namespace semrover
