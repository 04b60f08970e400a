// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/safetensors.h"

#include <cmath>
#include <gtest/gtest.h>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace semrover {

// named tensors of a PyTorch module, with random numbers, and a file of them
struct StateDict {
    std::map<std::string, std::pair<std::vector<uint64_t>, std::vector<float>>> tensors;
    std::mt19937 random{1};

    void add(const std::string& name, std::vector<uint64_t> shape, double scale, double shift = 0,
             bool positive = false)
    {
        uint64_t count = 1;
        for (const uint64_t n : shape)
            count *= n;
        std::normal_distribution<double> normal(0, scale);
        std::vector<float> values(count);
        for (float& v : values) {
            const double x = normal(random);
            v = float(shift + (positive ? std::abs(x) : x));
        }
        tensors[name] = {std::move(shape), std::move(values)};
    }
    // a convolution and its batch norm, so that activations stay of order one
    void add_layer(const std::string& conv, const std::string& norm, uint64_t outputs, uint64_t inputs, uint64_t height,
                   uint64_t width, bool bias)
    {
        add(conv + ".weight", {outputs, inputs, height, width}, std::sqrt(2. / double(inputs * height * width)));
        if (bias)
            add(conv + ".bias", {outputs}, 0.2);
        add(norm + ".weight", {outputs}, 0.2, 0.9);
        add(norm + ".bias", {outputs}, 0.3, 0.1);
        add(norm + ".running_mean", {outputs}, 0.2);
        add(norm + ".running_var", {outputs}, 0.5, 0.4, true);
    }
    const std::vector<float>& values(const std::string& name) const { return tensors.at(name).second; }
    uint64_t size(const std::string& name, size_t axis) const { return tensors.at(name).first.at(axis); }

    void write(const std::filesystem::path& path) const
    {
        std::vector<TensorData> data;
        for (const auto& [name, tensor] : tensors)
            data.push_back({name, DType::f32, tensor.first, std::as_bytes(std::span(tensor.second))});
        const int64_t batches = 12; // what every batch norm of PyTorch keeps, of another type and without a shape
        for (const auto& [name, tensor] : tensors)
            if (const size_t at = name.find(".running_mean"); at != std::string::npos)
                data.push_back({name.substr(0, at) + ".num_batches_tracked",
                                DType::i64,
                                {},
                                std::as_bytes(std::span(&batches, 1))});
        const Status status = write_safetensors(path, data);
        ASSERT_TRUE(status) << status.error().message;
    }
};

} // namespace semrover
