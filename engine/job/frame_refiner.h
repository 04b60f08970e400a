// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/refiner.h"
#include "engine/refine/frame_history.h"
#include "engine/refine/frame_renderer.h"

namespace semrover {

// Refines each frame from the one before (AsdRenderer). With the resident policy pixels and latents stay on the device,
// and files only leave it; with the staged one a stage reads what the one before wrote.
class FrameRefiner : public Refiner {
  public:
    FrameRefiner(const Parts& parts, std::unique_ptr<FrameRenderer> renderer, const RefineOrder& order,
                 const JobCallbacks& callbacks)
        : Refiner(parts, order, callbacks), renderer_(std::move(renderer))
    {
    }

    void give_buffer(const std::string& camera, const Slot& seen) override;
    bool waits() const override;

  private:
    // of a chain, while it is at work
    struct Trail {
        Slot seen;                 // of the last buffer that was given
        uint32_t given = 0;        // buffers so far
        uint32_t frame = 0;        // of `latent`
        std::vector<float> latent; // empty: none yet
        std::unique_ptr<FrameHistory> history;
        std::optional<uint32_t> finished; // the frame after the last one of the history
    };
    Status start(const RendererWork& work, const RendererWork& total) override;
    Status encode(const RefineTask& task) override;
    Status begin_window(const RefineTask& task) override;
    Result<bool> step_window() override { return renderer_->step(1); }
    Status end_window(const RefineTask& task) override;
    Status cancel_window() override { return renderer_->cancel(); }
    Status decode(const RefineTask& task) override;
    Status decode_again(const RefineTask& task, FrameHistory& history);
    Result<std::vector<uint8_t>> finished_before(const RefineTask& task) const;
    Status catch_up(const RefineTask& task);
    template <typename Decoded>
    Status accumulate(const RefineTask& task, const Decoded& decoded);
    Status read_frame(const RefineTask& task, const Slot& bytes);
    Status begin_staged(const RefineTask& task, std::span<const NoiseKey> noise);
    Status begin_resident(const RefineTask& task, std::span<const NoiseKey> noise);
    Result<std::vector<float>> latent(const RefineChain& chain, uint32_t frame);
    Result<std::vector<float>> latent_before(const RefineTask& task); // empty: it is a first frame

    std::unique_ptr<FrameRenderer> renderer_;
    const RefineChain* on_device_ = nullptr; // whose latent lies in the denoiser's slot
    uint32_t frame_on_device_ = 0;
    std::map<const RefineChain*, Trail> trails_;
};

} // namespace semrover
