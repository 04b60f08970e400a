// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/deferred_renderer.h"
#include "engine/job/budget_meter.h"

namespace semrover {

// The frames of one camera, as the application draws them: each from its splat buffer and the frame before, on its way
// from device memory to device memory. `refine` makes the same bytes of the same buffers, model, seed, steps and camera
// name.
class CameraRenderer : private FrameStore {
  public:
    // Loads the networks and compiles them, where they stay. camera: its name, part of the noise key; empty: the only
    // one. Errors: usage for a renderer of videos, and sizes; as DeferredRenderer::create and plan_renderer
    static Result<std::unique_ptr<CameraRenderer>> create(Device& device, std::shared_ptr<LoadedNetworks> networks,
                                                          RendererSettings settings, const ImageSize& size,
                                                          const std::string& camera);

    // the splat buffer of the next frame, PixelWords::seen: to be filled before begin(), and left alone until the frame
    // is done
    const DeviceTensor& seen() const { return seen_; }
    Status fill(const DeviceTensor& seen); // a copy, behind what was submitted before
    // the application's millimetres on their way here, two a word; none where nobody reads them
    const DeviceTensor& depths() const { return depths_; }

    // One frame: begin, step until it says true; the result is texels() until the next frame ends. Where
    // settings().follows_surfaces(), the view says what it shares with the frame before; else it is not read. A step
    // works for what the budget has room for, one submit at least: the encoder, a step of denoising, or the decoder. An
    // error gives the frame up, as cancel() does: the camera is as it was before begin(). Errors: internal where the
    // networks return NaN or infinity; device errors
    Status begin(FrameView view);
    Result<bool> step(const JobBudget& budget);
    Status cancel();
    bool busy() const { return busy_; }

    void restart(); // the next frame has none before it

    const DeviceTensor& texels() const { return texels_; } // [height * width] u32: red, green, blue, 255
    uint32_t frames() const { return frames_; }            // finished since the camera began
    const RendererSettings& settings() const { return renderer_->settings(); }
    const RendererModel& model() const { return renderer_->model(); }
    const MemoryPlan& memory() const { return renderer_->memory(); }

  private:
    CameraRenderer(Device& device, const LatentSize& size, const RendererSettings& settings, const std::string& camera);
    Status make(std::shared_ptr<LoadedNetworks> networks, RendererSettings settings);
    Status read_seen(const CameraChain& chain, uint32_t frame, const DeviceTensor& to) override;
    Result<FrameView> view(const CameraChain& chain, uint32_t frame) override;
    Status save_frame(const CameraChain& chain, uint32_t frame, const DeviceTensor& pixels) override;

    Device& device_;
    CameraChain chain_;
    TensorPool state_;
    DeviceTensor seen_, depths_, bytes_, texels_;
    std::unique_ptr<CopyRing> copies_;
    std::unique_ptr<Executable> to_texels_;
    std::unique_ptr<DeferredRenderer> renderer_;

    bool busy_ = false;
    FramePart part_ = FramePart::encode; // that the frame is in
    uint32_t frames_ = 0;
    FrameView view_;     // of the frame that has begun
    SubmitCost cost_[3]; // of the parts
};

} // namespace semrover
