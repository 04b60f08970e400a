// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refiner.h"

namespace semrover {

namespace {

// says which frame an error is about
template <typename T>
T of_frame(const RefineChain& chain, uint32_t frame, T result)
{
    if (!result && result.error().code == ErrorCode::internal)
        result.error().message = fmt::format("{}: {}", frame_text(chain.camera.name, frame), result.error().message);
    return result;
}

} // namespace

struct Refiner::Stage {
    std::string_view name, unit;
    size_t total = 0, before = 0; // of the unit
    std::vector<Task> tasks;
};

Refiner::Refiner(RefineStore& store, std::span<const RefineChain> chains) : store_(store), chains_(chains)
{
    for (const RefineChain& c : chains) {
        RendererWork w{c.size, false, false, false};
        for (uint32_t f = c.range.first; f <= c.range.last; ++f) {
            w.encode |= left(Part::encode, c, f);
            w.denoise |= left(Part::denoise, c, f);
            w.decode |= left(Part::decode, c, f);
        }
        work_.push_back(w);
    }
}
Refiner::~Refiner() = default;

bool Refiner::left(Part part, const RefineChain& chain, uint32_t frame) const
{
    if (part == Part::decode)
        return !store_.has(PieceKind::frame, chain.camera, frame);
    const bool latent = store_.has(PieceKind::latent, chain.camera, frame);
    return !latent && (part == Part::denoise || !store_.has(PieceKind::encoded, chain.camera, frame));
}

RendererWork Refiner::total() const
{
    RendererWork all{{}, false, false, false};
    for (const RendererWork& w : work_) {
        all.encode |= w.encode;
        all.denoise |= w.denoise;
        all.decode |= w.decode;
    }
    return all;
}

void Refiner::begin(FrameRenderer& renderer, MemoryPolicy policy, size_t steps, const JobCallbacks& callbacks,
                    const Device& device)
{
    renderer_ = &renderer;
    device_ = &device;
    callbacks_ = callbacks;
    steps_ = steps;
    keep_encoded_ = policy == MemoryPolicy::staged;
    plan(policy);
}

void Refiner::add_frames_stage(std::string_view name, Part part)
{
    Stage s{name, "frames", 0, 0, {}};
    for (const RefineChain& c : chains_)
        for (uint32_t f = c.range.first; f <= c.range.last; ++f)
            if (left(part, c, f))
                s.tasks.push_back({part, &c, f});
    s.total = s.tasks.size();
    if (s.total)
        stages_.push_back(std::move(s));
}

// chain by chain: all of a frame before the next where both networks are there, else stage by stage
void Refiner::plan(MemoryPolicy policy)
{
    const bool staged = policy == MemoryPolicy::staged;
    if (staged)
        add_frames_stage("encode", Part::encode);
    Stage s{"refine", "steps", 0, 0, {}};
    for (const RefineChain& c : chains_)
        for (uint32_t f = c.range.first; f <= c.range.last; ++f) {
            s.total += steps_;
            s.before += left(Part::denoise, c, f) ? 0 : steps_;
            for (Part part : {Part::encode, Part::denoise, Part::decode})
                if (left(part, c, f) && (part == Part::denoise || !staged))
                    s.tasks.push_back({part, &c, f});
        }
    stages_.push_back(std::move(s));
    if (staged)
        add_frames_stage("decode", Part::decode);
}

void Refiner::say(bool ended) const
{
    const Stage& s = stages_[stage_];
    if (callbacks_.progress)
        callbacks_.progress({.stage = s.name,
                             .unit = s.unit,
                             .done = counted_,
                             .total = s.total,
                             .done_before = s.before,
                             .device_bytes = device_->allocated_bytes(),
                             .ended = ended});
}

bool Refiner::settle()
{
    while (stage_ < stages_.size()) {
        if (!announced_) {
            counted_ = stages_[stage_].before;
            say(false);
            announced_ = true;
        }
        if (task_ < stages_[stage_].tasks.size())
            return false;
        say(true);
        ++stage_;
        task_ = 0;
        announced_ = false;
    }
    return true;
}

Result<bool> Refiner::step()
{
    SR_ASSERT(renderer_, "a refiner that has not begun");
    if (settle())
        return true;
    const Stage& s = stages_[stage_];
    const Task task = s.tasks[task_];
    SR_CHECK(renderer_->start(work_[size_t(task.chain - chains_.data())], total()));
    SR_TRY(const bool done, act(task));
    task_ += done ? 1 : 0;
    if (s.unit == "frames" || task.part == Part::denoise) {
        ++counted_;
        say(false);
    }
    return settle();
}

Status Refiner::cancel()
{
    if (!begun_)
        return {};
    begun_ = false;
    return renderer_->cancel();
}

Result<bool> Refiner::act(const Task& task)
{
    if (task.part == Part::denoise)
        return of_frame(*task.chain, task.frame, denoise(task));
    SR_CHECK(of_frame(*task.chain, task.frame, task.part == Part::encode ? encode(task) : decode(task)));
    return true;
}

Status Refiner::encode(const Task& t)
{
    SR_TRY(const BufferFrame buffer, read_buffer(t.chain->camera, t.frame));
    SR_TRY(encoded_, renderer_->encode(floats_of_pixels(buffer.color)));
    if (!keep_encoded_)
        return {};
    return store_.save_latent(PieceKind::encoded, t.chain->camera, t.frame, t.chain->size, encoded_);
}

// noise of a frame, followed from the camera's first frame on, whichever frames are refined
Result<std::span<const NoiseKey>> Refiner::keys(const RefineChain& c, uint32_t frame)
{
    if (c.cameras.empty())
        return std::span<const NoiseKey>{};
    if (trail_of_ != &c || trail_->frames() > frame + 1) {
        trail_.emplace(c.size);
        trail_of_ = &c;
    }
    while (trail_->frames() <= frame) {
        SR_TRY(const ImageGray16 depth, read_depth(c.camera, trail_->frames()));
        trail_->follow(c.cameras[trail_->frames()], depth);
    }
    return trail_->keys();
}

Status Refiner::begin_frame(const Task& t)
{
    const RefineChain& c = *t.chain;
    if (keep_encoded_ || store_.has(PieceKind::encoded, c.camera, t.frame)) {
        SR_TRY(encoded_, store_.load_latent(PieceKind::encoded, c.camera, t.frame, c.size));
    }
    SR_TRY(const BufferFrame buffer, read_buffer(c.camera, t.frame));
    const std::vector<float> visible = block_shares(c.size, buffer.visible);
    std::vector<float> previous = c.before;
    if (t.frame > c.range.first) {
        SR_TRY(previous, store_.load_latent(PieceKind::latent, c.camera, t.frame - 1, c.size));
    }
    SR_TRY(const std::span<const NoiseKey> noise, keys(c, t.frame));
    SR_CHECK(renderer_->begin({t.frame, chain_key(c.camera.name), encoded_, visible, previous, noise}));
    begun_ = true;
    return {};
}

Result<bool> Refiner::denoise(const Task& t)
{
    if (!begun_)
        SR_CHECK(begin_frame(t));
    SR_TRY(const bool done, renderer_->step(1));
    if (!done)
        return false;
    begun_ = false;
    SR_TRY(const std::vector<float> latent, renderer_->finish());
    SR_CHECK(store_.save_latent(PieceKind::latent, t.chain->camera, t.frame, t.chain->size, latent));
    return true;
}

Status Refiner::decode(const Task& t)
{
    SR_TRY(const std::vector<float> latent,
           store_.load_latent(PieceKind::latent, t.chain->camera, t.frame, t.chain->size));
    SR_TRY(const std::vector<float> image, renderer_->decode(latent));
    return store_.save_frame(t.chain->camera, t.frame, pixels_of_floats(image));
}

} // namespace semrover
