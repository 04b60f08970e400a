// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/transformer_config.h"
#include "engine/sampling/repaint.h"
#include "engine/voxfield/regions.h"

namespace semrover {

// model_index.json's "defaults": what a command uses when no option says otherwise
struct VoxfieldDefaults {
    int num_inference_steps = 50;
    float guidance_scale = 4;
    RegionOptions regions;
    RepaintOptions repaint;
};

// a model folder's description; weights are read by Transformer::load
struct VoxfieldModel {
    Path folder;
    Path transformer; // the component's folder
    TransformerConfig config;
    SchedulerConfig scheduler;
    VoxfieldDefaults defaults;
    std::vector<std::string> warnings;

    // errors: bad_input, with what is missing and where it should be
    static Result<VoxfieldModel> open(const Path& folder, std::optional<Sampler> sampler = {});
};

} // namespace semrover
