// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/checkpoint.h"
#include "engine/model/ldm_config.h"
#include "tools/dataset/model_writer.h"

#include <gtest/gtest.h>

namespace semrover {

// a small network of each kind, with uneven levels, for tests of files
inline UnetConfig small_unet()
{
    UnetConfig c;
    c.in_channels = 13;
    c.block_out_channels = {32, 64, 64};
    c.layers_per_block = {2, 2, 2};
    c.down_attention = {true, true, false};
    c.up_attention = {false, true, true};
    c.heads = {8, 8, 8};
    c.transformer_layers = {1, 1, 1};
    c.cross_attention_dim = 24;
    return c;
}

inline VaeConfig small_vae()
{
    VaeConfig c;
    c.block_out_channels = {32, 64, 64};
    c.layers_per_block = 1;
    return c;
}

// of videos, as a single file's shapes tell it: heads of 64 channels, three numbers that come with a video
inline UnetConfig small_video_unet()
{
    UnetConfig c;
    c.video = c.use_linear_projection = true;
    c.in_channels = 9;
    c.block_out_channels = {32, 64};
    c.layers_per_block = {1, 1};
    c.down_attention = {true, false};
    c.up_attention = {false, true};
    c.heads = {1, 1};
    c.transformer_layers = {1, 1};
    c.cross_attention_dim = 1024;
    c.added_embed_dim = 8;
    c.added_numbers = 3;
    c.num_frames = 25;
    return c;
}

inline VaeConfig small_video_vae()
{
    VaeConfig c;
    c.video = true;
    c.block_out_channels = {32, 64};
    c.use_quant_conv = c.use_post_quant_conv = false;
    return c;
}

// tensors to write, and a file of them
struct Weights {
    std::map<std::string, TensorSpec> specs; // by name in the file
    std::map<std::string, std::vector<float>> values;

    void add(const std::string& name, TensorSpec spec, uint64_t seed = 1)
    {
        random_tensor(seed, spec, values[name]);
        specs[name] = std::move(spec);
    }
    void add(std::span<const TensorSpec> schema)
    {
        for (const TensorSpec& spec : schema)
            add(spec.name, spec);
    }
    void rename(const std::string& from, const std::string& to)
    {
        specs[to] = specs.at(from);
        values[to] = values.at(from);
        erase(from);
    }
    void erase(const std::string& name)
    {
        specs.erase(name);
        values.erase(name);
    }

    void write(const Path& path, DType dtype = DType::f32,
               const std::map<std::string, std::string>& metadata = {}) const
    {
        std::map<std::string, std::vector<std::byte>> bytes;
        std::vector<TensorData> tensors;
        for (const auto& [name, spec] : specs) {
            std::vector<std::byte>& data = bytes[name];
            data.resize(values.at(name).size() * dtype_bytes(dtype));
            from_float(values.at(name), dtype, data.data());
            tensors.push_back({name, dtype, spec.shape, data});
        }
        std::filesystem::create_directories(path.parent_path());
        const Status status = write_safetensors(path, tensors, metadata);
        EXPECT_TRUE(status) << status.error().message;
    }
};

// both networks as one LDM file; attention of its VAE is [C, C, 1, 1]
inline Weights ldm_weights(const UnetConfig& unet, const VaeConfig& vae, std::string_view vae_prefix = kLdmVae[0])
{
    Weights w;
    for (const TensorSpec& spec : unet_schema(unet))
        w.add(std::string(kLdmUnet) + ldm_unet_name(unet, spec.name), spec);
    for (const TensorSpec& spec : vae_schema(vae)) {
        const std::string name = std::string(vae_prefix) + ldm_vae_name(vae, spec.name);
        w.add(name, spec);
        if (spec.shape.size() == 2)
            w.specs[name].shape = {spec.shape[0], spec.shape[1], 1, 1};
    }
    return w;
}

} // namespace semrover
