// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/renderer_model.h"

#include "engine/model/ldm_config.h"
#include "engine/model/model_index.h"
#include "engine/sampling/guidance.h"
#include "engine/sampling/schedule.h"
#include "runtime/base/hash.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

template <typename Config>
Result<Config> read_config(const Path& path, Result<Config> (*parse)(const Json&))
{
    SR_TRY(const Json json, read_json(path));
    auto config = parse(json);
    if (!config)
        return fail(ErrorCode::bad_input, "{}: {}", quote_path(path), config.error().message);
    for (std::string& warning : config->warnings)
        warning = quote_path(path) + ": " + warning;
    return config;
}

// a folder without the component: what else lies there may say what was meant
tl::unexpected<Error> missing_component(const Path& folder, std::string_view what, std::string_view expected)
{
    const std::vector<Path> files = list_files(folder).value_or(std::vector<Path>{});
    for (const Path& file : files)
        for (const char* pickle : {".ckpt", ".bin", ".pt", ".pth"})
            if (file.extension() == pickle)
                return tl::make_unexpected(SafetensorsSet::open(file).error()); // says how to convert it
    for (const Path& file : files)
        if (file.extension() == ".safetensors")
            return fail(ErrorCode::bad_input,
                        "{}: has no {}: expected {}; if {} is a single-file checkpoint, give the file itself",
                        quote_path(folder), what, expected, quote_path(file.filename()));
    return fail(ErrorCode::bad_input, "{}: has no {}: expected {} in the diffusers layout", quote_path(folder), what,
                expected);
}

Status read_conditioning(RendererModel& m)
{
    const uint32_t width = m.unet.cross_attention_dim;
    const Path folder = m.folder / "conditioning";
    std::optional<SafetensorsSet> found;
    if (m.ldm || is_there(folder)) {
        SR_TRY(found, m.ldm ? SafetensorsSet::open(m.folder) : SafetensorsSet::open_folder(folder, "conditioning"));
    }
    const std::string_view name = m.ldm ? kLdmConditioning : kConditioning;
    if (!found || (m.ldm && !found->find(name))) {
        m.warnings.push_back(
            fmt::format("{}: has no {}; zeros stand for the text", quote_path(m.folder),
                        m.ldm ? fmt::format("tensor {}", name) : "conditioning/conditioning.safetensors"));
        if (m.video())
            m.conditioning_tokens = 1;
        m.conditioning.assign(size_t(m.conditioning_tokens) * width, 0.f);
        return {};
    }
    const SafetensorsSet& set = *found;
    SR_TRY(const TensorInfo* tensor, set.get(name));
    const auto& shape = tensor->shape;
    if (shape.size() != 3 || shape[0] != 1 || shape[1] < 1 || shape[1] > 4096 || shape[2] != width)
        return fail(ErrorCode::bad_input,
                    "{}: encoder_hidden_states is {}, expected [1, 1..4096, {}] as the UNet's cross_attention_dim says",
                    quote_path(set.path()), shape_text(shape), width);
    if (tensor->dtype != DType::f32 && tensor->dtype != DType::f16 && tensor->dtype != DType::bf16)
        return fail(ErrorCode::bad_input, "{}: encoder_hidden_states is {}, expected F32, F16 or BF16",
                    quote_path(set.path()), dtype_name(tensor->dtype));
    SR_CHECK(check_finite(set, *tensor));
    m.conditioning_tokens = uint32_t(shape[1]);
    m.conditioning.resize(tensor->elements());
    to_float(set.bytes(*tensor), tensor->dtype, m.conditioning.data());
    return {};
}

void read_splat_radius(JsonFields& fields, RendererDefaults& d)
{
    const Json* value = fields.find("splat_radius");
    if (!value)
        return;
    const double number = value->is_number() ? value->get<double>() : NAN;
    if (*value == "auto")
        d.splat_radius.reset();
    else if (number > 0 && number < 100)
        d.splat_radius = float(number);
    else
        fields.refuse("splat_radius", "metres (0..100) or \"auto\"");
}

