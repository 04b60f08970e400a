// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// weights, and configs of networks and of their schedules
#include "engine/model/ldm_config.h"
#include "engine/model/low_rank.h"
#include "engine/model/renderer_model.h"
#include "engine/model/transformer_weights.h"
#include "engine/sampling/scheduler_config.h"
#include "engine/voxfield/voxfield_model.h"
#include "runtime/base/json.h"
#include "runtime/base/safetensors.h"
#include "tests/fuzz/fuzz_target.h"

namespace semrover::fuzz {

namespace models {

// what a file says is what a file of it says again
void write_again(const Safetensors& file)
{
    std::vector<TensorData> tensors;
    for (const TensorInfo& t : file.tensors())
        tensors.push_back({t.name, t.dtype, t.shape, file.bytes(t)});
    const std::vector<std::byte> bytes = encode_safetensors(tensors, file.metadata());
    const auto again = parse_safetensors_header(bytes, "written");
    if (!again)
        found("a file that was read is refused when it is written: " + again.error().message);
    if (again->tensors.size() != file.tensors().size() || again->metadata != file.metadata())
        found("a file that was read is another when it is written");
}

void safetensors(Bytes input)
{
    const InputFile file(input, "m.safetensors");
    if (const auto read = Safetensors::open(file); accepts(read))
        write_again(*read);
    if (const auto set = SafetensorsSet::open(file); accepts(set)) {
        (void)accepts(check_finite(*set));
        if (is_ldm(*set)) {
            (void)accepts(ldm_unet_config(*set));
            (void)accepts(ldm_vae_config(*set));
        }
    }
}

void safetensors_index(Bytes input)
{
    const InputFolder folder(input, "m.safetensors.index.json");
    if (const auto set = SafetensorsSet::open(folder.first()); accepts(set))
        (void)accepts(check_finite(*set));
    (void)accepts(SafetensorsSet::open_folder(folder, "m"));
}

void network_config(Bytes input)
{
    const auto json = parse_json(text_of(input), "config.json");
    if (!accepts(json))
        return;
    (void)accepts(parse_transformer_config(*json));
    if (const auto unet = parse_any_unet_config(*json); accepts(unet))
        (void)unet_schema(*unet);
    if (const auto vae = parse_any_vae_config(*json); accepts(vae))
        (void)vae_schema(*vae);
}

void scheduler_config(Bytes input)
{
    std::vector<std::string> warnings;
    (void)accepts(scheduler_config_from_text(text_of(input), warnings));
}

void model_folder(Bytes input)
{
    const InputFolder folder(input, "model_index.json");
    (void)accepts(VoxfieldModel::open(folder));
    (void)accepts(VoxfieldModel::open(folder, "quality"));
    if (const auto model = RendererModel::read(folder); accepts(model)) {
        (void)accepts(model->open_unet());
        (void)accepts(model->open_vae());
    }
    (void)accepts(RendererModel::open(folder));
}

void adapter(Bytes input)
{
    const InputFile file(input, kAdapterFile);
    const std::vector<TensorSpec> schema = {{"a.weight", {4, 3}}, {"b.weight", {2, 2}}};
    const auto read = LowRankAdapter::open(file);
    if (!accepts(read) || !accepts(read->require(schema)))
        return;
    std::vector<float> values(12);
    if (read->has("a.weight"))
        read->add("a.weight", values);
}

constexpr FuzzTarget kTargets[] = {
    {"safetensors", "*.safetensors *.sgrid", safetensors},
    {"safetensors_index", "*.folder *.index.json", safetensors_index},
    {"network_config", "*.json", network_config},
    {"scheduler_config", "*.json", scheduler_config},
    {"model_folder", "*.folder", model_folder, 64 << 10},
    {"adapter", "*.safetensors", adapter},
};

} // namespace models

std::span<const FuzzTarget> model_targets()
{
    return models::kTargets;
}

} // namespace semrover::fuzz
