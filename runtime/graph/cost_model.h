// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/plan.h"

#include <map>
#include <vector>

namespace semrover {

// Seconds that a pass takes on a slow GPU: arithmetic or memory, whichever takes longer. Good enough to keep the first
// submits under a watchdog.
double estimated_seconds(const Pass& pass);

// How long the passes of a device take, beside what was estimated, by shader: what executables have measured so far.
class CostModel {
  public:
    // a pass took that long
    void learn(const Pass& pass, double seconds);
    // that it will take: as measured, or as estimated while nothing was
    double seconds(const Pass& pass) const;
    std::vector<double> seconds(const Plan& plan) const; // of each pass

  private:
    struct Measured {
        double estimated = 0, seconds = 0; // sums
    };
    std::map<const KernelVariant*, Measured> measured_;
};

} // namespace semrover
