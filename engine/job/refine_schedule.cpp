// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refine_schedule.h"

#include <algorithm>

namespace semrover {

namespace {

// the store does not have all that the part gives of these frames
bool is_left(const RefineStore& store, FramePart part, const RefinedCamera& camera, const FrameWindow& frames)
{
    const PieceKind kinds[] = {PieceKind::encoded, PieceKind::latent, PieceKind::frame};
    for (uint32_t f = frames.next(); f < frames.end(); ++f)
        if (!store.has(kinds[int(part)], camera.buffers, f))
            return true;
    return false;
}

} // namespace

RendererWork work_left(const RefineStore& store, const RefinedCamera& camera)
{
    RendererWork w = camera.work;
    w.encode = w.denoise = w.decode = false;
    for (const FrameWindow& window : camera.windows) {
        w.decode |= is_left(store, FramePart::decode, camera, window);
        if (!is_left(store, FramePart::denoise, camera, window))
            continue;
        w.denoise = true;
        w.encode |= is_left(store, FramePart::encode, camera, {window.first, window.count, 0});
    }
    return w;
}

RefineSchedule::RefineSchedule(const RefineStore& store, std::span<const RefinedCamera> cameras,
                               const RefineOrder& order, const JobCallbacks& callbacks, const Device& device)
    : store_(store), order_(order), callbacks_(callbacks), device_(device)
{
    const bool staged = order.policy == MemoryPolicy::staged;
    SR_ASSERT(!staged || !order.drawn, "frames that are being drawn are refined one by one");
    std::vector<FrameTask> encode, decode;
    Stage s{"refine", "steps", 0, 0, {}};
    for (const auto& [camera, window] : windows_in_order(cameras)) {
        s.total += order.steps;
        const bool left = is_left(store, FramePart::denoise, *camera, window);
        std::vector<FrameTask> first, last = decode_tasks(*camera, window);
        if (left)
            first = encode_tasks(*camera, window);
        else
            s.before += order.steps;
        std::vector<FrameTask>&encode_to = staged ? encode : s.tasks, &decode_to = staged ? decode : s.tasks;
        encode_to.insert(encode_to.end(), first.begin(), first.end());
        if (left)
            s.tasks.push_back({FramePart::denoise, camera, window, window});
        decode_to.insert(decode_to.end(), last.begin(), last.end());
    }
    add_stage("encode", std::move(encode));
    stages_.push_back(std::move(s));
    add_stage("decode", std::move(decode));
}

// of frames
void RefineSchedule::add_stage(std::string_view name, std::vector<FrameTask> tasks)
{
    if (tasks.empty())
        return;
    Stage s{name, "frames", 0, 0, std::move(tasks)};
    for (const FrameTask& t : s.tasks)
        s.total += t.frames.made();
    stages_.push_back(std::move(s));
}

// the network sees the buffers of all frames of a window, whether these are known or not
std::vector<FrameTask> RefineSchedule::encode_tasks(const RefinedCamera& camera, const FrameWindow& window)
{
    std::vector<FrameTask> tasks;
    for (uint32_t f = std::max(window.first, encoded_[&camera]); f < window.end(); ++f)
        if (const FrameWindow frame{f, 1, 0}; is_left(store_, FramePart::encode, camera, frame))
            tasks.push_back({FramePart::encode, &camera, frame, window});
    encoded_[&camera] = window.end();
    return tasks;
}

std::vector<FrameTask> RefineSchedule::decode_tasks(const RefinedCamera& camera, const FrameWindow& window) const
{
    std::vector<FrameTask> tasks;
    for (const FrameWindow& frames : decode_windows(window, camera.work.decode_frames))
        if (is_left(store_, FramePart::decode, camera, frames))
            tasks.push_back({FramePart::decode, &camera, frames, window});
    return tasks;
}

RefineSchedule::Windows RefineSchedule::windows_in_order(std::span<const RefinedCamera> cameras) const
{
    Windows windows;
    if (!order_.drawn) {
        for (const RefinedCamera& c : cameras)
            for (const FrameWindow& w : c.windows)
                windows.emplace_back(&c, w);
        return windows;
    }
    std::map<std::string, std::pair<const RefinedCamera*, uint32_t>> next; // frame of a camera
    for (const RefinedCamera& c : cameras)
        next[c.name] = {&c, 0};
    for (const CameraFrame& drawn : order_.drawn->frames) {
        auto& [camera, frame] = next[drawn.camera];
        if (frame >= camera->range.first && frame <= camera->range.last)
            windows.emplace_back(camera, camera->windows[frame - camera->range.first]);
        ++frame;
    }
    return windows;
}

const FrameTask* RefineSchedule::task() const
{
    return stage_ < stages_.size() && !at_end_of_stage() ? &stages_[stage_].tasks[task_] : nullptr;
}

void RefineSchedule::count(bool done)
{
    const Stage& s = stages_[stage_];
    const FrameTask& t = s.tasks[task_];
    const size_t units = s.unit == "frames" ? t.frames.made() : t.part == FramePart::denoise ? 1 : 0;
    task_ += done ? 1 : 0;
    counted_ += units;
    if (units)
        report(false);
}

void RefineSchedule::enter()
{
    if (reported_ || stage_ == stages_.size())
        return;
    reported_ = true;
    counted_ = stages_[stage_].before;
    report(false);
}

void RefineSchedule::leave()
{
    if (reported_)
        report(true);
    reported_ = false;
    task_ = 0;
    ++stage_;
}

void RefineSchedule::report(bool ended) const
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
