// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/transformer.h"
#include "engine/sampling/guidance.h"
#include "engine/sampling/repaint.h"
#include "engine/sampling/step_loop.h"
#include "kernels/sampling.h"
#include "runtime/device/executable.h"

#include <functional>
#include <memory>

namespace semrover {

// one region of a batch
struct RegionInput {
    std::vector<CellIndex> cells;
    std::vector<uint32_t> labels;
    std::vector<uint32_t> known;  // 1: the token is given in `fixed`
    std::vector<float> fixed;     // [voxels, C]; read where known
    std::vector<float> condition; // [voxels, W]; or nothing
};

struct SamplerOptions {
    Guidance guidance;
    uint64_t seed = 0;
    uint32_t modulation_window = 64; // timesteps whose modulations are kept at a time: 40 MB for the full-size model
    // golden cases only: normals come from the caller, who fills [rows, C] before plan row r (0: the first noise)
    std::function<void(size_t row, std::span<float> normals)> noise = {};
};

// Denoises batches of regions with the transformer: the graphs are built once per batch shape and replayed for every
// step, one submit a step. The result of a region depends on nothing but its own input, the plan and the seed: not on
// where its run stopped and went on.
class TokenSampler : public StepLoop {
  public:
    static Result<std::unique_ptr<TokenSampler>> create(Device& device, const Transformer& transformer,
                                                        const SamplingPlan& plan, SamplerOptions options);

    // device memory of the sampler for `regions` regions of `cells` voxels at most, beside the transformer's own
    Result<uint64_t> planned_bytes(uint32_t regions, uint32_t cells) const;
    uint64_t table_bytes() const; // the part of it that is allocated from the start

    // tokens [voxels, C] of each region, region after region, known ones as given.
    // Errors: internal when the network returns NaN or infinity; device errors
    Result<std::vector<float>> run(std::span<const RegionInput> regions);

    // the same, piecewise: begin, step until it says true, finish. A run that has begun ends with finish, cancel, or
    // the next begin. One row of the plan is one submit, and one more comes before them.
    Status begin(std::span<const RegionInput> regions);
    Result<std::vector<float>> finish();
    // the same end, with the points of the tokens: words [voxels, 3n] of decode_tokens (kernels/sampling.h)
    Result<std::vector<uint32_t>> finish_points();

    // of the batch shape of the last run; its arithmetic is dense: masked attention counts in full
    const Executable& step_executable() const;

  private:
    struct Batch; // memory and executables of one batch shape
    TokenSampler(Device& device, const Transformer& transformer, const SamplingPlan& plan, SamplerOptions options);
    bool guided(const PlanRow& step) const;
    Status upload_steps();
    Status make_modulations();
    Status upload_normalization();
    StepTable step_table(Graph& g) const;
    TokenSets pack(std::span<const RegionInput> regions) const;
    Result<Batch*> batch_for(const TokenSets& sets);
    std::vector<float> conditions(uint32_t rows, std::span<const RegionInput> regions) const;
    Status upload(Batch& batch, const TokenSets& sets, std::span<const RegionInput> regions);
    Status use_timestep(uint32_t index);
    Status feed_noise(Batch& batch, size_t row);
    Result<Executable*> executable_of(size_t row);
    Result<std::vector<float>> read_tokens() const;

    const Transformer& transformer_;
    SamplingPlan plan_;
    SamplerOptions options_;
    uint32_t halves_; // 2 if any step is guided
    uint32_t unguided_steps_ = 0;
    uint32_t window_; // timesteps that the modulation table holds at a time
    uint32_t first_timestep_ = ~0u;
    TensorPool state_; // what does not depend on the batch
    DeviceTensor steps_, clock_, timesteps_, table_, normalization_;
    std::unique_ptr<Executable> modulations_;
    std::unique_ptr<Batch> batch_;
    uint32_t tokens_ = 0; // of the run's regions

  public:
    ~TokenSampler();
};

} // namespace semrover
