// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/model/low_rank.h"
#include "engine/model/weight_blocks.h"
#include "engine/voxfield/token_sampler.h"
#include "runtime/base/json.h"
#include "runtime/base/keyed_random.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <filesystem>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_low_rank_test {

const Path kModel = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
constexpr const char* kWeights = "diffusion_pytorch_model.safetensors";

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

// tensors by name, fp32
struct Tensors {
    std::map<std::string, std::pair<std::vector<uint64_t>, std::vector<float>>> all;

    void add(const std::string& name, std::vector<uint64_t> shape, uint64_t seed)
    {
        KeyedRandom random(seed, {1});
        std::vector<float> values(shape[0] * shape[1]);
        for (float& v : values)
            v = float(random.uniform(-0.3, 0.3));
        all[name] = {std::move(shape), std::move(values)};
    }
    void write(const Path& path) const
    {
        std::vector<TensorData> data;
        for (const auto& [name, tensor] : all)
            data.push_back({name, DType::f32, tensor.first, std::as_bytes(std::span(tensor.second))});
        ASSERT_TRUE(write_safetensors(path, data));
    }
};

Tensors weights()
{
    const SafetensorsSet set = *SafetensorsSet::open_folder(kModel);
    Tensors t;
    for (const TensorInfo& tensor : set.tensors()) {
        auto& [shape, values] = t.all[tensor.name];
        shape = tensor.shape;
        values.resize(tensor.elements());
        to_float(set.bytes(tensor), tensor.dtype, values.data());
    }
    return t;
}

Path model_in(const ScratchFolder& folder, const char* name, const Tensors& tensors)
{
    std::filesystem::create_directories(folder / name);
    std::filesystem::copy_file(kModel / "config.json", folder / name / "config.json");
    tensors.write(folder / name / kWeights);
    return folder / name;
}

// the same with the weights of its blocks in 8 bits
Path blocks_in(const ScratchFolder& folder, const char* name, const Tensors& tensors)
{
    std::filesystem::create_directories(folder / name);
    Json config = *read_json(kModel / "config.json");
    config["weights"] = "q8_0";
    folder.put(std::string(name) + "/config.json", config.dump());
    std::map<std::string, WeightBlocks> blocks;
    std::vector<TensorData> data;
    for (const auto& [tensor, content] : tensors.all) {
        const auto& [shape, values] = content;
        if (!stored_in_blocks(tensor, shape)) {
            data.push_back({tensor, DType::f32, shape, std::as_bytes(std::span(values))});
            continue;
        }
        to_blocks(values, uint32_t(shape[1]), 1, blocks[tensor]);
        data.push_back({tensor, DType::i8, shape, std::as_bytes(std::span(blocks[tensor].values))});
        const TensorSpec scales = scales_of({tensor, shape});
        data.push_back({scales.name, DType::f16, scales.shape, std::as_bytes(std::span(blocks[tensor].scales))});
    }
    EXPECT_FALSE(blocks.empty());
    EXPECT_TRUE(write_safetensors(folder / name / kWeights, data));
    return folder / name;
}

std::vector<float> run(const Path& model)
{
    const auto transformer = Transformer::load(device(), model, DType::f32);
    EXPECT_TRUE(transformer) << transformer.error().message;
    RegionInput region;
    for (int32_t i = 0; i < 20; ++i) {
        region.cells.push_back({i % 5, i / 5, 0});
        region.labels.push_back(uint8_t(i));
    }
    region.fixed.resize(20 * (*transformer)->config().channels());
    SchedulerConfig config;
    config.prediction = Prediction::sample;
    auto sampler = TokenSampler::create(device(), **transformer, *plan_sampling(config, 2), {{1}, 7});
    EXPECT_TRUE(sampler) << sampler.error().message;
    return *(*sampler)->run(std::vector{region});
}

// B A of a layer's adapter, added to its weight in double precision
void merge(Tensors& into, const Tensors& adapter, const std::string& layer)
{
    const auto& [a_shape, a] = adapter.all.at(layer + ".lora_A.weight");
    const auto& [b_shape, b] = adapter.all.at(layer + ".lora_B.weight");
    std::vector<float>& w = into.all.at(layer + ".weight").second;
    for (uint64_t n = 0; n < b_shape[0]; ++n)
        for (uint64_t k = 0; k < a_shape[1]; ++k) {
            double sum = double(w[n * a_shape[1] + k]);
            for (uint64_t r = 0; r < a_shape[0]; ++r)
                sum += double(b[n * a_shape[0] + r]) * double(a[r * a_shape[1] + k]);
            w[n * a_shape[1] + k] = float(sum);
        }
}

