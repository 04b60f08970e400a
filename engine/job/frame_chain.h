// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/budget_meter.h"
#include "engine/job/refinement.h"
#include "engine/refine/frame_history.h"
#include "engine/refine/frame_renderer.h"

namespace semrover {

// The frames of one camera, refined as a host program draws them: each from its splat buffer and the frame before.
// `refine` (begin_refinement) makes the same bytes of the same buffers, model, seed, steps and camera name. Both
// networks stay on the device where they fit its budget, and are loaded in turn for every frame where they do not.
class FrameChain {
  public:
    // Loads the networks, unless others have, and compiles them, where they stay. renderer: of open_renderer(), for the
    // model of the networks, of single frames. camera: its name, part of the noise key; empty: the only one. Errors:
    // usage for a renderer of videos; bad_input for weights that do not fit the model; out_of_memory when no policy
    // fits
    static Result<std::unique_ptr<FrameChain>> create(Device& device, std::shared_ptr<LoadedNetworks> networks,
                                                      Refinement renderer, const ImageSize& size,
                                                      const std::string& camera);

    // the splat buffer of the next frame, PixelWords::seen: to be filled before begin(), and left alone until the frame
    // is done
    const Slot& seen() const { return seen_; }
    Status fill(const Slot& seen); // a copy, behind what was submitted before
    // a host's millimetres on their way here, two a word; none where nobody reads them
    const Slot& depths() const { return depths_; }
    bool follows_surfaces() const { return r_.follows_surfaces(); }

    // One frame: begin, step until it says true; the result is texels() until the next frame ends. With
    // follows_surfaces(), camera and depth say what it shares with the frame before; else they are not read. A step
    // works for what the budget has room for, one submit at least: the encoder, a step of denoising, or the decoder. An
    // error gives the frame up, as cancel() does: the chain is as it was before begin(). Errors: internal where the
    // networks return NaN or infinity; device errors
    Status begin(const CameraFrame& camera, const ImageGray16& depth);
    Result<bool> step(const JobBudget& budget);
    Status cancel();
    bool busy() const { return stage_ != Stage::idle; }

    void restart(); // the next frame has none before it

    const Slot& texels() const { return texels_; } // [height * width] u32: red, green, blue, 255
    uint32_t frames() const { return frames_; }    // finished since the chain began
    const Refinement& renderer() const { return r_; }
    const MemoryPlan& memory() const { return memory_; }

  private:
    enum class Stage { idle, encode, denoise, decode };
    FrameChain(Device& device, Refinement renderer, const ImageSize& size, const std::string& camera);
    Status make(std::shared_ptr<LoadedNetworks> networks);
    Status submit();
    Status encode();
    Status denoise();
    Status decode();
    Status keep_latent();
    AsdStart start() const;
    bool warped() const { return r_.frame_noise == FrameNoise::warped; }
    bool resident() const { return memory_.policy == MemoryPolicy::resident; }

    Device& device_;
    Refinement r_;
    LatentSize size_;
    uint32_t key_; // of the camera
    MemoryPlan memory_;
    State state_;
    Slot seen_, depths_, bytes_, texels_;
    Slot last_; // latent of the frame before
    std::unique_ptr<CopyRing> copies_;
    std::unique_ptr<Program> to_texels_;
    std::unique_ptr<FrameRenderer> renderer_;

    Stage stage_ = Stage::idle;
    uint32_t frames_ = 0;
    std::unique_ptr<FrameHistory> history_; // null: a finished frame holds nothing of the one before
    CameraFrame camera_;                    // of the frame that has begun, and its depth
    ImageGray16 depth_;
    NoiseTrail trail_, next_trail_;                // of the frames before, and with the one that has begun
    std::vector<float> last_on_host_, new_latent_; // where the networks take turns
    SubmitCost cost_[3];                           // of the stages
};

} // namespace semrover
