// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/streets/plot.h"

namespace semrover {

// what stands on the sidewalks: trees, lights, signs, bins, benches, bicycles in racks, bus stops, people
void add_furnishing(Site& site);
// what stands on the carriageway: parked and waiting vehicles, two-wheelers with riders, a tram where there are rails
void add_traffic(Site& site);

} // namespace semrover
