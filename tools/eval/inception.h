// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "kernels/network.h"
#include "runtime/device/device.h"
#include "tools/eval/features.h"

#include <memory>
#include <span>

namespace semrover {

// Inception v3 as FID uses it (Szegedy et al. 2015; the TensorFlow graph of 2015-12-05 as ported by pytorch-fid): the
// network in front of the classifier, whose mean-pooled last block is the feature.
//
// The file is a state dict in safetensors with pytorch-fid's (torchvision's) names: for each convolution NAME
//   NAME.conv.weight [N, C, h, w], NAME.bn.{weight, bias, running_mean, running_var} [N], NAME.bn.num_batches_tracked
//   or not; of Conv2d_1a_3x3, Conv2d_2a_3x3, Conv2d_2b_3x3, Conv2d_3b_1x1, Conv2d_4a_3x3, Mixed_5b .. Mixed_5d,
//   Mixed_6a .. Mixed_6e, Mixed_7a .. Mixed_7c; fc.weight and fc.bias are not used and may be there.
// F32, F16 or BF16; numbers of channels are what the file says. Mean pools in Mixed_5, Mixed_6 and Mixed_7b leave out
// the padding, and Mixed_7c has a max pool, as in that graph. Storage and arithmetic are fp32.
constexpr uint32_t kInceptionSide = 299; // pixels: images are resized to squares of this side
constexpr double kInceptionEps = 1e-3;   // of batch norms

class Inception {
  public:
    // Errors, bad_input: missing, misshapen and unexpected tensors, NaN
    static Result<std::unique_ptr<Inception>> load(Device& device, const Path& path);
    ~Inception();

    uint32_t features() const; // D, 2048 in the usual network
    // images: 3 channels, -1..1, fp32, 75 pixels a side or more -> 1 x 1 pixels of all branches of the last block, each
    // padded to kRowPadding
    [[nodiscard]] FeatureMap forward(Graph& g, FeatureMap images) const;
    // the numbers of one image's row without the padding
    std::vector<double> unpadded(std::span<const float> row) const;

  private:
    struct Impl;
    explicit Inception(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// Features of images of one size, a batch at a time: resized as pytorch-fid does (bilinear, align_corners = False, no
// antialiasing) and scaled to -1..1 on the device
class ImageFeatures {
  public:
    // a smaller batch where the device's budget asks for it. Errors: out_of_memory when one image does not fit
    static Result<std::unique_ptr<ImageFeatures>> create(Device& device, const Inception& network, ImageSize size,
                                                         uint32_t batch);
    ~ImageFeatures();

    uint32_t batch() const;
    // 1 to batch() images of that size -> a row each. Errors: internal for NaN in the result; the device's
    Status append(std::span<const ImageRgb8> images, Features& features);

  private:
    struct Impl;
    explicit ImageFeatures(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace semrover
