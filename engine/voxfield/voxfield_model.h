// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/usual_objects.h"
#include "engine/model/transformer_config.h"
#include "engine/sampling/guidance.h"
#include "engine/sampling/repaint.h"
#include "engine/voxfield/regions.h"

namespace semrover {

// "defaults" of model_index.json: what a command uses where no option overrides it
struct VoxfieldDefaults {
    int num_inference_steps = 50;
    Guidance guidance;
    int distilled_steps = 0;           // of a model whose one pass is guided already: the steps that it was trained for
    double prediction_error_scale = 1; // of the scheduler's prediction_errors
    RegionOptions regions;
    RepaintOptions repaint;
    UsualObjects usual_objects; // to guess objects from labels
};

// A model folder's configs, without the weights: Transformer::load reads those.
struct VoxfieldModel {
    Path folder;
    Path transformer; // the component's folder
    Path adapter;     // of a preset, in place of that folder's own; else empty
    TransformerConfig config;
    SchedulerConfig scheduler;
    VoxfieldDefaults defaults;
    std::vector<std::string> warnings;

    // preset: one of "presets" in model_index.json, other defaults and maybe another adapter; empty: none of them.
    // Errors: usage (no preset of that name); bad_input, with what is missing and where it should be
    static Result<VoxfieldModel> open(const Path& folder, const std::string& preset = {},
                                      std::optional<Sampler> sampler = {});
};

} // namespace semrover
