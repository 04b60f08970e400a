// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/voxfield_model.h"

#include "runtime/base/json_fields.h"

namespace semrover {

namespace {

Status read_defaults(const Json& index, VoxfieldDefaults& d)
{
    const Json defaults = index.value("defaults", Json::object());
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

Result<VoxfieldModel> VoxfieldModel::open(const Path& folder, std::optional<Sampler> sampler)
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
    if (is_there(folder / "model_index.json")) {
        SR_TRY(const Json index, read_json(folder / "model_index.json"));
        SR_CHECK(read_defaults(index, m.defaults));
    }
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
    m.scheduler.clip_sample = true; // the method clips x0 to [-1, 1] with every sampler
    return m;
}

} // namespace semrover
