// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refine_schedule.h"

#include <algorithm>
#include <map>

namespace semrover {

namespace {

bool has_piece(const RefineStore& store, RefinePart part, const RefineChain& chain, uint32_t frame)
{
    const PieceKind kinds[] = {PieceKind::encoded, PieceKind::latent, PieceKind::frame};
    return store.has(kinds[int(part)], chain.camera, frame);
}

} // namespace

bool is_left(const RefineStore& store, RefinePart part, const RefineChain& chain, const FrameWindow& frames)
{
    for (uint32_t f = frames.next(); f < frames.end(); ++f)
        if (!has_piece(store, part, chain, f))
            return true;
    return false;
}

RendererWork whole_work(const RefineChain& chain)
{
    const uint32_t frames = chain.windows.front().count;
    return {chain.size, true, true, true, frames, std::min(chain.shape.decode_frames, frames)};
}

RendererWork work_left(const RefineStore& store, const RefineChain& chain)
{
    RendererWork w = whole_work(chain);
    w.encode = w.denoise = w.decode = false;
    for (const FrameWindow& window : chain.windows) {
        w.decode |= is_left(store, RefinePart::decode, chain, window);
        if (!is_left(store, RefinePart::denoise, chain, window))
            continue;
        w.denoise = true;
        w.encode |= is_left(store, RefinePart::encode, chain, {window.first, window.count, 0});
    }
    return w;
}

RefineSchedule::RefineSchedule(const RefineStore& store, std::span<const RefineChain> chains, const RefineOrder& order,
                               const JobCallbacks& callbacks, const Device& device)
    : store_(store), chains_(chains), order_(order), callbacks_(callbacks), device_(device)
{
    const bool staged = order.policy == MemoryPolicy::staged;
    SR_ASSERT(!staged || !order.drawn, "drawn frames are refined one by one");
    std::vector<RefineTask> encode, decode;
    Stage s{"refine", "steps", 0, 0, {}};
    for (const auto& [chain, window] : windows_in_order()) {
        s.total += order.steps;
        const bool left = is_left(store, RefinePart::denoise, *chain, window);
        std::vector<RefineTask> first, last = decode_tasks(*chain, window);
        if (left)
            first = encode_tasks(*chain, window);
        else
            s.before += order.steps;
        std::vector<RefineTask>&encode_to = staged ? encode : s.tasks, &decode_to = staged ? decode : s.tasks;
        encode_to.insert(encode_to.end(), first.begin(), first.end());
        if (left)
            s.tasks.push_back({RefinePart::denoise, chain, window, window});
        decode_to.insert(decode_to.end(), last.begin(), last.end());
    }
    add_stage("encode", std::move(encode));
    stages_.push_back(std::move(s));
    add_stage("decode", std::move(decode));
}

// of frames
void RefineSchedule::add_stage(std::string_view name, std::vector<RefineTask> tasks)
{
    if (tasks.empty())
        return;
    Stage s{name, "frames", 0, 0, std::move(tasks)};
    for (const RefineTask& t : s.tasks)
        s.total += t.frames.made();
    stages_.push_back(std::move(s));
}

// the network sees the buffers of all frames of a window, whether these are known or not
std::vector<RefineTask> RefineSchedule::encode_tasks(const RefineChain& chain, const FrameWindow& window)
{
    std::vector<RefineTask> tasks;
    for (uint32_t f = std::max(window.first, encoded_[&chain]); f < window.end(); ++f)
        if (const FrameWindow frame{f, 1, 0}; is_left(store_, RefinePart::encode, chain, frame))
            tasks.push_back({RefinePart::encode, &chain, frame, window});
    encoded_[&chain] = window.end();
    return tasks;
}

std::vector<RefineTask> RefineSchedule::decode_tasks(const RefineChain& chain, const FrameWindow& window) const
{
    std::vector<RefineTask> tasks;
    for (const FrameWindow& frames : decode_windows(chain, window))
        if (is_left(store_, RefinePart::decode, chain, frames))
            tasks.push_back({RefinePart::decode, &chain, frames, window});
    return tasks;
}

RefineSchedule::Windows RefineSchedule::windows_in_order() const
{
    Windows windows;
    if (!order_.drawn) {
        for (const RefineChain& c : chains_)
            for (const FrameWindow& w : c.windows)
                windows.emplace_back(&c, w);
        return windows;
    }
    std::map<std::string, std::pair<const RefineChain*, uint32_t>> next; // frame of a camera
    for (const RefineChain& c : chains_)
        next[c.camera.name] = {&c, 0};
    for (const CameraFrame& drawn : order_.drawn->frames) {
        auto& [chain, frame] = next[drawn.camera];
        if (frame >= chain->range.first && frame <= chain->range.last)
            windows.emplace_back(chain, chain->windows[frame - chain->range.first]);
        ++frame;
    }
    return windows;
}

const RefineTask* RefineSchedule::task() const
{
    return stage_ < stages_.size() && !at_end_of_stage() ? &stages_[stage_].tasks[task_] : nullptr;
}

bool RefineSchedule::follows_encode() const
{
    return task_ > 0 && stages_[stage_].tasks[task_ - 1].part == RefinePart::encode;
}

void RefineSchedule::count(bool done)
{
    const Stage& s = stages_[stage_];
    const RefineTask& t = s.tasks[task_];
    const size_t units = s.unit == "frames" ? t.frames.made() : t.part == RefinePart::denoise ? 1 : 0;
    task_ += done ? 1 : 0;
    counted_ += units;
    if (units)
        say(false);
}

void RefineSchedule::enter()
{
    if (told_ || stage_ == stages_.size())
        return;
    told_ = true;
    counted_ = stages_[stage_].before;
    say(false);
}

void RefineSchedule::leave()
{
    if (told_)
        say(true);
    told_ = false;
    task_ = 0;
    ++stage_;
}

void RefineSchedule::say(bool ended) const
{
    const Stage& s = stages_[stage_];
    if (callbacks_.progress)
        callbacks_.progress({.stage = s.name,
                             .unit = s.unit,
                             .done = counted_,
                             .total = s.total,
                             .done_before = s.before,
                             .device_bytes = device_.allocated_bytes(),
                             .ended = ended});
}

} // namespace semrover
