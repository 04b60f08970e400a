// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// make_renderer OUT --config UNET.json --vae VAE.json: a deferred renderer with random weights, a folder in the
// diffusers layout or a single LDM file. A config file may be a golden layout: then its "config" is taken.
#include "engine/model/checkpoint.h"
#include "engine/model/ldm_config.h"
#include "engine/model/renderer_model.h"
#include "tests/support/json_text.h"
#include "tools/dataset/model_writer.h"

#include <CLI/CLI.hpp>

namespace semrover {
namespace {

struct Options {
    std::string out, unet, vae, layout = "diffusers", dtype = "f16";
    uint32_t shards = 1, tokens = 77;
    uint64_t seed = 0;
    bool bare = false;
};

struct Networks {
    UnetConfig unet;
    VaeConfig vae;
    Json unet_json, vae_json;
    DType dtype = DType::f16;
};

Result<Json> read_config(const Path& path)
{
    SR_TRY(const Json json, read_json(path));
    return json.is_object() && json.contains("config") ? json["config"] : json;
}

Result<Networks> read_networks(const Options& o)
{
    Networks n;
    SR_TRY(n.unet_json, read_config(o.unet));
    SR_TRY(n.vae_json, read_config(o.vae));
    SR_TRY(n.unet, parse_unet_config(n.unet_json));
    SR_TRY(n.vae, parse_vae_config(n.vae_json));
    n.dtype = o.dtype == "f32" ? DType::f32 : o.dtype == "f16" ? DType::f16 : DType::bf16;
    return n;
}

ComponentFiles component(const Json& config, std::span<const TensorSpec> schema, const Options& o, DType dtype)
{
    ComponentFiles files{config, {}};
    for (const TensorSpec& spec : schema)
        files.tensors.push_back(Checkpoint::random(o.seed).stream(spec, dtype));
    return files;
}

// the constant text, the same numbers under either layout's name
TensorStream text_stream(const Options& o, const Networks& n, std::string_view name)
{
    const TensorSpec text{std::string(kConditioning), {1, o.tokens, n.unet.cross_attention_dim}};
    TensorStream stream = Checkpoint::random(o.seed).stream(text, n.dtype);
    stream.name = name;
    return stream;
}

Status write_diffusers(const Options& o, const Networks& n)
{
    const Path out = o.out;
    SR_CHECK(write_component(out / "renderer", component(n.unet_json, unet_schema(n.unet), o, n.dtype), o.shards));
    SR_CHECK(write_component(out / "vae", component(n.vae_json, vae_schema(n.vae), o, n.dtype)));
    SR_CHECK(write_json(out / "scheduler" / "scheduler_config.json", stable_diffusion_scheduler_json()));
    std::filesystem::create_directories(out / "conditioning");
    const TensorStream stream = text_stream(o, n, kConditioning);
    SR_CHECK(stream_safetensors(out / "conditioning" / "conditioning.safetensors", std::span(&stream, 1)));
    return write_json(out / "model_index.json", {{"_class_name", "SemRoverPipeline"},
                                                 {"renderer", {"diffusers", "UNet2DConditionModel"}},
                                                 {"vae", {"diffusers", "AutoencoderKL"}},
                                                 {"scheduler", {"diffusers", "DDIMScheduler"}}});
}

Status write_ldm(const Options& o, const Networks& n)
{
    std::vector<TensorStream> tensors;
    for (const TensorSpec& spec : unet_schema(n.unet)) {
        tensors.push_back(Checkpoint::random(o.seed).stream(spec, n.dtype));
        tensors.back().name = std::string(kLdmUnet) + ldm_unet_name(n.unet, spec.name);
    }
    for (const TensorSpec& spec : vae_schema(n.vae)) {
        tensors.push_back(Checkpoint::random(o.seed).stream(spec, n.dtype));
        tensors.back().name = std::string(kLdmVae[0]) + ldm_vae_name(n.vae, spec.name);
        if (spec.shape.size() == 2) // attention
            tensors.back().shape.insert(tensors.back().shape.end(), {1, 1});
    }
    std::map<std::string, std::string> metadata;
    if (!o.bare) {
        tensors.push_back(text_stream(o, n, kLdmConditioning));
        metadata["semrover.config"] = Json{{"unet", n.unet_json}, {"vae", n.vae_json}}.dump();
    }
    return stream_safetensors(o.out, tensors, metadata);
}

Status make(const Options& o)
{
    SR_TRY(const Networks n, read_networks(o));
    return o.layout == "ldm" ? write_ldm(o, n) : write_diffusers(o, n);
}

} // namespace
} // namespace semrover

int main(int argc, char** argv)
{
    using namespace semrover;
    Options o;
    CLI::App app("write a deferred renderer with random weights");
    app.allow_windows_style_options(false);
    app.add_option("OUT", o.out, "folder, or .safetensors file for --layout ldm")->required();
    app.add_option("--config", o.unet, "the UNet's config.json, or a golden layout")->required();
    app.add_option("--vae", o.vae, "the VAE's")->required();
    app.add_option("--layout", o.layout, "diffusers or ldm")->check(CLI::IsMember({"diffusers", "ldm"}));
    app.add_option("--shards", o.shards, "files of the UNet")->check(CLI::Range(1u, 1000u));
    app.add_option("--dtype", o.dtype, "f32, f16 or bf16")->check(CLI::IsMember({"f32", "f16", "bf16"}));
    app.add_option("--seed", o.seed, "of the weights");
    app.add_flag("--bare", o.bare, "an LDM file without config and text, as real ones are");
    app.add_option("--tokens", o.tokens, "of the constant text")->check(CLI::Range(1u, 4096u));
    CLI11_PARSE(app, argc, argv);
    if (const Status status = make(o); !status) {
        fmt::print(stderr, "make_renderer: error: {}\n", status.error().message);
        return int(status.error().code);
    }
    return 0;
}
