// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// models: loaded once, shared by worlds and renderers
#include "engine/capi/call.h"
#include "engine/capi/handles.h"
#include "engine/scene/cell_reach.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

// the files that the application has in memory
Result<std::unique_ptr<MemoryFolder>> folder_of(const sr_model_desc& d)
{
    auto folder = std::make_unique<MemoryFolder>();
    for (uint64_t i = 0; i < d.file_count; ++i) {
        const sr_file& file = d.files[i];
        if (!file.path || (!file.data && file.bytes))
            return fail(ErrorCode::usage, "sr_model_desc: file {} of {} has no path or no data", i, d.file_count);
        SR_CHECK(folder->add(file.path, {static_cast<const std::byte*>(file.data), size_t(file.bytes)}));
    }
    return folder;
}

Result<ModelRequest> request_of(const sr_model_desc& d)
{
    if (!d.files != !d.file_count)
        return fail(ErrorCode::usage, "sr_model_desc: files and their count come together");
    if (!d.files && !d.path)
        return fail(ErrorCode::usage, "sr_model_desc: path is NULL");
    if (d.parts > (SR_MODEL_VOXFIELD | SR_MODEL_RENDERER))
        return fail(ErrorCode::usage, "sr_model_desc: parts is {}, expected SR_MODEL_..", d.parts);
    if (d.reserved)
        return fail(ErrorCode::usage, "sr_model_desc: reserved is not 0");
    if (d.precision > SR_FP32)
        return fail(ErrorCode::usage, "sr_model_desc: precision is {}, expected SR_FP16 or SR_FP32", d.precision);
    ModelRequest request{.path = d.path ? d.path : ""};
    if (d.files) {
        SR_TRY(request.files, folder_of(d));
        request.path = d.path ? request.files->path() / d.path : request.files->path();
    }
    request.preset = d.preset ? d.preset : "";
    request.precision = d.precision == SR_FP32 ? DType::f32 : DType::f16;
    if (d.parts) {
        request.if_there = false;
        request.voxfield = d.parts & SR_MODEL_VOXFIELD;
        request.renderer = d.parts & SR_MODEL_RENDERER;
    }
    return request;
}

void describe(const VoxfieldModel& voxfield, sr_model_info& info)
{
    info.parts |= SR_MODEL_VOXFIELD;
    for (const ConditionPart part : voxfield.config.condition)
        info.conditions |= 1u << uint32_t(part);
    info.voxel_size = decimal_voxel_size(voxfield.config.voxel_size);
    info.points_per_voxel = voxfield.config.points_per_voxel;
    info.steps = uint32_t(voxfield.defaults.num_inference_steps);
}

void describe(const RendererModel& renderer, sr_model_info& info)
{
    info.parts |= SR_MODEL_RENDERER;
    info.renderer_steps = uint32_t(renderer.defaults.num_inference_steps);
    info.window_frames = renderer.video() ? renderer.defaults.video.window_frames : 1;
    info.splat_radius = renderer.defaults.splat_radius.value_or(0);
}

sr_generation generation_of(const VoxfieldModel& model)
{
    const VoxfieldDefaults& d = model.defaults;
    sr_generation g{};
    g.sampler = model.scheduler.sampler == Sampler::ddim       ? SR_SAMPLER_DDIM
                : model.scheduler.sampler == Sampler::dpmpp_2m ? SR_SAMPLER_DPMPP_2M
                                                               : SR_SAMPLER_DDPM;
    g.known = d.repaint.known == KnownTokens::clean ? SR_KNOWN_CLEAN : SR_KNOWN_NOISED;
    g.regions = d.regions.strategy == RegionStrategy::rim ? SR_REGIONS_RIM : SR_REGIONS_COMPLETE;
    g.region_size = uint32_t(d.regions.region_size);
    g.least_uncovered = uint32_t(d.regions.coverage_threshold);
    g.jump_length = uint32_t(d.repaint.jump_length);
    g.jump_count = uint32_t(d.repaint.jump_n_sample);
    g.eta = model.scheduler.eta;
    g.guidance_scale = d.guidance.scale;
    g.guidance_from = uint32_t(d.guidance.from);
    g.guidance_until = uint32_t(d.guidance.until);
    g.guidance_radius = d.guidance.radius;
    return g;
}

sr_model_info info_of(const Model& model)
{
    sr_model_info info{};
    info.precision = model.precision() == DType::f32 ? SR_FP32 : SR_FP16;
    info.device_bytes = model.device_bytes();
    if (model.voxfield())
        describe(*model.voxfield(), info);
    if (model.renderer())
        describe(model.renderer()->model(), info);
    return info;
}

} // namespace

namespace semrover::capi {

Result<std::shared_ptr<Model>> model_of(const sr_context& context, const sr_model* model, const char* name)
{
    if (!model)
        return fail(ErrorCode::usage, "{}: model is NULL", name);
    if (model->context != &context)
        return fail(ErrorCode::usage, "{}: the model belongs to another context", name);
    return model->model;
}

} // namespace semrover::capi

extern "C" {

sr_status sr_model_load(sr_context* context, const sr_model_desc* desc, sr_model** model)
{
    return guarded<kWork>(context, [&]() -> Status {
        if (!context || !model)
            return fail(ErrorCode::usage, "sr_model_load: NULL");
        *model = nullptr;
        SR_TRY(const sr_model_desc known, read_struct(desc, "sr_model_desc"));
        SR_TRY(ModelRequest request, request_of(known));
        const auto progress = [&](uint64_t done, uint64_t total) {
            return !known.progress || known.progress(known.user, done, total) == 0;
        };
        SR_TRY(auto loaded, Model::load(*context->device, std::move(request), progress));
        *model = new sr_model{context, std::move(loaded)};
        return {};
    });
}

void sr_model_destroy(sr_model* model)
{
    destroy(model);
}

sr_status sr_model_get_generation(const sr_model* model, sr_generation* generation)
{
    return guarded(model ? model->context : nullptr, [&]() -> Status {
        if (!model || !model->model->voxfield())
            return fail(ErrorCode::usage, "sr_model_get_generation: {}",
                        model ? "the model has no voxfield transformer" : "model is NULL");
        return write_result(generation_of(*model->model->voxfield()), generation, "sr_model_get_generation");
    });
}

sr_status sr_model_get_info(const sr_model* model, sr_model_info* info)
{
    return guarded(model ? model->context : nullptr, [&]() -> Status {
        if (!model)
            return fail(ErrorCode::usage, "sr_model_get_info: model is NULL");
        return write_result(info_of(*model->model), info, "sr_model_get_info");
    });
}

} // extern "C"

static_assert(sizeof(sr_file) == 24 && sizeof(sr_model_desc) == 72 && sizeof(sr_model_info) == 56);
