// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/graph.h"

// Ops of a sampling step, as those of kernels/network.h: one table of steps, one clock, the same commands for every
// step
namespace semrover {

// the state x, predictions and noise are fp32 matrices [M, N] with equal row lengths
struct StepTable {
    Tensor rows;  // [R, 16] words: StepRow (shaders/lib/step_row.h)
    Tensor clock; // [2] u32: StepClock
};
constexpr uint32_t kNoiseChannels = 4096; // of a token, at most: ten bits of the noise counter, four channels each

// clock.row += 1
void step_advance(Graph& g, Tensor clock);

// table_row[r] = row of the modulation table for the current step's timestep
void step_timestep(Graph& g, StepTable steps, Tensor table_row); // [rows] u32

// y[r] = in_scale x[r mod rows of x]
[[nodiscard]] Tensor step_input(Graph& g, StepTable steps, Tensor x, uint32_t rows, DType dtype); // [M, N] -> [rows, N]

// standard normals keyed by (seed, voxel, draw, known or not, channel), Philox4x32-10
[[nodiscard]] Tensor step_noise(Graph& g, StepTable steps,
                                Tensor cells,                  // [M, 4] i32 array
                                Tensor known,                  // [M] u32
                                uint32_t cols, uint64_t seed); // -> [M, cols]

// x' = c_x x + c_z z
void step_renoise(Graph& g, StepTable steps, Tensor z, Tensor x);

// x = fixed where a token is known
void step_hold(Graph& g,
               Tensor known,            // [M] u32
               Tensor fixed, Tensor x); // [M, N] fp32; x in place

// The points of voxels from their tokens (docs/method.md §1.2), by increasing distance to the centre, ties by x, y, z,
// then in the token's order; each three words: x | y << 16, fp16 metres from the centre; z, and bit 31 where a number
// of the point was not finite; r | g << 8 | b << 16, sRGB
constexpr float kMostHalfVoxel = 125; // metres: squared distances of the points stay within 64 bits
[[nodiscard]] Tensor decode_tokens(Graph& g,
                                   Tensor tokens,        // [M, 6n] fp32
                                   Tensor normalization, // [2, 6] fp32 array: mean, standard deviation
                                   float half_voxel);    // metres -> [M, 3n] u32 array

// how far the conditional prediction is followed: the same everywhere, or linear over the frames of a video
struct FrameGuidance {
    float first = 1, last = 1; // of the first and the last frame
    uint32_t frames = 1;       // that the rows of x are

    FrameGuidance() = default;
    FrameGuidance(float scale) : first(scale), last(scale) {}
    FrameGuidance(float from, float to, uint32_t count) : first(from), last(to), frames(count) {}
};

// guidance, prediction, next state; known tokens are put back at the level of the next state
void step_update(Graph& g, StepTable steps,
                 Tensor m,     // [M, N], or [2M, N] conditional then unconditional: network output
                 Tensor z,     // [M, N]
                 Tensor known, // [M] u32
                 Tensor fixed, // [M, N] tokens of the known rows
                 Tensor x,     // [M, N], in place
                 Tensor x0,    // [M, N], in place: previous prediction, then this one
                 const FrameGuidance& guidance, float clip);

// how much of what a step's prediction got wrong of known frames is carried into each of the others
struct FrameWeights {
    Tensor table;           // [steps * frames, frames] fp32 array: of each step and frame, for each known frame
    uint32_t frames = 1;    // that the rows of x are
    uint32_t first_row = 0; // of the step table, whose weights come first
};

// after step_update, whose x0 is the prediction of known frames, too: d = sum of weight (fixed - x0) over the known
// frames; x0 += d, and x as if the prediction had been so. Frames are known or not as a whole.
void step_carry(Graph& g, StepTable steps, const FrameWeights& weights,
                Tensor known,         // [M] u32
                Tensor fixed,         // [M, N] fp32
                Tensor x, Tensor x0); // [M, N] fp32, in place

// what a deferred renderer's network sees beside the state x, [M, C]: pixels of one frame or of the frames of a video,
// at the size of the latent
struct RendererFrame {
    Tensor previous; // [M, C] fp32: latent of the frame before, with noise; none: the network does not see one
    Tensor buffer;   // [M, C] fp32: latent of the splat buffer
    Tensor visible;  // [M, 1] fp32: share of the pixel that the splats cover
};

// y = [in_scale x, previous, buffer, visible]; with two halves [in_scale x, 0, buffer, 0] follows, for guidance.
// Without a previous latent its columns are left out.
[[nodiscard]] Tensor renderer_input(Graph& g, StepTable steps,
                                    Tensor x, // [M, C] fp32
                                    const RendererFrame& frame, uint32_t halves,
                                    DType dtype); // of y: [halves * M, 3C + 1], or 2C + 1

} // namespace semrover
