// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/plan.h"

// bands of rows of a pass's output, each with the rows of the bindings that it needs (DispatchOptions::banded)
namespace semrover {

// rows of the output; 0: it cannot be cut
uint32_t rows_of(const Pass& pass);

// rows of the output of which every banded binding starts aligned; windows align themselves
uint64_t aligned_rows(const Pass& pass, const DeviceLimits& limits);

// does the device bind all of it at once?
bool binds(const Pass& pass, const DeviceLimits& limits);

// Rows per band that satisfy every limit; rows_of(pass) when nothing has to be cut. out_of_memory: a binding that
// cannot be cut, or of which not even the fewest rows fit.
Result<uint32_t> band_rows(const Plan& plan, const Pass& pass, const DeviceLimits& limits);

// the pass in bands of `rows` rows, the last of which may have fewer
std::vector<Pass> bands_of(const Pass& whole, uint32_t rows, const DeviceLimits& limits);

} // namespace semrover
