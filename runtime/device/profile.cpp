// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/profile.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

namespace semrover {

Status Profile::write(const std::string& path) const
{
    nlohmann::json trace = nlohmann::json::array();
    for (const Event& e : events_)
        trace.push_back({{"name", e.name},
                         {"ph", "X"},
                         {"pid", 1},
                         {"tid", 1},
                         {"ts", e.begin_us},
                         {"dur", e.duration_us},
                         {"args", {{"groups", e.groups}, {"gflop", e.flops / 1e9}, {"tile", e.tile}}}});
    std::ofstream out(path);
    out << nlohmann::json{{"traceEvents", std::move(trace)}, {"displayTimeUnit", "ms"}}.dump();
    if (!out.flush())
        return fail(ErrorCode::bad_input, "cannot write the profile '{}': {}", path, std::strerror(errno));
    return {};
}

std::string Profile::summary() const
{
    std::map<std::string, std::pair<double, size_t>> totals;
    double all = 0;
    for (const Event& e : events_) {
        totals[e.name].first += e.duration_us;
        ++totals[e.name].second;
        all += e.duration_us;
    }
    std::vector<std::pair<std::string, std::pair<double, size_t>>> sorted(totals.begin(), totals.end());
    std::sort(sorted.begin(), sorted.end(),
              [](const auto& a, const auto& b) { return a.second.first > b.second.first; });
    std::string out;
    for (const auto& [name, total] : sorted)
        out += fmt::format("{:10.1f} ms {:5.1f} % {:6} x {}\n", total.first / 1e3, 100 * total.first / all,
                           total.second, name);
    return out;
}

} // namespace semrover
