// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/measurements.h"

#include "runtime/base/hash.h"
#include "runtime/graph/protocol.h"

#include <algorithm>
#include <charconv>
#include <limits>

namespace semrover {

namespace {

bool is_tile(const KernelVariant& variant, uint32_t constant)
{
    for (const std::string_view name :
         {protocol::kTileRows, protocol::kTileCols, protocol::kSubgroups, protocol::kStep, protocol::kThreads})
        if (const ConstantInfo* c = variant.constant(name); c && c->id == constant)
            return true;
    return false;
}

// a number with nothing behind it
template <typename T>
std::optional<T> number(std::string_view text, int base)
{
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
    if (error != std::errc() || end != text.data() + text.size())
        return std::nullopt;
    return value;
}

constexpr double kLeastSeconds = 1e-4;  // of a measured pass: shorter ones are mostly the start of a dispatch
constexpr double kLeastRatio = 1. / 64; // of seconds to estimated ones, so that one odd measurement does no harm

constexpr size_t kTurns = 2;      // of each tile: the first run of a program finds caches cold and clocks low
constexpr double kClearly = 0.97; // of the time of the planner's tile, below which another one is taken

} // namespace

TileChoices::Key TileChoices::key(const Pass& pass)
{
    Hash hash;
    const auto add = [&](auto value) { hash.add(std::as_bytes(std::span(&value, 1))); };
    hash.add(std::as_bytes(pass.variant->code));
    for (const auto& [id, value] : pass.constants)
        if (!is_tile(*pass.variant, id)) {
            add(id);
            add(value);
        }
    for (const uint32_t size : {pass.grid.x, pass.grid.y, pass.grid.z})
        add(size);
    for (const PassBinding& b : pass.bindings)
        add(b.bytes);
    return hash.value();
}

std::optional<uint32_t> TileChoices::best(Key key) const
{
    const auto found = best_.find(key);
    return found == best_.end() ? std::nullopt : std::optional(found->second);
}

std::string TileChoices::text() const
{
    std::string text;
    for (const auto& [key, tile] : best_)
        text += fmt::format("{:016x} {}\n", key, tile);
    return text;
}

void TileChoices::read(std::string_view text)
{
    for (size_t end = text.find('\n'); end != text.npos; text.remove_prefix(end + 1), end = text.find('\n')) {
        const std::string_view line = text.substr(0, end);
        const size_t space = line.find(' ');
        if (space == line.npos)
            continue;
        const auto key = number<Key>(line.substr(0, space), 16);
        const auto tile = number<uint32_t>(line.substr(space + 1), 10);
        if (key && tile)
            set(*key, *tile);
    }
}

void WorkRates::learn(const Pass& pass, double seconds)
{
    if (seconds < kLeastSeconds)
        return;
    Measured& m = measured_[pass.variant];
    m.estimated += estimated_seconds(pass);
    m.seconds += seconds;
}

double WorkRates::seconds(const Pass& pass) const
{
    const double estimated = estimated_seconds(pass);
    const auto found = measured_.find(pass.variant);
    if (found == measured_.end() || found->second.estimated <= 0)
        return estimated;
    // where the data decides, the next data may have all that there can be
    const double least = pass.options.most_operations > 0 ? 1 : kLeastRatio;
    return estimated * std::max(found->second.seconds / found->second.estimated, least);
}

std::vector<double> WorkRates::seconds(const Plan& plan) const
{
    std::vector<double> out;
    for (const Pass& pass : plan.passes)
        out.push_back(seconds(pass));
    return out;
}

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
