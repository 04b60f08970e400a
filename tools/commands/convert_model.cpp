// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/convert.h"

#include "engine/model/low_rank.h"
#include "engine/model/model_index.h"
#include "engine/model/renderer_model.h"
#include "engine/model/weight_blocks.h"
#include "runtime/base/final_name.h"
#include "runtime/base/quote.h"
#include "tools/cli/output_folder.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"
#include "tools/dataset/model_writer.h"

#include <algorithm>
#include <optional>

namespace semrover {

namespace {

namespace fs = std::filesystem;

// what will be written
struct Conversion {
    std::map<std::string, ComponentFiles> components; // by folder
    std::map<std::string, Json> texts;                // by path in the model
    std::map<std::string, Path> copies;               // by path in the model: the file
    std::optional<TensorStream> text;                 // the constant text, where it is not a file to copy
    Json index = {{"_class_name", "SemRoverPipeline"}};
    std::vector<std::string> left_out, warnings;
};

std::optional<DType> dtype_option(const ConvertModelOptions& o)
{
    if (o.dtype.empty())
        return {};
    return o.dtype == "f32" ? DType::f32 : o.dtype == "f16" ? DType::f16 : DType::bf16;
}

std::vector<TensorStream> streams_of(const Checkpoint& checkpoint, std::span<const TensorSpec> schema,
                                     std::optional<DType> dtype)
{
    std::vector<TensorStream> streams;
    for (const TensorSpec& spec : schema)
        streams.push_back(checkpoint.stream(spec, dtype));
    return streams;
}

// with --weights, int8 and scales in place of what can be stored in blocks
void put_in_blocks(const ConvertModelOptions& o, ComponentFiles& files)
{
    if (o.weights.empty())
        return;
    files.config["weights"] = o.weights;
    for (size_t i = 0, count = files.tensors.size(); i < count; ++i) {
        const TensorStream tensor = files.tensors[i];
        if (tensor.dtype == DType::i8 || !stored_in_blocks(tensor.name, tensor.shape))
            continue;
        files.tensors[i] = block_values(tensor);
        files.tensors.push_back(block_scales(tensor));
    }
}

// The input channels that a renderer lacks, with zero weights. A video's has those of the noisy latent and of the
// image, which comes unscaled, as splat buffers do: the buffer takes the image's, and visibility is new.
Status widen(const ConvertModelOptions& o, const RendererModel& m, ComponentFiles& files)
{
    const char* option = o.vsd_init ? "--vsd-init" : "--asd-init";
    const uint32_t plain = (o.vsd_init ? 2 : 1) * m.vae.latent_channels;
    if (m.video() != o.vsd_init)
        return fail(ErrorCode::bad_input, "{}: {} wants a UNet of {}", quote_path(m.unet_folder), option,
                    o.vsd_init ? "videos" : "single images");
    if (m.unet.in_channels != plain)
        return fail(ErrorCode::bad_input, "{}: {} adds channels to a plain UNet with {}, this one takes {}",
                    quote_path(m.unet_folder), option, plain, m.unet.in_channels);
    const auto conv_in = std::ranges::find(files.tensors, "conv_in.weight", &TensorStream::name);
    *conv_in = widen_conv_in(*conv_in, renderer_channels(m.vae, m.video()));
    files.config["in_channels"] = renderer_channels(m.vae, m.video());
    if (o.vsd_init)
        files.config["num_frames"] = VideoDefaults().window_frames; // the paper's, to be trained on
    return {};
}

Status plan_unet(const ConvertModelOptions& o, const RendererModel& m, Conversion& plan)
{
    SR_TRY(const Checkpoint checkpoint, m.open_unet());
    const std::vector<TensorSpec> schema = unet_schema(m.unet);
    SR_CHECK(checkpoint.require(schema));
    ComponentFiles files{unet_config_json(m.unet), streams_of(checkpoint, schema, dtype_option(o))};
    if (!m.ldm) {
        SR_TRY(files.config, read_json(m.unet_folder / "config.json")); // with the fields that the engine ignores
    }
    if (o.asd_init || o.vsd_init)
        SR_CHECK(widen(o, m, files));
    put_in_blocks(o, files);
    SR_CHECK(parse_any_unet_config(files.config)); // not every network can be in blocks
    plan.index["renderer"] = {"diffusers", m.video() ? "UNetSpatioTemporalConditionModel" : "UNet2DConditionModel"};
    plan.components["renderer"] = std::move(files);
    return {};
}

Status plan_vae(const ConvertModelOptions& o, const RendererModel& m, Conversion& plan)
{
    SR_TRY(const Checkpoint checkpoint, m.open_vae());
    const std::vector<TensorSpec> schema = vae_schema(m.vae);
    SR_CHECK(checkpoint.require(schema));
    ComponentFiles files{vae_config_json(m.vae), streams_of(checkpoint, schema, dtype_option(o))};
    if (!m.ldm) {
        SR_TRY(files.config, read_json(m.vae_folder / "config.json"));
    }
    if (m.vae.video && !m.vae.use_quant_conv)
        for (TensorStream& tensor : identity_quant_conv(m.vae.latent_channels, files.tensors.front().dtype))
            files.tensors.push_back(std::move(tensor));
    plan.index["vae"] = {"diffusers", m.vae.video ? "AutoencoderKLTemporalDecoder" : "AutoencoderKL"};
    plan.components["vae"] = std::move(files);
    return {};
}

Status plan_renderer(const ConvertModelOptions& o, Conversion& plan)
{
    SR_TRY(const RendererModel m, RendererModel::read(o.in));
    SR_CHECK(plan_unet(o, m, plan));
    SR_CHECK(plan_vae(o, m, plan));
    plan.warnings = m.warnings;
    SR_TRY(const FileType scheduler, m.ldm ? FileType::not_found : examine(m.folder / "scheduler"));
    if (scheduler == FileType::not_found) {
        const Json config = m.video() ? video_scheduler_json() : stable_diffusion_scheduler_json();
        plan.texts["scheduler/scheduler_config.json"] = config;
        plan.index["scheduler"] = {"diffusers", config["_class_name"]};
    }
    return {};
}

Status plan_transformer(const ConvertModelOptions& o, const Path& folder, Conversion& plan)
{
    SR_TRY(SafetensorsSet set, SafetensorsSet::open_folder(folder));
    ComponentFiles files;
    SR_TRY(files.config, read_json(folder / "config.json"));
    const auto shared = std::make_shared<const SafetensorsSet>(std::move(set));
    for (const TensorInfo& tensor : shared->tensors())
        files.tensors.push_back(stream_tensor(shared, tensor, dtype_option(o)));
    put_in_blocks(o, files);
    plan.index["voxfield_transformer"] = {"semrover", "VoxfieldTransformer"};
    plan.components["voxfield_transformer"] = std::move(files);
    return {};
}

// the one beside the weights, and those that presets name
Status copy_adapters(const Path& folder, Conversion& plan)
{
    Json presets = plan.index.value("presets", Json::object());
    if (!presets.is_object())
        presets = Json::object();
    presets[""] = Json::object();
    for (const Json& preset : presets) {
        SR_TRY(const std::string name, preset_adapter(preset));
        if (is_file(folder / name))
            plan.copies["voxfield_transformer/" + name] = folder / name;
    }
    return {};
}

// small files that go over as they are, what the old index says about them, and names of the rest
Status plan_copies(const Path& in, Conversion& plan)
{
    const std::string small[] = {"scheduler/scheduler_config.json", "voxfield_scheduler/scheduler_config.json",
                                 "conditioning/conditioning.safetensors"};
    SR_TRY(const Json index, read_model_index(in));
    for (const std::string& file : small) {
        if (!is_there(in / file))
            continue;
        plan.copies[file] = in / file;
        const std::string component = Path(file).parent_path().generic_string();
        if (index.contains(component))
            plan.index[component] = index[component];
    }
    for (const char* settings : {"defaults", "presets"})
        if (index.contains(settings))
            plan.index[settings] = index[settings];
    SR_CHECK(copy_adapters(in / "voxfield_transformer", plan));
    static constexpr const char* kKnown[] = {"renderer",           "unet",      "vae",         "voxfield_transformer",
                                             "voxfield_scheduler", "scheduler", "conditioning"};
    SR_TRY(const std::vector<Path> folders, list_folders(in));
    for (const Path& folder : folders)
        if (std::ranges::find(kKnown, folder.filename()) == std::end(kKnown))
            plan.left_out.push_back(folder.filename().string());
    return {};
}

// the text, where the file holds one, and names of what is left out
Status plan_ldm_rest(const Path& in, Conversion& plan)
{
    SR_TRY(SafetensorsSet opened, SafetensorsSet::open(in));
    const auto shared = std::make_shared<const SafetensorsSet>(std::move(opened));
    const SafetensorsSet& set = *shared;
    if (const TensorInfo* text = set.find(kLdmConditioning)) {
        plan.text = stream_tensor(shared, *text, text->dtype);
        plan.text->name = kConditioning;
    }
    for (const char* prefix : {"cond_stage_model.", "conditioner.", "model_ema."})
        if (std::ranges::any_of(set.tensors(), [&](const TensorInfo& t) { return t.name.starts_with(prefix); }))
            plan.left_out.push_back(std::string(prefix) + "*");
    return {};
}

Result<Conversion> plan_conversion(const ConvertModelOptions& o)
{
    Conversion plan;
    const Path in = o.in;
    const bool folder = is_folder(in), transformer = folder && is_there(in / "voxfield_transformer");
    if (transformer)
        SR_CHECK(plan_transformer(o, in / "voxfield_transformer", plan));
    if (!transformer || is_there(in / "renderer") || is_there(in / "unet"))
        SR_CHECK(plan_renderer(o, plan));
    else if (o.asd_init || o.vsd_init)
        return fail(ErrorCode::bad_input, "{}: has no renderer for {}", quote_path(in),
                    o.asd_init ? "--asd-init" : "--vsd-init");
    SR_CHECK(folder ? plan_copies(in, plan) : plan_ldm_rest(in, plan));
    return plan;
}

// ---- writing

// each tensor reports that it is done, and stops where the user wants
void watch(Conversion& plan, Progress& progress, uint64_t& done)
{
    for (auto& [name, files] : plan.components)
        for (TensorStream& tensor : files.tensors)
            tensor.bytes = [make = std::move(tensor.bytes), &progress,
                            &done](std::vector<std::byte>& scratch) -> Result<std::span<const std::byte>> {
                if (interrupt_requested())
                    return fail(ErrorCode::interrupted, "interrupted; nothing was written");
                progress.update(done++);
                return make(scratch);
            };
}

Status write_conversion(Conversion& plan, const Path& out, const Globals& globals)
{
    uint64_t total = 0, done = 0;
    for (const auto& [name, files] : plan.components)
        total += files.tensors.size();
    Progress progress(progress_to_stderr(globals), "convert", "tensors", total);
    watch(plan, progress, done);
    SR_CHECK(make_folder(out.parent_path()));
    SR_TRY(OutputFolder folder, OutputFolder::create(out, true));
    for (const auto& [name, files] : plan.components)
        SR_CHECK(write_component(folder / name, files));
    for (const auto& [name, json] : plan.texts)
        SR_CHECK(write_json(folder / name, json));
    for (const auto& [name, from] : plan.copies) {
        SR_TRY(const MappedFile file, MappedFile::open(from));
        SR_CHECK(make_folder((folder / name).parent_path()));
        SR_CHECK(write_file_atomically(folder / name, file.bytes()));
    }
    if (plan.text) {
        SR_CHECK(make_folder(folder / "conditioning"));
        SR_CHECK(stream_safetensors(folder / "conditioning" / "conditioning.safetensors", std::span(&*plan.text, 1)));
    }
    SR_CHECK(write_json(folder / "model_index.json", plan.index));
    SR_CHECK(folder.commit());
    progress.update(total);
    progress.finish();
    return {};
}

Status check_output(const ConvertModelOptions& o, const Path& out, const Globals& globals)
{
    std::error_code ignored;
    if (fs::equivalent(o.in, out, ignored))
        return fail(ErrorCode::usage, "IN and OUT are the same, {}", quote_path(out));
    SR_TRY(const bool there, has_folder(out));
    return there && fs::is_empty(out, ignored) ? Status() : refuse_existing(out, globals.yes);
}

void report(const Conversion& plan, const ConvertModelOptions& o, const Globals& globals)
{
    Json components = Json::object();
    for (const auto& [name, files] : plan.components) {
        uint64_t parameters = 0, bytes = 0;
        for (const TensorStream& tensor : files.tensors) {
            uint64_t elements = 1;
            for (const uint64_t dim : tensor.shape)
                elements *= dim;
            parameters += is_scales(tensor.name) ? 0 : elements;
            bytes += elements * dtype_bytes(tensor.dtype);
        }
        components[name] = {{"tensors", files.tensors.size()}, {"parameters", parameters}, {"bytes", bytes}};
        if (!globals.json)
            fmt::print("{:22}{} tensors, {} parameters, {}\n", name, files.tensors.size(), parameters,
                       bytes_text(bytes));
    }
    if (globals.json) {
        const Json all{{"output", o.out}, {"components", components}, {"left_out", plan.left_out}};
        fmt::print("{}\n", json_text(all));
    } else if (!plan.left_out.empty()) {
        fmt::print("left out: {} (the text is a constant: conditioning/)\n",
                   printable(fmt::format("{}", fmt::join(plan.left_out, ", ")), 1000));
    }
}

} // namespace

bool is_model(const Path& path)
{
    const auto holds_weights = [](const Path& file) {
        for (const char* extension : {".safetensors", ".ckpt", ".pt", ".pth", ".bin"})
            if (file.extension() == extension)
                return true;
        return file.string().ends_with(".index.json");
    };
    if (!is_folder(path)) {
        const auto file = MappedFile::open(path);
        const bool safetensors = file && file->bytes().size() > 8 && file->bytes()[8] == std::byte('{');
        return holds_weights(path) || safetensors; // whose header begins there
    }
    for (const char* part : {"model_index.json", "config.json", "scheduler_config.json", "voxfield_transformer",
                             "renderer", "unet", "vae"})
        if (is_there(path / part))
            return true;
    const auto files = list_files(path);
    return files && std::ranges::any_of(*files, holds_weights);
}

Status convert_model(const ConvertModelOptions& o, const Globals& globals)
{
    Path out = fs::absolute(o.out).lexically_normal();
    if (!out.has_filename())
        out = out.parent_path(); // "model/"
    if (!o.dry_run)
        SR_CHECK(check_output(o, out, globals));
    SR_TRY(Conversion plan, plan_conversion(o));
    for (const std::string& warning : plan.warnings)
        if (!globals.quiet)
            print_stderr("semrover: warning: {}\n", warning);
    if (!o.dry_run)
        SR_CHECK(write_conversion(plan, out, globals));
    report(plan, o, globals);
    return {};
}

} // namespace semrover
