// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/profile.h"

#include "runtime/base/file.h"
#include "runtime/base/json.h"

#include <algorithm>
#include <functional>
#include <map>
#include <set>

namespace semrover {

namespace {

// of a statistic over pipelines
struct Range {
    std::string name;
    double least = 0, most = 0;
};

void widen(std::vector<Range>& ranges, const std::vector<Statistic>& statistics)
{
    for (const Statistic& s : statistics) {
        const auto at = std::ranges::find(ranges, s.name, &Range::name);
        if (at == ranges.end())
            ranges.push_back({s.name, s.value, s.value});
        else
            *at = {s.name, std::min(at->least, s.value), std::max(at->most, s.value)};
    }
}

} // namespace

Status Profile::write(const std::string& path) const
{
    Json trace = Json::array();
    for (const Event& e : events_)
        trace.push_back({{"name", e.name},
                         {"ph", "X"},
                         {"pid", 1},
                         {"tid", 1},
                         {"ts", e.begin_us},
                         {"dur", e.duration_us},
                         {"args", {{"groups", e.groups}, {"gflop", e.flops / 1e9}, {"tile", e.tile}}}});
    return write_file_atomically(path, json_text(Json{{"traceEvents", std::move(trace)}, {"displayTimeUnit", "ms"}}));
}

std::vector<Profile::Total> Profile::totals() const
{
    std::map<std::string, Total> by_name;
    for (const Event& e : events_) {
        Total& total = by_name[e.name];
        total.name = e.name;
        total.duration_us += e.duration_us;
        ++total.count;
    }
    std::vector<Total> sorted;
    for (auto& [name, total] : by_name)
        sorted.push_back(std::move(total));
    std::ranges::stable_sort(sorted, std::ranges::greater(), &Total::duration_us);
    return sorted;
}

std::string Profile::summary() const
{
    const std::vector<Total> sorted = totals();
    double all = 0;
    for (const Total& total : sorted)
        all += total.duration_us;
    std::string out;
    for (const Total& total : sorted)
        out += fmt::format("{:10.1f} ms {:5.1f} % {:6} x {}\n", total.duration_us / 1e3, 100 * total.duration_us / all,
                           total.count, total.name);
    return out;
}

std::string Profile::statistics() const
{
    std::string out;
    for (const Total& total : totals()) {
        std::set<const void*> pipelines;
        std::vector<Range> ranges;
        for (const Event& e : events_)
            if (e.name == total.name && e.statistics && pipelines.insert(e.statistics.get()).second)
                widen(ranges, *e.statistics);
        if (pipelines.empty())
            continue;
        out += fmt::format("{}, {} pipelines:", total.name, pipelines.size());
        for (const Range& r : ranges)
            out += r.least == r.most ? fmt::format(" {} {:.10g};", r.name, r.least)
                                     : fmt::format(" {} {:.10g} to {:.10g};", r.name, r.least, r.most);
        out.back() = '\n';
    }
    return out;
}

} // namespace semrover
