// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/cost_model.h"

#include <algorithm>

namespace semrover {

namespace {

// rates that no supported GPU falls short of by much
constexpr double kSlowOperations = 5e11, kSlowBytes = 2e10; // a second

constexpr double kLeastSeconds = 1e-4;  // of a measured pass: shorter ones are mostly the start of a dispatch
constexpr double kLeastRatio = 1. / 64; // of seconds to estimated ones, so that one odd measurement does no harm

} // namespace

double estimated_seconds(const Pass& pass)
{
    double bytes = 0;
    for (const PassBinding& b : pass.bindings)
        bytes += double(b.bytes);
    return std::max(std::max(pass.options.flops, pass.options.max_flops) / kSlowOperations, bytes / kSlowBytes);
}

void CostModel::learn(const Pass& pass, double seconds)
{
    if (seconds < kLeastSeconds)
        return;
    Measured& m = measured_[pass.variant];
    m.estimated += estimated_seconds(pass);
    m.seconds += seconds;
}

double CostModel::seconds(const Pass& pass) const
{
    const double estimated = estimated_seconds(pass);
    const auto found = measured_.find(pass.variant);
    if (found == measured_.end() || found->second.estimated <= 0)
        return estimated;
    // where the data decides, the next data may have all that there can be
    const double least = pass.options.max_flops > 0 ? 1 : kLeastRatio;
    return estimated * std::max(found->second.seconds / found->second.estimated, least);
}

std::vector<double> CostModel::seconds(const Plan& plan) const
{
    std::vector<double> out;
    for (const Pass& pass : plan.passes)
        out.push_back(seconds(pass));
    return out;
}

} // namespace semrover
