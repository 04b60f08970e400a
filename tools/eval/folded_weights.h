// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/weight_loader.h"
#include "kernels/network.h"

#include <array>

namespace semrover {

// Convolutions of a PyTorch state dict, with batch norms or without. A norm is folded into its convolution in double
// when they are loaded:  w' = w g / sqrt(v + eps), b' = (b - m) g / sqrt(v + eps) + beta. The file says how many
// outputs a layer has.
class FoldedWeights {
  public:
    explicit FoldedWeights(SafetensorsSet file) : file_(std::move(file)) {}

    struct Shape {
        ConvOptions::Taps taps = {1, 1, 0, 0};
        std::vector<uint32_t> inputs; // channels of each branch that is concatenated, each padded to kRowPadding
        uint32_t outputs = 0;         // of the usual network: what an error expects when the file has no such layer
        bool bias = false;            // of the convolution, in front of the norm, if any
        double eps = 1e-5;            // of the norm
    };
    // the layer's number; `convolution` and `norm` are names without .weight; an empty norm is none
    uint32_t add(const std::string& convolution, const std::string& norm, const Shape& shape);
    uint32_t outputs(uint32_t layer) const { return layers_[layer].shape.outputs; }
    // a tensor that is not used and may be there
    void allow(const std::string& name);

    // Errors, bad_input: missing, misshapen and unexpected tensors (of those with `prefix`) in one line; NaN or
    // infinity; a variance below zero
    Status load(Device& device, std::string_view prefix = {});

    // [outputs, taps * padded inputs] fp32
    Tensor weight(Graph& g, uint32_t layer) const { return layers_[layer].weight.in(g); }
    // [1, outputs] fp32; zeros where the file has neither norm nor bias
    Tensor bias(Graph& g, uint32_t layer) const { return layers_[layer].bias.in(g); }

  private:
    struct Layer {
        std::string convolution, norm;
        Shape shape;
        DeviceTensor weight, bias;
    };
    Result<std::vector<double>> read(const std::string& name) const;
    static std::array<WeightLayout, 2> layouts_of(const Layer& layer); // weight, bias
    // the values of one of them, in the order of the file
    Status fold(const Layer& layer, bool of_bias, std::vector<float>& values) const;
    Status apply_norm(const Layer& layer, bool of_bias, std::vector<double>& numbers) const;

    SafetensorsSet file_;
    std::vector<Layer> layers_;
    std::vector<TensorSpec> schema_;
    TensorPool state_;
};

} // namespace semrover