RendererDefaults defaults_of(const UnetConfig& unet)
{
    RendererDefaults d;
    if (!unet.video)
        return d;
    d.num_inference_steps = 25;
    d.guidance_scale = 3;
    d.video.window_frames = std::min(unet.num_frames, kMostWindowFrames);
    d.video.window_overlap = std::min(4u, d.video.window_frames / 3);
    if (d.video.added_numbers.size() != unet.added_numbers)
        d.video.added_numbers.assign(unet.added_numbers, 0.f);
    return d;
}

void read_added_numbers(JsonFields& fields, std::vector<float>& numbers)
{
    const Json* value = fields.find("added_time_ids");
    if (!value)
        return;
    const bool fits =
        value->is_array() && value->size() == numbers.size() &&
        std::ranges::all_of(*value, [](const Json& n) { return n.is_number() && std::abs(n.get<double>()) <= 1e6; });
    if (!fits)
        fields.refuse("added_time_ids", fmt::format("{} numbers, as the UNet takes them", numbers.size()));
    for (size_t i = 0; fits && i < numbers.size(); ++i)
        numbers[i] = (*value)[i].get<float>();
}

void read_video_defaults(JsonFields& fields, VideoDefaults& v)
{
    fields.number("first_guidance_scale", 0.f, kMaxGuidance, v.first_guidance_scale);
    fields.integer("window_frames", 1u, kMostWindowFrames, v.window_frames);
    v.window_overlap = std::min(4u, v.window_frames / 3);
    fields.integer("window_overlap", 0u, v.window_frames - 1, v.window_overlap);
    fields.number("frame_correlation", 0.f, 0.999f, v.frame_correlation);
    fields.integer("decode_frames", 1u, kMostWindowFrames, v.decode_frames);
    read_added_numbers(fields, v.added_numbers);
}

// of a renderer that makes each frame from the one before
void read_frame_defaults(JsonFields& fields, RendererDefaults& d)
{
    fields.number("previous_noise", 0.f, 100.f, d.previous_noise);
    fields.number("frame_history", 0.f, kMostFrameHistory, d.frame_history);
}

Status read_defaults(const Path& folder, bool video, RendererDefaults& d, std::vector<std::string>& warnings)
{
    SR_TRY(const Json index, read_model_index(folder));
    const std::string where = quote_path(folder / "model_index.json") + ": defaults.renderer";
    const Json all = index.value("defaults", Json::object());
    const Json defaults = all.is_object() ? all.value("renderer", Json::object()) : all;
    JsonFields fields(defaults, where);
    fields.integer("num_inference_steps", 1, kMaxInferenceSteps, d.num_inference_steps);
    fields.number("guidance_scale", 0.f, kMaxGuidance, d.guidance_scale);
    if (video)
        read_video_defaults(fields, d.video);
    else
        read_frame_defaults(fields, d);
    fields.choice("frame_noise", {{"fresh", FrameNoise::fresh}, {"warped", FrameNoise::warped}}, d.frame_noise);
    fields.number("visible_threshold", 0.f, 1.f, d.visible_threshold);
    read_splat_radius(fields, d);
    return fields.finish(warnings);
}

Status read_scheduler(RendererModel& m, std::optional<Sampler> sampler)
{
    const Path path = m.folder / "scheduler" / "scheduler_config.json";
    if (m.ldm || !is_there(path)) {
        const Json usual = m.video() ? video_scheduler_json() : stable_diffusion_scheduler_json();
        SR_TRY(m.scheduler, scheduler_config_from_json(usual, m.warnings, sampler));
        return {};
    }
    // Stable Diffusion's own folders name PNDM
    const auto json = read_json(path);
    if (!sampler && json && json->is_object() && json->value("_class_name", Json()) == "PNDMScheduler") {
        m.warnings.push_back(quote_path(path) + ": PNDMScheduler is replaced by DDIM over its noise schedule");
        sampler = Sampler::ddim;
    }
    SR_TRY(m.scheduler, read_scheduler_config(path, m.warnings, sampler));
    if (m.scheduler.variance_type == VarianceType::analytic)
        return fail(ErrorCode::bad_input, "{}: variance_type \"analytic\" is for tokens, latents have no colours",
                    quote_path(path));
    return {};
}

