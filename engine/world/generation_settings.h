// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/job.h"
#include "engine/scene/grid.h"
#include "engine/voxfield/token_sampler.h"
#include "engine/voxfield/voxfield_model.h"
#include "runtime/base/dtype.h"
#include "runtime/base/json.h"
#include "runtime/device/device.h"

#include <optional>

namespace semrover {

constexpr double kUsualTileSize = 9.6; // metres: 16 voxels of the usual size

// How a grid is filled with points, as far as the caller says so; what is missing comes from the model.
struct GenerationOptions {
    Path model;                  // a folder
    std::string sampler, preset; // names; empty: the model's, and none
    std::optional<int> steps, region_size, coverage_threshold, jump_length, jump_n_sample;
    std::optional<float> guidance_scale;
    std::optional<int> guidance_from, guidance_until;
    std::optional<double> guidance_radius;
    std::optional<KnownTokens> known;
    std::optional<double> eta; // of DDIM, 0..1
    std::optional<RegionStrategy> strategy;
    int64_t first_cell = 0;
    double tile_size = 0;         // metres; above 0: in the order of tiles of this size
    DType precision = DType::f16; // or f32
    uint32_t batch = 0;           // regions at a time; 0: what suits the device
};

// the same with nothing open
struct GenerationSettings {
    VoxfieldModel model;
    SamplingPlan plan;
    int steps = 0;
    Guidance guidance;
    RegionOptions regions;
    RepaintOptions repaint;
    bool other_eta = false; // than the model's
    DType precision = DType::f16;
    uint32_t batch = 0;
};

// Reads the model's description, no weights. Errors: usage (a name that nobody knows), bad_input
Result<GenerationSettings> resolve_generation(const GenerationOptions& options);

// Warns where a grid has points that were placed in another way (docs/method.md §1.3) than the model places its own: it
// has not learned to go on from such.
void warn_of_placement(const VoxfieldModel& model, const VoxelGrid& grid, const JobCallbacks& callbacks);

// for a run's folder: everything that decides the bytes of the result, beside the seed. Reads the whole model once.
Result<Json> settings_json(const GenerationSettings& settings, const Device& device, std::string_view command,
                           uint64_t grid_hash);

} // namespace semrover
