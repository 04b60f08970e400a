// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/sampling/scheduler_config.h"

#include "runtime/base/json_fields.h"

#include <algorithm>
#include <functional>

namespace semrover {

namespace {

constexpr int kMaxTrainTimesteps = 10000;
constexpr size_t kMaxPredictionErrors = 1000;

struct SamplerNames {
    Sampler sampler;
    const char* option;
    const char* class_name;
};
constexpr SamplerNames kSamplers[] = {
    {Sampler::ddpm, "ddpm", "DDPMScheduler"},
    {Sampler::ddim, "ddim", "DDIMScheduler"},
    {Sampler::dpmpp_2m, "dpm++2m", "DPMSolverMultistepScheduler"},
    {Sampler::euler, "euler", "EulerDiscreteScheduler"},
};

void read_noise(JsonFields& fields, SchedulerConfig& config)
{
    fields.integer("num_train_timesteps", 1, kMaxTrainTimesteps, config.num_train_timesteps);
    fields.choice<BetaSchedule>("beta_schedule",
                                {{"linear", BetaSchedule::linear},
                                 {"scaled_linear", BetaSchedule::scaled_linear},
                                 {"squaredcos_cap_v2", BetaSchedule::squaredcos_cap_v2}},
                                config.beta_schedule);
    fields.number("beta_start", 1e-12, 0.999, config.beta_start);
    fields.number("beta_end", 1e-12, 0.999, config.beta_end);
    fields.choice<Prediction>(
        "prediction_type",
        {{"epsilon", Prediction::epsilon}, {"sample", Prediction::sample}, {"v_prediction", Prediction::v_prediction}},
        config.prediction);
    fields.choice<TimestepSpacing>("timestep_spacing",
                                   {{"leading", TimestepSpacing::leading},
                                    {"trailing", TimestepSpacing::trailing},
                                    {"linspace", TimestepSpacing::linspace},
                                    {"quadratic", TimestepSpacing::quadratic}},
                                   config.spacing);
    fields.integer("steps_offset", 0, kMaxTrainTimesteps, config.steps_offset);
    fields.flag("clip_sample", config.clip_sample);
    fields.number("clip_sample_range", 1e-6, 1e6, config.clip_sample_range);
}

// [[timestep, places, colours], ...]
void read_prediction_errors(JsonFields& fields, SchedulerConfig& config)
{
    std::vector<std::array<double, 3>> rows;
    fields.triples("prediction_errors", kMaxPredictionErrors, 0.0, double(kMaxTrainTimesteps), rows);
    for (const auto& [timestep, places, colors] : rows)
        config.prediction_errors.push_back({timestep, places, colors});
    const bool rising = std::ranges::is_sorted(config.prediction_errors, std::less_equal{}, &PredictionError::timestep);
    if (!rows.empty() && !rising)
        fields.refuse("prediction_errors", "rows of rising timesteps");
    if (config.variance_type == VarianceType::analytic && rows.empty())
        fields.refuse("prediction_errors", "rows of [timestep, places, colours], with variance_type \"analytic\"");
}

void read_solver(JsonFields& fields, SchedulerConfig& config)
{
    fields.choice<VarianceType>("variance_type",
                                {{"fixed_small", VarianceType::fixed_small},
                                 {"fixed_small_log", VarianceType::fixed_small},
                                 {"fixed_large", VarianceType::fixed_large},
                                 {"analytic", VarianceType::analytic}},
                                config.variance_type);
    read_prediction_errors(fields, config);
    fields.flag("set_alpha_to_one", config.set_alpha_to_one);
    fields.number("eta", 0.0, 1.0, config.eta);
    fields.integer("solver_order", 1, 2, config.solver_order);
    fields.flag("lower_order_final", config.lower_order_final);
    fields.flag("euler_at_final", config.euler_at_final);
    fields.choice<bool>("final_sigmas_type", {{"zero", true}, {"sigma_min", false}}, config.final_sigma_zero);
    fields.flag("use_karras_sigmas", config.use_karras_sigmas);
    fields.optional_number("sigma_min", 1e-9, 1e9, config.sigma_min);
    fields.optional_number("sigma_max", 1e-9, 1e9, config.sigma_max);
    fields.choice<bool>("timestep_type", {{"discrete", false}, {"continuous", true}}, config.continuous_timesteps);
}

void refuse_the_rest(JsonFields& fields)
{
    fields.only("algorithm_type", "dpmsolver++");
    fields.only("solver_type", "midpoint");
    fields.only("interpolation_type", "linear");
    for (const char* name : {"thresholding", "rescale_betas_zero_snr", "use_lu_lambdas", "use_exponential_sigmas",
                             "use_beta_sigmas", "use_flow_sigmas", "use_dynamic_shifting"})
        fields.only(name, false);
    fields.only("trained_betas", nullptr);
    fields.only("lambda_min_clipped", nullptr);
    // these matter only to what is refused above, or belong to the golden case and not to the scheduler
    fields.ignore({"dynamic_thresholding_ratio", "sample_max_value", "flow_shift", "type", "num_inference_steps"});
}

Result<Sampler> sampler_of_class(const Json& object)
{
    const auto found = object.contains("_class_name") ? object.find("_class_name") : object.find("type");
    if (found == object.end() || !found->is_string())
        return fail(ErrorCode::bad_input, "scheduler config: no _class_name");
    for (const SamplerNames& names : kSamplers)
        if (*found == names.class_name)
            return names.sampler;
    std::string expected;
    for (const SamplerNames& names : kSamplers)
        expected += fmt::format("{}{}", expected.empty() ? "" : ", ", names.class_name);
    return fail(ErrorCode::bad_input, "scheduler config: _class_name is {:.60}, supported: {}",
                found->get<std::string>(), expected);
}

Status check_together(const SchedulerConfig& config)
{
    if (config.beta_start > config.beta_end)
        return fail(ErrorCode::bad_input, "scheduler config: beta_start {} is above beta_end {}", config.beta_start,
                    config.beta_end);
    if (config.sigma_min && config.sigma_max && *config.sigma_min > *config.sigma_max)
        return fail(ErrorCode::bad_input, "scheduler config: sigma_min {} is above sigma_max {}", *config.sigma_min,
                    *config.sigma_max);
    if (config.continuous_timesteps && config.prediction != Prediction::v_prediction)
        return fail(ErrorCode::bad_input, "scheduler config: timestep_type \"continuous\" needs prediction_type "
                                          "\"v_prediction\"");
    return {};
}

} // namespace

Result<Sampler> sampler_from_name(std::string_view name)
{
    std::string expected;
    for (const SamplerNames& names : kSamplers) {
        if (name == names.option)
            return names.sampler;
        expected += fmt::format("{}{}", expected.empty() ? "" : ", ", names.option);
    }
    return fail(ErrorCode::usage, "no sampler is called \"{}\", choose from {}", name, expected);
}

std::string_view sampler_name(Sampler sampler)
{
    for (const SamplerNames& names : kSamplers)
        if (names.sampler == sampler)
            return names.option;
    SR_ASSERT(false, "sampler {}", int(sampler));
}

Result<SchedulerConfig> scheduler_config_from_json(const Json& object, std::vector<std::string>& warnings,
                                                   std::optional<Sampler> sampler)
{
    if (!object.is_object())
        return fail(ErrorCode::bad_input, "scheduler config: not a JSON object");
    SchedulerConfig config;
    if (sampler) {
        config.sampler = *sampler;
    } else {
        SR_TRY(config.sampler, sampler_of_class(object));
    }
    // where the defaults of diffusers' classes differ
    if (config.sampler == Sampler::dpmpp_2m || config.sampler == Sampler::euler) {
        config.spacing = TimestepSpacing::linspace;
        config.clip_sample = false;
    }
    JsonFields fields(object, "scheduler config");
    read_noise(fields, config);
    read_solver(fields, config);
    refuse_the_rest(fields);
    SR_CHECK(fields.finish(warnings));
    SR_CHECK(check_together(config));
    return config;
}

Result<SchedulerConfig> scheduler_config_from_text(std::string_view text, std::vector<std::string>& warnings,
                                                   std::optional<Sampler> sampler)
{
    // Python's json module writes infinities bare, which JSON does not allow
    static constexpr std::string_view kInfinity = "-Infinity";
    std::string plain;
    bool quoted = false;
    for (size_t i = 0; i < text.size(); ++i) {
        if (!quoted && text.substr(i).starts_with(kInfinity)) {
            plain += "null";
            i += kInfinity.size() - 1;
            continue;
        }
        if (quoted && text[i] == '\\' && i + 1 < text.size())
            plain += text[i++];
        else if (text[i] == '"')
            quoted = !quoted;
        plain += text[i];
    }
    const Json object = Json::parse(plain, nullptr, false);
    if (object.is_discarded())
        return fail(ErrorCode::bad_input, "scheduler config: not JSON");
    return scheduler_config_from_json(object, warnings, sampler);
}

Result<SchedulerConfig> read_scheduler_config(const Path& path, std::vector<std::string>& warnings,
                                              std::optional<Sampler> sampler)
{
    SR_TRY(const std::string text, read_text_file(path, 1 << 20));
    std::vector<std::string> own;
    auto config = scheduler_config_from_text(text, own, sampler);
    if (!config)
        return fail(ErrorCode::bad_input, "{}: {}", path.string(), config.error().message);
    for (const std::string& warning : own)
        warnings.push_back(fmt::format("{}: {}", path.string(), warning));
    return config;
}

} // namespace semrover