Status read_folder(RendererModel& m)
{
    m.unet_folder = m.folder / (is_there(m.folder / "renderer") ? "renderer" : "unet");
    m.vae_folder = m.folder / "vae";
    if (!is_there(m.unet_folder / "config.json"))
        return missing_component(m.folder, "renderer", "renderer/config.json or unet/config.json");
    if (!is_there(m.vae_folder / "config.json"))
        return missing_component(m.folder, "VAE", "vae/config.json");
    SR_TRY(m.unet, read_config(m.unet_folder / "config.json", parse_any_unet_config));
    SR_TRY(m.vae, read_config(m.vae_folder / "config.json", parse_any_vae_config));
    m.defaults = defaults_of(m.unet);
    return read_defaults(m.folder, m.unet.video, m.defaults, m.warnings);
}

Status read_ldm(RendererModel& m)
{
    m.ldm = true;
    m.unet_folder = m.vae_folder = m.folder;
    SR_TRY(const SafetensorsSet set, SafetensorsSet::open(m.folder));
    if (!is_ldm(set))
        return fail(ErrorCode::bad_input,
                    "{}: has no renderer: expected a single-file Stable Diffusion checkpoint with tensors "
                    "model.diffusion_model.*, or a folder in the diffusers layout",
                    quote_path(m.folder));
    if (ldm_vae_prefix(set).empty())
        return fail(ErrorCode::bad_input, "{}: has no VAE: expected tensors first_stage_model.* or vae.*",
                    quote_path(m.folder));
    SR_TRY(m.unet, ldm_unet_config(set));
    SR_TRY(m.vae, ldm_vae_config(set));
    m.defaults = defaults_of(m.unet);
    return {};
}

tl::unexpected<Error> refuse_image_video_unet(const Path& path, uint32_t latent_channels)
{
    return fail(
        ErrorCode::bad_input,
        "{}: conv_in takes {} channels, a plain Stable Video Diffusion UNet; the video renderer needs {}: noisy "
        "latent ({}), buffer latent ({}) in place of the image, and visibility (1). `vsd_init` makes "
        "it so, to be trained",
        quote_path(path), 2 * latent_channels, 2 * latent_channels + 1, latent_channels, latent_channels);
}

// adapters (LoRA) are added to the transformer's weights alone
void warn_of_adapters(RendererModel& m)
{
    for (const Path& folder : {m.folder, m.unet_folder, m.vae_folder}) {
        const auto files = list_files(folder);
        for (size_t i = 0; files && i < files->size(); ++i) {
            std::string name = (*files)[i].filename().string();
            std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
            if (name.ends_with(".safetensors") && name.find("lora") != std::string::npos)
                m.warnings.push_back(fmt::format("{}: an adapter (LoRA), which a renderer does not read; merge it into "
                                                 "the weights first (fuse_lora of diffusers)",
                                                 quote_path((*files)[i])));
        }
    }
}

Status check_renderer(const RendererModel& m)
{
    if (m.unet.in_channels == m.vae.latent_channels && !m.video())
        return refuse_plain_unet(m.unet_folder);
    if (m.unet.in_channels == 2 * m.vae.latent_channels && m.video())
        return refuse_image_video_unet(m.unet_folder, m.vae.latent_channels);
    if (const uint32_t expected = renderer_channels(m.vae, m.video()); m.unet.in_channels != expected)
        return fail(ErrorCode::bad_input,
                    "{}: in_channels is {}, expected {}: noisy, {}buffer latent of {} channels each, and visibility",
                    quote_path(m.unet_folder), m.unet.in_channels, expected, m.video() ? "" : "previous and ",
                    m.vae.latent_channels);
    if (m.unet.out_channels != m.vae.latent_channels)
        return fail(ErrorCode::bad_input, "{}: out_channels is {}, expected the VAE's latent_channels, {}",
                    quote_path(m.unet_folder), m.unet.out_channels, m.vae.latent_channels);
    SR_TRY(const Checkpoint unet, m.open_unet());
    SR_CHECK(unet.require(unet_schema(m.unet)));
    SR_TRY(const Checkpoint vae, m.open_vae());
    return vae.require(vae_schema(m.vae));
}

} // namespace

