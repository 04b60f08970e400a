// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/unet.h"
#include "engine/sampling/repaint.h"
#include "engine/sampling/replay.h"
#include "kernels/sampling.h"

#include <span>

namespace semrover {

// The text of a renderer, the same for every frame
struct Conditioning {
    uint32_t tokens = 0;
    std::span<const float> values; // [tokens, cross_attention_dim]
};

// numbers that come with a video, such as frames a second, motion and noise of the image; SVD's UNet takes these three
struct VideoConditioning {
    Conditioning text;
    std::span<const float> added = {};
};

// What the steps of a denoiser read and do not change: the rows of its sampling plan, and what the UNet makes of the
// timesteps and of the text, which is computed once.
struct DenoiserTables {
    uint32_t first_rows, tokens; // first_rows: of the step table, before the plan's
    Slot steps, clock, times, text;

    // declares the slots; what `plan` holds may change afterwards, its size may not
    DenoiserTables(State& state, const Unet& unet, const SamplingPlan& plan, uint32_t rows_before,
                   uint32_t text_tokens);
    StepTable in(Graph& g) const { return {steps.in(g), clock.in(g)}; }
    TextContext context(Graph& g) const { return {text.in(g), tokens, 0}; }

    // adds what makes `times` and `text`
    void add(Graph& g, const Unet& unet) const;
    Status write(Device& device, const SamplingPlan& plan, std::span<const StepRow> before,
                 const VideoConditioning& conditioning) const;

  private:
    Slot timesteps_, added_, context_; // what `times` and `text` are made of
};

} // namespace semrover
