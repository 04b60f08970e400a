// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/autotuner.h"

#include "runtime/base/hash.h"

#include <algorithm>
#include <charconv>
#include <limits>

namespace semrover {

namespace {

// is it one that alternatives set?
bool is_tuned(const Pass& pass, uint32_t constant)
{
    for (const Alternative& a : pass.options.alternatives)
        for (const ConstantValue& value : a.constants)
            if (const ConstantInfo* c = pass.variant->constant(value.name); c && c->id == constant)
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

constexpr size_t kTurns = 2; // of each alternative: the first run of an executable finds caches cold and clocks low
constexpr double kClearly = 0.97; // of the time of the first one, below which another one is taken

} // namespace

TuningCache::Key TuningCache::key(const Pass& pass)
{
    Hash hash;
    const auto add = [&](auto value) { hash.add(std::as_bytes(std::span(&value, 1))); };
    hash.add(std::as_bytes(pass.variant->code));
    for (const auto& [id, value] : pass.constants)
        if (!is_tuned(pass, id)) {
            add(id);
            add(value);
        }
    for (const Alternative& a : pass.options.alternatives) {
        add(a.tile.rows);
        add(a.tile.cols);
        for (const ConstantValue& c : a.constants) {
            hash.add(std::as_bytes(std::span(c.name)));
            add(c.value);
        }
    }
    for (const uint32_t size : {pass.grid.x, pass.grid.y, pass.grid.z})
        add(size);
    for (const PassBinding& b : pass.bindings)
        add(b.bytes);
    return hash.value();
}

std::optional<uint32_t> TuningCache::best(Key key) const
{
    const auto found = best_.find(key);
    return found == best_.end() ? std::nullopt : std::optional(found->second);
}

std::string TuningCache::text() const
{
    std::string text;
    for (const auto& [key, tile] : best_)
        text += fmt::format("{:016x} {}\n", key, tile);
    return text;
}

void TuningCache::read(std::string_view text)
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

Result<Autotuner> Autotuner::begin(Plan& plan, const DeviceLimits& limits, const TuningCache& cache)
{
    Autotuner tuner;
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        Pass& pass = plan.passes[i];
        const size_t count = pass.options.alternatives.size();
        if (count < 2)
            continue;
        const TuningCache::Key key = TuningCache::key(pass);
        if (const auto best = cache.best(key); best && *best < count) {
            tuner.changed_ |= pass.alternative != *best;
            pass.take(*best);
            SR_CHECK(stage::count_groups(pass, limits));
            continue;
        }
        auto group = std::ranges::find(tuner.groups_, key, &Group::key);
        if (group == tuner.groups_.end())
            group = tuner.groups_.insert(
                group, {key, std::vector<double>(count, std::numeric_limits<double>::infinity()), {}});
        group->passes.push_back(i);
    }
    return tuner;
}

Status Autotuner::take(Plan& plan, const Group& group, uint32_t alternative, const DeviceLimits& limits)
{
    for (const size_t i : group.passes) {
        plan.passes[i].take(alternative);
        SR_CHECK(stage::count_groups(plan.passes[i], limits));
    }
    return {};
}

uint32_t Autotuner::best_of(const Group& group)
{
    const auto best = std::ranges::min_element(group.seconds);
    return *best < kClearly * group.seconds[0] ? uint32_t(best - group.seconds.begin()) : 0;
}

Status Autotuner::next(Plan& plan, std::span<const double> seconds, const DeviceLimits& limits, TuningCache& cache)
{
    ++run_;
    for (Group& group : groups_) {
        double sum = 0;
        for (const size_t i : group.passes)
            sum += seconds[i];
        const size_t count = group.seconds.size();
        double& least = group.seconds[(run_ - 1) % count];
        if (sum > 0)
            least = std::min(least, sum);
        const bool more = run_ < kTurns * count;
        const uint32_t next = more ? uint32_t(run_ % count) : best_of(group);
        SR_CHECK(take(plan, group, next, limits));
        if (!more)
            cache.set(group.key, next);
    }
    std::erase_if(groups_, [&](const Group& g) { return run_ >= kTurns * g.seconds.size(); });
    return {};
}

} // namespace semrover