SchedulerConfig stable_diffusion_scheduler(std::optional<Sampler> sampler)
{
    std::vector<std::string> none;
    const auto config = scheduler_config_from_json(stable_diffusion_scheduler_json(), none, sampler);
    SR_ASSERT(config, "{}", config.error().message);
    return *config;
}

Json stable_diffusion_scheduler_json()
{
    return {{"_class_name", "DDIMScheduler"}, {"num_train_timesteps", 1000}, {"beta_schedule", "scaled_linear"},
            {"beta_start", 0.00085},          {"beta_end", 0.012},           {"prediction_type", "epsilon"},
            {"clip_sample", false},           {"set_alpha_to_one", false},   {"steps_offset", 1},
            {"timestep_spacing", "leading"}};
}

Json video_scheduler_json()
{
    return {{"_class_name", "EulerDiscreteScheduler"},
            {"num_train_timesteps", 1000},
            {"beta_schedule", "scaled_linear"},
            {"beta_start", 0.00085},
            {"beta_end", 0.012},
            {"prediction_type", "v_prediction"},
            {"use_karras_sigmas", true},
            {"sigma_min", 0.002},
            {"sigma_max", 700.0},
            {"timestep_type", "continuous"},
            {"timestep_spacing", "leading"},
            {"steps_offset", 1}};
}

Result<RendererModel> RendererModel::read(const Path& path, std::optional<Sampler> sampler)
{
    RendererModel m;
    m.folder = path;
    if (is_folder(path))
        SR_CHECK(read_folder(m));
    else
        SR_CHECK(read_ldm(m));
    SR_CHECK(read_scheduler(m, sampler));
    if (m.scheduler.continuous_timesteps && m.scheduler.sampler != Sampler::euler)
        return fail(ErrorCode::bad_input,
                    "{}: timestep_type is \"continuous\", which the euler sampler alone gives, not {}",
                    quote_path(path), sampler_name(m.scheduler.sampler));
    m.warnings.insert(m.warnings.end(), m.unet.warnings.begin(), m.unet.warnings.end());
    m.warnings.insert(m.warnings.end(), m.vae.warnings.begin(), m.vae.warnings.end());
    SR_CHECK(read_conditioning(m));
    if (!m.ldm)
        warn_of_adapters(m);
    return m;
}

Result<RendererModel> RendererModel::open(const Path& path, std::optional<Sampler> sampler)
{
    SR_TRY(RendererModel m, read(path, sampler));
    SR_CHECK(check_renderer(m));
    return m;
}

Result<Checkpoint> RendererModel::open_unet() const
{
    return ldm ? Checkpoint::open_ldm(folder, Checkpoint::Network::unet, &unet, &vae)
               : Checkpoint::open_folder(unet_folder, Checkpoint::Network::unet);
}

Result<Checkpoint> RendererModel::open_vae() const
{
    return ldm ? Checkpoint::open_ldm(folder, Checkpoint::Network::vae, &unet, &vae)
               : Checkpoint::open_folder(vae_folder, Checkpoint::Network::vae);
}

Result<uint64_t> RendererModel::hash() const
{
    if (ldm)
        return hash_file(folder);
    Hash all;
    for (const Path& part : {unet_folder, vae_folder, folder / "scheduler", folder / "conditioning"}) {
        if (!is_there(part))
            continue;
        SR_TRY(const uint64_t one, hash_folder(part));
        all.add(hash_text(one));
    }
    return all.value();
}

} // namespace semrover
