// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/refiner.h"
#include "engine/refine/window_renderer.h"

namespace semrover {

// Refines windows of frames that are denoised together (VsdRenderer). The frames that a window has from the one before
// are known to it. Its buffers are files: a drive of a grid is drawn before.
class WindowRefiner : public Refiner {
  public:
    WindowRefiner(const Parts& parts, std::unique_ptr<WindowRenderer> renderer, const RefineOrder& order,
                  const JobCallbacks& callbacks)
        : Refiner(parts, order, callbacks), renderer_(std::move(renderer))
    {
    }

    void give_buffer(const std::string& camera, const Slot& seen) override;

  private:
    // what later windows may want of a frame of the chain at work
    struct Frame {
        EncodedBuffer encoded;
        std::vector<NoiseKey> keys;
        std::vector<float> latent;
    };
    Status start(const RendererWork& work, const RendererWork& total) override { return renderer_->start(work, total); }
    Status encode(const RefineTask& task) override;
    Status begin_window(const RefineTask& task) override;
    Result<bool> step_window() override { return renderer_->step(1); }
    Status end_window(const RefineTask& task) override;
    Status cancel_window() override { return renderer_->cancel(); }
    Status decode(const RefineTask& task) override;
    // the frame, while its chain is at work
    Frame& at(const RefineChain& chain, uint32_t frame);
    Result<const EncodedBuffer*> encoded(const RefineChain& chain, uint32_t frame);
    Result<std::span<const NoiseKey>> noise(const RefineChain& chain, uint32_t frame);
    Result<std::span<const float>> latent(const RefineChain& chain, uint32_t frame);

    std::unique_ptr<WindowRenderer> renderer_;
    const RefineChain* chain_ = nullptr; // at work
    std::map<uint32_t, Frame> frames_;   // of it, from the first one of its window on
};

} // namespace semrover
