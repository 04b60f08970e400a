// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/noise_trail.h"
#include "engine/network/unet.h"
#include "engine/sampling/repaint.h"
#include "engine/sampling/step_loop.h"
#include "kernels/sampling.h"
#include "runtime/device/arena.h"

#include <functional>
#include <optional>
#include <span>

namespace semrover {

// What a renderer's UNet is conditioned on, the same for every frame.
struct Conditioning {
    uint32_t tokens = 0;
    std::span<const float> text;       // [tokens, cross_attention_dim]
    std::span<const float> added = {}; // of a video: such as frames a second, motion and noise of the image
};

// device memory of a part of a renderer, beside the weights
struct PartBytes {
    uint64_t state = 0; // of its own
    ArenaSize arena;    // of its executables, which run one after the other

    uint64_t bytes() const { return state + arena.bytes(); }
};

// What the steps of a denoiser read and do not change: the rows of its sampling plan, and what the UNet makes of the
// timesteps and of the text, which is computed once.
struct DenoiserTables {
    uint32_t first_rows, tokens; // first_rows: of the step table, before the plan's
    DeviceTensor steps, clock, times, text;

    // declares the slots; what `plan` holds may change afterwards, its size may not
    DenoiserTables(TensorPool& state, const Unet& unet, const SamplingPlan& plan, uint32_t rows_before,
                   uint32_t text_tokens);
    StepTable in(Graph& g) const { return {steps.in(g), clock.in(g)}; }
    TextContext context(Graph& g) const { return {text.in(g), tokens, 0}; }

    // adds what makes `times` and `text`
    void add(Graph& g, const Unet& unet) const;
    Status write(Device& device, const SamplingPlan& plan, std::span<const StepRow> before,
                 const Conditioning& conditioning) const;

  private:
    DeviceTensor timesteps_, added_, context_; // what `times` and `text` are made of
};

// Frames that are denoised together, one or a window of them; pixels are those of the latent.
struct DenoiserWindow {
    uint32_t number = 0;              // of its first frame, part of the noise key
    uint32_t chain = 0;               // of the camera, likewise
    std::span<const float> buffers;   // [frames, pixels, C] latents of the splat buffers
    std::span<const float> visible;   // [frames, pixels] 0..1
    std::span<const float> known{};   // latents that are done; ASD: [pixels, C] of the frame before, empty for a first
                                      // frame; VSD: [up to frames, pixels, C] of the window's first frames
    std::span<const NoiseKey> keys{}; // [frames, pixels]; empty: each pixel's own, of its frame
};

// The denoising half of a deferred renderer, for one picture size and one number of frames. Its graphs are built once
// and replayed for every step, one submit a step. The result depends on nothing but the window, the plan and the seed.
class Denoiser {
  public:
    virtual ~Denoiser();
    Denoiser(const Denoiser&) = delete;
    Denoiser& operator=(const Denoiser&) = delete;

    // called after every step; returning false stops (ErrorCode::interrupted)
    using StepCallback = std::function<bool(size_t done, size_t total)>;
    // -> [frames, pixels, C] latents. Errors: internal when the network returns NaN or infinity; interrupted; device
    // errors
    Result<std::vector<float>> render(const DenoiserWindow& window, const StepCallback& callback = {});

    // the same, piecewise: begin, step until it says true, finish. A window that has begun ends with finish, cancel, or
    // the next begin. One row of the plan is one submit. What the window's spans show is copied by begin.
    Status begin(const DenoiserWindow& window);
    Result<bool> step(size_t submits);
    Result<std::vector<float>> finish();
    Status cancel();
    // [frames, pixels, C] of a window that is not finished, or was cancelled
    Result<std::vector<float>> state() const;

    uint32_t frames() const;
    size_t steps() const { return plan_.rows.size(); }
    size_t steps_done() const { return loop_ ? loop_->rows_done() : 0; }
    const Executable& step_executable() const { return *step_; }

  protected:
    // What stays on the device from step to step, and the graphs over it. A window's frames are images one after the
    // other.
    struct Memory {
        const Unet& unet;
        const SamplingPlan& plan;
        uint64_t seed;
        uint32_t width, height, pixels, image_rows, frames, channels, halves; // halves: 2 with guidance
        TensorPool state;
        DenoiserTables tables;
        DeviceTensor table_row;       // of each image
        DeviceTensor cells, known;    // of each pixel: key of its noise, and 1 where it is not to change
        DeviceTensor x, x0;           // the state, and the prediction of the row before
        DeviceTensor buffer, visible; // of the splat buffers
        DeviceTensor bad;             // first_non_finite() of each frame

        struct Shape {
            LatentSize size;
            uint32_t frames = 1, halves = 1, rows_before = 0, text_tokens = 0;
        };
        Memory(const Unet& unet, const SamplingPlan& plan, const Shape& shape, uint64_t seed);
        virtual ~Memory() = default;
        uint32_t rows() const { return frames * image_rows; }
        DeviceTensor latent(const char* name) { return state.tensor(rows(), channels, DType::f32, name); }
        Tensor normals(Graph& g, StepTable steps) const;

        virtual Graph
        tables_graph(const DeviceLimits& limits) const; // once: what depends on the timestep or the text only
        virtual Graph begin_graph(const DeviceLimits& limits) const = 0; // once a window: the first state
        virtual Graph step_graph(const DeviceLimits& limits) const = 0;
        Graph check_graph(const DeviceLimits& limits) const;
        Result<PartBytes> planned(const DeviceLimits& limits) const;
    };
    Denoiser(Device& device, const SamplingPlan& plan) : device_(device), plan_(plan) {}

    // allocates and computes what lasts. before: rows of the step table before the plan's
    Status make(std::unique_ptr<Memory> memory, std::span<const StepRow> before, const Conditioning& conditioning,
                SharedArena arena);
    virtual Status write_tables() const { return {}; } // beside DenoiserTables, before tables_graph() runs
    virtual Status upload(const DenoiserWindow& window) const = 0;
    virtual Status after_begin(const DenoiserWindow&) const { return {}; } // what begin_graph() shall not see

    Device& device_;
    SamplingPlan plan_;

  private:
    Status upload_keys(const DenoiserWindow& window) const;

    std::unique_ptr<Memory> memory_;
    SharedArena arena_; // of the executables
    std::unique_ptr<Executable> begin_, step_, check_;
    std::optional<StepLoop> loop_;
};

} // namespace semrover
