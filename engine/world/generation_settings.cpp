// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/generation_settings.h"

#include "engine/job/run_folder.h"
#include "engine/job/version.h"
#include "engine/scene/tiles.h"
#include "runtime/base/hash.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

// attention does not reach farther than its radius, and more known voxels would only be looked at
Status set_tiles(RegionOptions& regions, const TransformerConfig& config, double tile_size)
{
    if (regions.first_cell != 0)
        return fail(ErrorCode::usage, "`first_cell` has no meaning in the order of tiles");
    SR_TRY(regions.tile_cells, tile_cells_of(tile_size, config.voxel_size));
    regions.halo_cells = int32_t(std::sqrt(double(config.radius2())));
    return {};
}

// a distilled network knows no labels left out; between its default and what it was trained for steps may be left out
void warn_of_distilled(GenerationSettings& s)
{
    const int most = s.model.defaults.distilled_steps, fewest = std::min(s.model.defaults.num_inference_steps, most);
    if (!most)
        return;
    if (s.guidance.scale != 1.f)
        s.model.warnings.push_back(
            fmt::format("the model is distilled: its one pass is guided already, and `cfg_scale` {} guides it twice",
                        s.guidance.scale));
    if (s.steps < fewest || s.steps > most || s.model.scheduler.sampler != Sampler::ddpm)
        s.model.warnings.push_back(
            fmt::format("the model was distilled for {} steps of ddpm, not {} of {}",
                        fewest < most ? fmt::format("{} to {}", fewest, most) : fmt::to_string(most), s.steps,
                        sampler_name(s.model.scheduler.sampler)));
}

} // namespace

Result<GenerationSettings> resolve_generation(const GenerationOptions& o)
{
    GenerationSettings s;
    std::optional<Sampler> sampler;
    if (!o.sampler.empty()) {
        SR_TRY(sampler, sampler_from_name(o.sampler));
    }
    SR_TRY(s.model, VoxfieldModel::open(o.model, o.preset, sampler));
    const double model_eta = s.model.scheduler.eta;
    s.model.scheduler.eta = o.eta.value_or(model_eta);
    s.other_eta = s.model.scheduler.eta != model_eta;
    const VoxfieldDefaults& d = s.model.defaults;
    s.steps = o.steps.value_or(d.num_inference_steps);
    s.guidance = {o.guidance_scale.value_or(d.guidance.scale), double(o.guidance_from.value_or(int(d.guidance.from))),
                  double(o.guidance_until.value_or(int(d.guidance.until))),
                  o.guidance_radius.value_or(d.guidance.radius)};
    s.repaint = {o.jump_length.value_or(d.repaint.jump_length), o.jump_n_sample.value_or(d.repaint.jump_n_sample),
                 o.known.value_or(d.repaint.known)};
    s.regions = d.regions;
    s.regions.region_size = o.region_size.value_or(d.regions.region_size);
    s.regions.coverage_threshold =
        std::min(o.coverage_threshold.value_or(d.regions.coverage_threshold), s.regions.region_size);
    s.regions.strategy = o.strategy.value_or(d.regions.strategy);
    s.regions.first_cell = o.first_cell;
    if (o.tile_size > 0)
        SR_CHECK(set_tiles(s.regions, s.model.config, o.tile_size));
    s.precision = o.precision;
    s.batch = o.batch;
    SR_TRY(s.plan, plan_sampling(s.model.scheduler, s.steps, s.repaint));
    warn_of_distilled(s);
    return s;
}

void warn_of_placement(const VoxfieldModel& model, const VoxelGrid& grid, const JobCallbacks& callbacks)
{
    const auto said = grid.metadata.find("placement");
    const std::string placement = said == grid.metadata.end() ? "shifted" : said->second;
    const bool known = std::ranges::any_of(grid.generated, [](uint8_t generated) { return generated != 0; });
    const bool fits = placement == model.config.placement || model.config.placement == "mixed";
    if (known && !fits && callbacks.warning)
        callbacks.warning(fmt::format("the grid's points are {}, the model makes {} ones: they may not fit together",
                                      placement, model.config.placement));
}

Result<Json> settings_json(const GenerationSettings& s, const Device& device, std::string_view command,
                           uint64_t grid_hash)
{
    SR_TRY(const uint64_t model_hash, hash_folder(s.model.transformer));
    Json settings{{"command", std::string(command)},
                  {"version", kVersion},
                  {"grid", hash_text(grid_hash)},
                  {"model", hash_text(model_hash)},
                  {"precision", s.precision == DType::f32 ? "fp32" : "fp16"},
                  {"sampler", std::string(sampler_name(s.model.scheduler.sampler))},
                  {"steps", s.steps},
                  {"guidance_scale", s.guidance.scale},
                  {"guidance_from", s.guidance.from},
                  {"region_size", s.regions.region_size},
                  {"coverage_threshold", s.regions.coverage_threshold},
                  {"strategy", std::string(region_strategy_name(s.regions.strategy))},
                  {"first_cell", s.regions.first_cell},
                  {"jump_length", s.repaint.jump_length},
                  {"jump_n_sample", s.repaint.jump_n_sample},
                  {"known_tokens", s.repaint.known == KnownTokens::clean ? "clean" : "noised"}};
    settings.update(device_key(device));
    if (const Path scheduler = s.model.folder / "voxfield_scheduler"; is_there(scheduler)) {
        SR_TRY(const uint64_t scheduler_hash, hash_folder(scheduler));
        settings["scheduler"] = hash_text(scheduler_hash);
    }
    // not there where they say nothing
    if (!s.model.adapter.empty())
        settings["adapter"] = s.model.adapter.filename().string();
    if (s.guidance.until < kLastTimestep)
        settings["guidance_until"] = s.guidance.until;
    if (s.guidance.narrows(s.model.config.attention_radius))
        settings["guidance_radius"] = s.guidance.radius;
    if (s.model.defaults.prediction_error_scale != 1)
        settings["prediction_error_scale"] = s.model.defaults.prediction_error_scale;
    if (s.other_eta)
        settings["eta"] = s.model.scheduler.eta;
    if (s.regions.tile_cells)
        settings["tile_cells"] = s.regions.tile_cells;
    return settings;
}

} // namespace semrover
