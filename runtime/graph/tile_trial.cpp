// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/tile_trial.h"

#include <algorithm>
#include <limits>

namespace semrover {

namespace {

constexpr size_t kTurns = 2;      // of each tile: the first run of a program finds caches cold and clocks low
constexpr double kClearly = 0.97; // of the time of the planner's tile, below which another one is taken

} // namespace

Result<TileTrial> TileTrial::begin(Plan& plan, const DeviceLimits& limits, const TileChoices& choices)
{
    TileTrial trial;
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        Pass& pass = plan.passes[i];
        std::vector<uint32_t> tiles = tiles_of(pass, limits);
        if (tiles.size() < 2)
            continue;
        const TileChoices::Key key = TileChoices::key(pass);
        if (const auto best = choices.best(key); best && std::ranges::find(tiles, *best) != tiles.end()) {
            trial.changed_ |= pass.tile_rows != *best;
            pass.set_tile(*best, limits);
            SR_CHECK(stage::count_groups(pass, limits));
            continue;
        }
        auto group = std::ranges::find(trial.groups_, key, &Group::key);
        if (group == trial.groups_.end()) {
            std::ranges::iter_swap(tiles.begin(), std::ranges::find(tiles, *pass.tile_rows));
            const std::vector<double> unknown(tiles.size(), std::numeric_limits<double>::infinity());
            group = trial.groups_.insert(group, {key, std::move(tiles), unknown, {}});
        }
        group->passes.push_back(i);
    }
    return trial;
}

Status TileTrial::set_tile(Plan& plan, const Group& group, uint32_t tile, const DeviceLimits& limits)
{
    for (const size_t i : group.passes) {
        plan.passes[i].set_tile(tile, limits);
        SR_CHECK(stage::count_groups(plan.passes[i], limits));
    }
    return {};
}

uint32_t TileTrial::best_of(const Group& group)
{
    const size_t best = size_t(std::ranges::min_element(group.seconds) - group.seconds.begin());
    return group.tiles[group.seconds[best] < kClearly * group.seconds[0] ? best : 0];
}

Status TileTrial::next(Plan& plan, std::span<const double> seconds, const DeviceLimits& limits, TileChoices& choices)
{
    ++run_;
    for (Group& group : groups_) {
        double sum = 0;
        for (const size_t i : group.passes)
            sum += seconds[i];
        double& least = group.seconds[(run_ - 1) % group.tiles.size()];
        if (sum > 0)
            least = std::min(least, sum);
        if (run_ < kTurns * group.tiles.size()) {
            SR_CHECK(set_tile(plan, group, group.tiles[run_ % group.tiles.size()], limits));
            continue;
        }
        const uint32_t best = best_of(group);
        SR_CHECK(set_tile(plan, group, best, limits));
        choices.set(group.key, best);
    }
    std::erase_if(groups_, [&](const Group& g) { return run_ >= kTurns * g.tiles.size(); });
    return {};
}

} // namespace semrover