double largest_difference(const std::vector<float>& a, const std::vector<float>& b)
{
    EXPECT_EQ(a.size(), b.size());
    double largest = 0;
    for (size_t i = 0; i < a.size(); ++i)
        largest = std::max(largest, std::abs(double(a[i]) - double(b[i])));
    return largest;
}

TEST(engine_low_rank, an_adapter_is_added_to_the_weights_beside_it)
{
    const ScratchFolder folder;
    const Tensors plain = weights();
    Tensors adapter, whole = plain;
    uint64_t seed = 0;
    for (const char* layer : {"transformer_blocks.0.attn.to_q", "transformer_blocks.0.attn.add_v_proj", "proj_in",
                              "transformer_blocks.1.ff.net.0.proj", "norm_out.linear", "semantic_embed"}) {
        const std::vector<uint64_t> shape = plain.all.at(std::string(layer) + ".weight").first;
        const uint64_t rank = 1 + ++seed % 3;
        adapter.add(std::string(layer) + ".lora_A.weight", {rank, shape[1]}, seed);
        adapter.add(std::string(layer) + ".lora_B.weight", {shape[0], rank}, seed + 100);
        merge(whole, adapter, layer);
    }
    const Path base = model_in(folder, "base", plain);
    const std::vector<float> before = run(base);
    adapter.write(base / kAdapterFile);
    const std::vector<float> with = run(base), merged = run(model_in(folder, "whole", whole));
    const double changed = largest_difference(with, before);
    EXPECT_LT(largest_difference(with, merged), 1e-5);
    EXPECT_GT(changed, 0.05);
    // to weights of 8 bits, too: 0.013 away without the adapter, 0.015 with it, of tokens that it changes by 1.4
    const Path blocks = blocks_in(folder, "blocks", plain);
    EXPECT_LT(largest_difference(run(blocks), before), 0.03);
    adapter.write(blocks / kAdapterFile);
    EXPECT_LT(largest_difference(run(blocks), merged), 0.03);
}

TEST(engine_low_rank, what_fits_no_weight_is_refused_by_name)
{
    const ScratchFolder folder;
    const Path model = model_in(folder, "model", weights());
    const auto load = [&](const Tensors& adapter) {
        adapter.write(model / kAdapterFile);
        return Transformer::load(device(), model, DType::f32);
    };
    const auto pair = [](const std::string& layer, uint64_t inputs, uint64_t outputs) {
        Tensors t;
        t.add(layer + ".lora_A.weight", {2, inputs}, 1);
        t.add(layer + ".lora_B.weight", {outputs, 2}, 2);
        return t;
    };
    const std::vector<uint64_t> shape = weights().all.at("proj_in.weight").first;
    EXPECT_TRUE(load(pair("proj_in", shape[1], shape[0])));
    EXPECT_TRUE(says(load(pair("proj_inn", 4, 4)), "there is no matrix 'proj_inn.weight'"));
    EXPECT_TRUE(says(load(pair("proj_in", shape[1] + 1, shape[0])), "'proj_in.weight' is ["));
    Tensors alone = pair("proj_in", shape[1], shape[0]);
    alone.all.erase("proj_in.lora_B.weight");
    EXPECT_TRUE(says(load(alone), "found beside them 'proj_in.lora_A.weight'"));
    Tensors odd = pair("proj_in", shape[1], shape[0]);
    odd.add("proj_in.alpha", {1, 1}, 3);
    EXPECT_TRUE(says(load(odd), "found beside them 'proj_in.alpha'"));
    Tensors ranks = pair("proj_in", shape[1], shape[0]);
    ranks.add("proj_in.lora_A.weight", {3, shape[1]}, 1);
    EXPECT_TRUE(says(load(ranks), "'proj_in.lora_A.weight'"));
    Tensors broken = pair("proj_in", shape[1], shape[0]);
    broken.all.at("proj_in.lora_A.weight").second[0] = INFINITY;
    EXPECT_TRUE(says(load(broken), "proj_in.lora_A.weight"));
    // sums that no type holds: infinite, and of infinities of both signs
    for (const char* layer : {"proj_in", "norm_out.linear", "semantic_embed", "transformer_blocks.0.attn.to_q"})
        for (const float second : {1e30f, -1e30f}) {
            const std::vector<uint64_t> matrix = weights().all.at(std::string(layer) + ".weight").first;
            Tensors huge = pair(layer, matrix[1], matrix[0]);
            std::ranges::fill(huge.all.at(std::string(layer) + ".lora_A.weight").second, 1e30f);
            std::ranges::fill(huge.all.at(std::string(layer) + ".lora_B.weight").second, 1e30f);
            huge.all.at(std::string(layer) + ".lora_B.weight").second[1] = second;
            EXPECT_TRUE(says(load(huge), layer)) << second;
        }
}

} // namespace engine_low_rank_test
} // namespace semrover
