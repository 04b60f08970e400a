// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refine_schedule.h"

#include <map>

namespace semrover {

bool is_left(const RefineStore& store, RefinePart part, const RefineChain& chain, uint32_t frame)
{
    if (part == RefinePart::decode)
        return !store.has(PieceKind::frame, chain.camera, frame);
    const bool latent = store.has(PieceKind::latent, chain.camera, frame);
    return !latent && (part == RefinePart::denoise || !store.has(PieceKind::encoded, chain.camera, frame));
}

RendererWork work_left(const RefineStore& store, const RefineChain& chain)
{
    RendererWork w{chain.size, false, false, false};
    for (uint32_t f = chain.range.first; f <= chain.range.last; ++f) {
        w.encode |= is_left(store, RefinePart::encode, chain, f);
        w.denoise |= is_left(store, RefinePart::denoise, chain, f);
        w.decode |= is_left(store, RefinePart::decode, chain, f);
    }
    return w;
}

RefineSchedule::RefineSchedule(const RefineStore& store, std::span<const RefineChain> chains, const RefineOrder& order,
                               const JobCallbacks& callbacks, const Device& device)
    : chains_(chains), order_(order), callbacks_(callbacks), device_(device)
{
    const bool staged = order.policy == MemoryPolicy::staged;
    SR_ASSERT(!staged || !order.drawn, "drawn frames are refined one by one");
    if (staged)
        add_frames_stage(store, "encode", RefinePart::encode);
    Stage s{"refine", "steps", 0, 0, {}};
    for (const auto& [chain, f] : frames_in_order()) {
        s.total += order.steps;
        s.before += is_left(store, RefinePart::denoise, *chain, f) ? 0 : order.steps;
        for (RefinePart part : {RefinePart::encode, RefinePart::denoise, RefinePart::decode})
            if (is_left(store, part, *chain, f) && (part == RefinePart::denoise || !staged))
                s.tasks.push_back({part, chain, f});
    }
    stages_.push_back(std::move(s));
    if (staged)
        add_frames_stage(store, "decode", RefinePart::decode);
}

void RefineSchedule::add_frames_stage(const RefineStore& store, std::string_view name, RefinePart part)
{
    Stage s{name, "frames", 0, 0, {}};
    for (const RefineChain& c : chains_)
        for (uint32_t f = c.range.first; f <= c.range.last; ++f)
            if (is_left(store, part, c, f))
                s.tasks.push_back({part, &c, f});
    s.total = s.tasks.size();
    if (s.total)
        stages_.push_back(std::move(s));
}

std::vector<std::pair<const RefineChain*, uint32_t>> RefineSchedule::frames_in_order() const
{
    std::vector<std::pair<const RefineChain*, uint32_t>> frames;
    if (!order_.drawn) {
        for (const RefineChain& c : chains_)
            for (uint32_t f = c.range.first; f <= c.range.last; ++f)
                frames.emplace_back(&c, f);
        return frames;
    }
    std::map<std::string, std::pair<const RefineChain*, uint32_t>> next; // frame of a camera
    for (const RefineChain& c : chains_)
        next[c.camera.name] = {&c, 0};
    for (const CameraFrame& drawn : order_.drawn->frames) {
        auto& [chain, frame] = next[drawn.camera];
        if (frame >= chain->range.first && frame <= chain->range.last)
            frames.emplace_back(chain, frame);
        ++frame;
    }
    return frames;
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
    const bool counts = s.unit == "frames" || s.tasks[task_].part == RefinePart::denoise;
    task_ += done ? 1 : 0;
    counted_ += counts ? 1 : 0;
    if (counts)
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
