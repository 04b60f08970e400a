// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/refine/denoiser_tables.h"
#include "engine/refine/latent_codec.h"
#include "engine/refine/noise_trail.h"

#include <functional>
#include <optional>

namespace semrover {

struct AsdOptions {
    float guidance_scale = 1.5f; // 1: no unconditional half
    float previous_noise = 0.3f; // standard deviation of the noise on the previous frame's latent
    uint64_t seed = 0;
    // golden cases only: normals come from the caller, [pixels, C] for the first state and for the previous latent
    std::function<void(uint32_t frame, std::span<float> initial, std::span<float> previous)> noise;
};

// one frame of a chain; pixels are those of the latent
struct AsdFrame {
    uint32_t number = 0;              // of the frame, part of the noise key
    uint32_t chain = 0;               // of the camera, likewise
    std::span<const float> buffer;    // [pixels, C] latent of the splat buffer
    std::span<const float> visible;   // [pixels] 0..1
    std::span<const float> previous;  // [pixels, C] latent of the frame before; empty: the first frame
    std::span<const NoiseKey> keys{}; // [pixels]; empty: each pixel's own, of this frame
};

// a frame whose latents lie in the renderer's slots already
struct AsdStart {
    uint32_t number = 0, chain = 0;   // as of AsdFrame
    bool first = true;                // no frame before it
    std::span<const NoiseKey> keys{}; // [pixels]; empty: each pixel's own, of this frame
};

// the ends of a renderer on the device, of the shapes that LatentCodec's have
struct AsdSlots {
    Slot buffer, visible; // latent of the splat buffer, visible share of each pixel
    Slot previous;        // latent of the frame before; begin() puts noise on it
    Slot latent;          // of the frame, when it has ended
    Slot bad;             // [1] u32: first_non_finite() of it
};

// Autoregressive renderer: the UNet sees the noisy latent, the previous frame's latent with noise on it, the splat
// buffer's latent and its visibility. The graph is built once per picture size and replayed for every step, one submit
// a step; embeddings of the timesteps and keys and values of the text are computed once. The result depends on nothing
// but the frame, the plan and the seed.
class AsdRenderer {
  public:
    // errors: usage for a guidance scale or noise out of range; bad_input for a UNet of other channels; device errors
    static Result<std::unique_ptr<AsdRenderer>> create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                       const Conditioning& text, const LatentSize& size,
                                                       AsdOptions options);

    // device memory beside the UNet's weights
    struct Bytes {
        uint64_t state = 0;    // kept from frame to frame
        uint64_t programs = 0; // of the programs, while there is something to denoise
    };
    static Result<Bytes> planned_bytes(const DeviceLimits& limits, const Unet& unet, const SamplingPlan& plan,
                                       uint32_t text_tokens, const LatentSize& size, float guidance_scale);

    // called after every step; returning false stops (ErrorCode::interrupted)
    using StepCallback = std::function<bool(size_t done, size_t total)>;
    // -> [pixels, C] latent. Errors: internal when the network returns NaN or infinity; interrupted; device errors
    Result<std::vector<float>> render(const AsdFrame& frame, const StepCallback& callback = {});

    // the same, piecewise: begin, step until it says true, finish. A frame that has begun ends with finish, cancel, or
    // the next begin. One row of the plan is one submit. What the frame's spans show is copied by begin.
    Status begin(const AsdFrame& frame);
    Result<bool> step(size_t submits);
    Result<std::vector<float>> finish();
    Status cancel();

    // the same with latents that stay on the device: the caller copies them to slots().buffer, visible and (but for a
    // first frame) previous, then begin, step until it says true, end; the result is slots().latent until the next
    // begin
    const AsdSlots& slots() const;
    Status begin(const AsdStart& start);
    Status end(); // errors: internal when the network returned NaN or infinity

    size_t steps_done() const { return replay_ ? replay_->rows_done() : 0; }
    size_t steps() const { return plan_.rows.size(); }

    // makes the programs, which begin() does otherwise
    Status make_programs();
    // drops the programs and their memory until the next frame; between frames only
    void rest();

    uint32_t step_passes() const; // of a step, while there is a program
    uint32_t step_barriers() const;
    double host_us_per_step() const;
    double step_flops() const;

  private:
    struct Memory;
    AsdRenderer(Device& device, const SamplingPlan& plan, AsdOptions options);
    Status make_tables(const Conditioning& text);
    Status upload(const AsdFrame& frame);
    Status upload_keys(const AsdStart& start);

    Device& device_;
    SamplingPlan plan_;
    AsdOptions options_;
    std::unique_ptr<Memory> memory_;
    std::unique_ptr<Program> begin_, step_, check_;
    std::optional<Replay> replay_;

  public:
    ~AsdRenderer();
};

} // namespace semrover
