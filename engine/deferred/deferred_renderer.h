// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/frame_codec.h"
#include "engine/deferred/frame_history.h"
#include "engine/deferred/loaded_networks.h"
#include "engine/deferred/memory_plan.h"
#include "engine/deferred/renderer_settings.h"

#include <map>

namespace semrover {

// The frames of one camera: a chain that depends on no other, each frame or window of frames on the one before.
struct CameraChain {
    std::string name;                         // of the camera, part of the noise key; empty: the only one
    RendererWork work;                        // what is wanted of it
    uint32_t first = 0, before = 0;           // the first frame that is made, and how many before it are done
    CameraModel model = CameraModel::pinhole; // of the first frame's lens
    bool warped_noise = false;                // noise stays on surfaces; else each frame has its own
    float history = 0;                        // share of the frame before in a finished one (FrameHistory)
    const LatentSize& size() const { return work.size; }
};

enum class FramePart { encode, denoise, decode };

// a part of the work on a frame, or on the frames of a window
struct FrameTask {
    FramePart part;
    const CameraChain* chain;
    FrameWindow frames; // encode: one; denoise: the window; decode: those that are decoded together
    FrameWindow window; // that they are denoised in

    uint32_t frame() const { return frames.next(); } // the first that the task makes
};

// what a frame shows, where surfaces are followed from one to the next
struct FrameView {
    CameraFrame camera;
    DepthPicture depth; // [image_height, image_width]
};

// Where a renderer's frames come from and go to: files, or an application's memory. Of a chain, frames come in order.
// What was made before and is not at hand any more is loaded again; who keeps nothing is not asked for it.
class FrameStore {
  public:
    virtual ~FrameStore() = default;

    // what splats cover, [image pixels] u32 as splat_pixels() makes it, to the encoder's slot
    virtual Status read_seen(const CameraChain& chain, uint32_t frame, const DeviceTensor& to) = 0;
    virtual Result<FrameView> view(const CameraChain& chain, uint32_t frame) = 0;
    // pixels: as picture_bytes() makes them, good until the next task
    virtual Status save_frame(const CameraChain& chain, uint32_t frame, const DeviceTensor& pixels) = 0;
    virtual Status save_latent(const CameraChain&, uint32_t, const std::vector<float>&) { return {}; }

    // true: save_encoded() takes what the staged policy encodes, all of it before anything is denoised
    virtual bool keeps_encoded() const { return false; }
    virtual Status save_encoded(const CameraChain& chain, uint32_t frame, std::vector<float> latent);
    virtual Result<EncodedBuffer> load_encoded(const CameraChain& chain, uint32_t frame);
    virtual Result<std::vector<float>> load_latent(const CameraChain& chain, uint32_t frame);
    // [image_height, image_width, 3] of a finished frame; empty where it was not kept without a loss
    virtual Result<std::vector<uint8_t>> load_frame(const CameraChain& chain, uint32_t frame);
};

// The deferred renderer at work: frames from splat buffers, one by one (ASD) or in windows (VSD), for any number of
// cameras on one set of weights (docs/method.md §6). The caller gives tasks in an order that makes sense: a window is
// denoised after its frames were encoded and the window before was denoised, and decoded after that. Frames depend
// neither on the memory policy nor on the order of cameras.
class DeferredRenderer {
  public:
    // Loads what the chains' work wants; with the resident policy, of a plan for these chains, it stays, and so do the
    // programs for chains of the same size. chains, store: outlive it. Errors: bad_input for weights that do not fit
    // the model; device errors
    static Result<std::unique_ptr<DeferredRenderer>> create(Device& device, std::shared_ptr<LoadedNetworks> networks,
                                                            RendererSettings settings, MemoryPlan plan,
                                                            std::span<const CameraChain* const> chains,
                                                            FrameStore& store);
    // One submit: a step of denoising, or pictures through the VAE; true: the task is done. After an error, cancel().
    // Errors: internal for NaN, with the frame and what was made; device errors
    Result<bool> step(const FrameTask& task);
    Status cancel(); // the window that is being denoised, which begins again; waits for what was submitted
    // `frame` and those after it were never made: the chain is as it was before them
    void forget(const CameraChain& chain, uint32_t frame);

    const RendererSettings& settings() const { return settings_; }
    const MemoryPlan& memory() const { return plan_; }
    const RendererModel& model() const { return networks_.model(); }

  private:
    // what later frames may want of one
    struct Frame {
        EncodedBuffer encoded;
        std::optional<NoiseTrail> noise; // followed up to the frame
        std::vector<float> latent;
    };
    struct Chain {
        std::map<uint32_t, Frame> frames;      // from the one before the window at work on
        std::unique_ptr<FrameHistory> history; // null: a finished frame holds nothing of the one before
        std::optional<uint32_t> finished;      // the frame after the last one of the history
    };
    DeferredRenderer(Device& device, std::shared_ptr<LoadedNetworks> networks, RendererSettings settings,
                     MemoryPlan plan, FrameStore& store);
    bool staged() const { return plan_.policy == MemoryPolicy::staged; }
    bool video() const { return model().video(); }
    Status load(const RendererBytes::Size& size);
    Status make(FramePart part);
    Status make_denoiser();
    Status use(const RendererWork& work, FramePart part);
    void drop_parts();

    Status encode(const FrameTask& task);
    Result<bool> denoise(const FrameTask& task);
    Status begin_window(const FrameTask& task);
    Status end_window(const FrameTask& task);
    Status decode(const FrameTask& task);
    Status decode_latents(const CameraChain& chain, const FrameWindow& frames);
    Status catch_up(const CameraChain& chain, uint32_t frame);
    Status accumulate(const CameraChain& chain, uint32_t frame);
    Result<const EncodedBuffer*> encoded(const CameraChain& chain, uint32_t frame);
    Result<std::span<const float>> latent(const CameraChain& chain, uint32_t frame);
    Result<std::span<const NoiseKey>> noise(const CameraChain& chain, uint32_t frame);

    Device& device_;
    NetworksInUse networks_;
    RendererSettings settings_;
    MemoryPlan plan_;
    FrameStore& store_;
    std::map<const CameraChain*, Chain> chains_;

    RendererWork work_; // of the parts that are there
    SharedArena arena_; // of all parts; null with the staged policy
    std::unique_ptr<FrameEncoder> encoder_;
    std::unique_ptr<Denoiser> denoiser_;
    std::unique_ptr<FrameDecoder> decoder_;
    bool begun_ = false; // a window is being denoised
};

// The memory of a renderer at work, with `beside` bytes that stay beside it. Networks that others use count once, and
// those that are only kept may be dropped. Errors: out_of_memory when no policy fits
Result<MemoryPlan> plan_renderer(Device& device, const LoadedNetworks& networks, const RendererSettings& settings,
                                 std::span<const RendererWork> work, uint64_t beside);

} // namespace semrover
