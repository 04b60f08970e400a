// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/voxfield_model.h"

#include "engine/model/low_rank.h"
#include "engine/model/model_index.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

Result<Json> preset_of(const Json& index, const std::string& name)
{
    const Json presets = index.value("presets", Json::object());
    if (!presets.is_object())
        return fail(ErrorCode::bad_input, "model_index.json: presets: expected an object");
    if (const auto found = presets.find(name); found != presets.end()) {
        if (!found->is_object())
            return fail(ErrorCode::bad_input, "model_index.json: presets: {}: expected an object", quote(name));
        return *found;
    }
    std::vector<std::string> names;
    for (const auto& [other, settings] : presets.items())
        names.push_back(other);
    return fail(ErrorCode::usage, "no preset of the model is called {}; {}", quote(name),
                names.empty() ? "it has none" : fmt::format("choose from {}", fmt::join(names, ", ")));
}

// puts the preset's settings over the model's defaults -> its adapter; empty where it takes the usual one
Result<Path> take_preset(const Json& index, const std::string& name, const Path& transformer, Json& defaults)
{
    SR_TRY(const Json settings, preset_of(index, name));
    SR_TRY(const std::string file, preset_adapter(settings));
    const Path adapter = file == kAdapterFile ? Path() : transformer / file;
    if (!adapter.empty() && !is_file(adapter))
        return fail(ErrorCode::bad_input, "{} is not there, the adapter of the preset {}", quote_path(adapter),
                    quote(name));
    if (defaults.is_object()) // else read_defaults says so
        defaults.update(settings);
    return adapter;
}

Status read_defaults(const Json& defaults, VoxfieldDefaults& d)
{
    JsonFields fields(defaults, "model_index.json: defaults");
    fields.integer("num_inference_steps", 1, kMaxInferenceSteps, d.num_inference_steps);
    int from = 0, until = kLastTimestep;
    fields.number("guidance_scale", 0.f, kMaxGuidance, d.guidance.scale);
    fields.integer("guidance_from", 0, kLastTimestep, from);
    fields.integer("guidance_until", 0, kLastTimestep, until);
    fields.number("guidance_radius", 0., kWholeRadius, d.guidance.radius);
    d.guidance.from = from;
    d.guidance.until = until;
    fields.integer("distilled_steps", 1, kMaxInferenceSteps, d.distilled_steps);
    fields.number("prediction_error_scale", 0., 100., d.prediction_error_scale);
    fields.integer("region_size", 1, 4096, d.regions.region_size);
    fields.integer("coverage_threshold", 1, 4096, d.regions.coverage_threshold);
    fields.choice("strategy", {{"complete", RegionStrategy::complete}, {"rim", RegionStrategy::rim}},
                  d.regions.strategy);
    fields.integer("jump_length", 0, 10000, d.repaint.jump_length);
    fields.integer("jump_n_sample", 1, 10000, d.repaint.jump_n_sample);
    fields.choice("known_tokens", {{"noised", KnownTokens::noised}, {"clean", KnownTokens::clean}}, d.repaint.known);
    if (const Json* usual = fields.find("objects")) {
        SR_TRY(d.usual_objects, parse_usual_objects(*usual, "model_index.json: defaults: objects"));
    }
    std::vector<std::string> others; // for other components
    return fields.finish(others);
}

// no scheduler in the folder: the method's own, DDPM over x0
SchedulerConfig method_scheduler(std::optional<Sampler> sampler)
{
    SchedulerConfig c;
    c.sampler = sampler.value_or(Sampler::ddpm);
    c.prediction = Prediction::sample;
    return c;
}

} // namespace

Result<VoxfieldModel> VoxfieldModel::open(const Path& folder, const std::string& preset, std::optional<Sampler> sampler)
{
    VoxfieldModel m;
    m.folder = folder;
    m.transformer = folder / "voxfield_transformer";
    if (!is_there(m.transformer) && is_there(folder / "config.json"))
        m.transformer = folder; // the component itself was given
    if (!is_there(m.transformer / "config.json"))
        return fail(ErrorCode::bad_input,
                    "'{}' has no voxfield_transformer/config.json: a model is a folder in the diffusers layout",
                    folder.string());
    SR_TRY(m.config, read_transformer_config(m.transformer));
    m.warnings = m.config.warnings;
    SR_TRY(const Json index, read_model_index(folder));
    Json defaults = index.value("defaults", Json::object());
    if (!preset.empty()) {
        SR_TRY(m.adapter, take_preset(index, preset, m.transformer, defaults));
    }
    SR_CHECK(read_defaults(defaults, m.defaults));
    const Path scheduler = folder / "voxfield_scheduler" / "scheduler_config.json";
    m.scheduler = method_scheduler(sampler);
    if (is_there(scheduler)) {
        SR_TRY(m.scheduler, read_scheduler_config(scheduler, m.warnings, sampler));
    }
    if (m.scheduler.prediction != Prediction::sample)
        return fail(ErrorCode::bad_input, "{}: the transformer predicts x0, so prediction_type must be \"sample\"",
                    scheduler.string());
    if (m.scheduler.sampler == Sampler::euler)
        return fail(ErrorCode::bad_input, "the euler sampler cannot hold known tokens; use ddpm, ddim or dpm++2m");
    for (PredictionError& error : m.scheduler.prediction_errors) {
        error.places *= m.defaults.prediction_error_scale;
        error.colors *= m.defaults.prediction_error_scale;
    }
    m.scheduler.clip_sample = true; // the method clips x0 to [-1, 1] with every sampler
    return m;
}

} // namespace semrover
