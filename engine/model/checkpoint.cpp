// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/checkpoint.h"

#include "engine/model/ldm_config.h"
#include "runtime/base/hash.h"
#include "runtime/base/keyed_random.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr uint64_t kPlainChannels = 4, kRendererChannels = 13;

// what diffusers called the parts of VAE attention until 0.16
constexpr std::pair<std::string_view, std::string_view> kOldAttention[] = {
    {".query.", ".to_q."}, {".key.", ".to_k."}, {".value.", ".to_v."}, {".proj_attn.", ".to_out.0."}};

std::string modern_name(const std::string& name)
{
    if (name.find("mid_block.attentions.") == std::string::npos)
        return name;
    for (const auto& [old_part, new_part] : kOldAttention)
        if (const size_t at = name.find(old_part); at != std::string::npos)
            return std::string(name).replace(at, old_part.size(), new_part);
    return name;
}

// [N, K] and [N, K, 1, 1] hold the same numbers in the same order
bool same_matrix(std::span<const uint64_t> a, std::span<const uint64_t> b)
{
    if (a.size() > b.size())
        std::swap(a, b);
    return std::ranges::equal(a, b) ||
           (a.size() == 2 && b.size() == 4 && std::ranges::equal(a, b.first(2)) && b[2] == 1 && b[3] == 1);
}

// 24 bits as -1 <= x < 1
float centred(uint64_t bits)
{
    return float(int32_t(bits & 0xffffff) - 0x800000) * (1.f / 0x800000);
}

} // namespace

void random_tensor(uint64_t seed, const TensorSpec& spec, std::vector<float>& values)
{
    uint64_t count = 1, fan_in = 1;
    for (size_t i = 0; i < spec.shape.size(); ++i) {
        count *= spec.shape[i];
        fan_in *= i ? spec.shape[i] : 1;
    }
    float centre = 0, scale = std::sqrt(3.f / float(fan_in)); // a uniform number's variance is scale^2 / 3
    if (spec.shape.size() < 2) {
        const bool norm = spec.name.ends_with("weight");
        centre = norm ? 1.f : 0.f;
        scale = norm ? 0.1f : 0.05f;
    }
    Hash hash;
    hash.add(spec.name);
    const uint64_t key = mix64(hash.value() ^ mix64(seed + kMixStep));
    values.resize(count);
    float* out = values.data();
    const uint64_t pairs = count / 2;
    for (uint64_t i = 0; i < pairs; ++i) {
        const uint64_t bits = mix64(key + i * kMixStep);
        out[2 * i] = centre + scale * centred(bits);
        out[2 * i + 1] = centre + scale * centred(bits >> 32);
    }
    if (count % 2)
        out[count - 1] = centre + scale * centred(mix64(key + pairs * kMixStep));
}

Result<Checkpoint> Checkpoint::open_folder(const Path& folder, Network network)
{
    Checkpoint c;
    SR_TRY(SafetensorsSet set, SafetensorsSet::open_folder(folder));
    if (network == Network::vae)
        for (const TensorInfo& tensor : set.tensors())
            if (const std::string name = modern_name(tensor.name); name != tensor.name && !set.find(name))
                c.names_.emplace(name, tensor.name);
    c.set_ = std::make_shared<const SafetensorsSet>(std::move(set));
    return c;
}

Result<Checkpoint> Checkpoint::open_ldm(const Path& file, Network network, const UnetConfig* unet, const VaeConfig* vae)
{
    Checkpoint c;
    SR_TRY(SafetensorsSet set, SafetensorsSet::open(file));
    c.prefix_ = network == Network::unet ? kLdmUnet : ldm_vae_prefix(set);
    if (c.prefix_.empty())
        return fail(ErrorCode::bad_input, "{}: has no VAE: expected tensors {}* or {}*", quote_path(file), kLdmVae[0],
                    kLdmVae[1]);
    if (network == Network::unet) {
        SR_ASSERT(unet, "the UNet's config says where its tensors are");
        for (const TensorSpec& spec : unet_schema(*unet))
            c.names_.emplace(spec.name, c.prefix_ + ldm_unet_name(*unet, spec.name));
    } else {
        SR_ASSERT(vae, "the VAE's config says where its tensors are");
        for (const TensorSpec& spec : vae_schema(*vae))
            c.names_.emplace(spec.name, c.prefix_ + ldm_vae_name(*vae, spec.name));
    }
    c.set_ = std::make_shared<const SafetensorsSet>(std::move(set));
    return c;
}

Checkpoint Checkpoint::random(uint64_t seed)
{
    Checkpoint c;
    c.seed_ = seed;
    return c;
}

const std::string& Checkpoint::file_name(const std::string& name) const
{
    const auto found = names_.find(name);
    return found == names_.end() ? name : found->second;
}

const TensorInfo* Checkpoint::find(const TensorSpec& spec) const
{
    return set_->find(file_name(spec.name));
}

Status Checkpoint::require(std::span<const TensorSpec> schema) const
{
    if (!set_)
        return {};
    std::vector<TensorSpec> in_file(schema.begin(), schema.end());
    for (TensorSpec& spec : in_file) {
        const TensorInfo* tensor = find(spec);
        if (tensor && spec.name == "conv_in.weight" && spec.shape.size() == 4 && spec.shape[1] == kRendererChannels &&
            tensor->shape.size() == 4 && tensor->shape[1] == kPlainChannels)
            return refuse_plain_unet(set_->path());
        if (tensor && same_matrix(tensor->shape, spec.shape))
            spec.shape = tensor->shape;
        spec.name = file_name(spec.name);
    }
    return set_->require(in_file, Unexpected::refuse, prefix_);
}

Result<TensorValues> Checkpoint::values(const TensorSpec& spec, std::vector<float>& scratch) const
{
    if (!set_) {
        random_tensor(seed_, spec, scratch);
        return TensorValues{std::as_bytes(std::span(scratch)), DType::f32, {}, spec.name};
    }
    const TensorInfo* tensor = find(spec);
    SR_ASSERT(tensor && same_matrix(tensor->shape, spec.shape), "{} was not required", spec.name);
    return TensorValues{set_->bytes(*tensor), tensor->dtype, set_->path(), tensor->name};
}

TensorStream Checkpoint::stream(const TensorSpec& spec, std::optional<DType> dtype) const
{
    if (set_) {
        const TensorInfo* tensor = find(spec);
        SR_ASSERT(tensor && same_matrix(tensor->shape, spec.shape), "{} was not required", spec.name);
        TensorStream stream = stream_tensor(set_, *tensor, dtype);
        stream.name = spec.name;
        stream.shape = spec.shape;
        return stream;
    }
    const DType target = dtype.value_or(DType::f32);
    const auto make = [seed = seed_, spec,
                       target](std::vector<std::byte>& scratch) -> Result<std::span<const std::byte>> {
        std::vector<float> values;
        random_tensor(seed, spec, values);
        return encode_floats(values, target, spec.name, scratch);
    };
    return {spec.name, target, spec.shape, make};
}

tl::unexpected<Error> refuse_plain_unet(const Path& path)
{
    return fail(
        ErrorCode::bad_input,
        "{}: conv_in takes {} channels, a plain Stable Diffusion UNet; the deferred renderer needs {}: the noisy "
        "latent (4) and 9 more: previous latent (4), buffer latent (4), visibility (1). `asd_init` adds "
        "them with zero weights, to be trained",
        quote_path(path), kPlainChannels, kRendererChannels);
}

} // namespace semrover
