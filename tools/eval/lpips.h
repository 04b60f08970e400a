// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "runtime/device/device.h"

#include <memory>

namespace semrover {

// LPIPS, version 0.1 (Zhang, Isola, Efros, Shechtman and Wang 2018, arXiv 1801.03924; github.com/richzhang/
// PerceptualSimilarity): how unlike two pictures look. Both, scaled to -1..1 and then by (x - shift) / scale of each
// channel, go through the convolutions of AlexNet or VGG16. At five places the features of every pixel are divided by
// their length; a layer's share is the mean over pixels of sum over channels of w (a - b)^2.
//
// The file is a state dict in safetensors with torchvision's and lpips' names: features.N.{weight, bias} of every
// convolution (AlexNet: N = 0, 3, 6, 8, 10; VGG16: 0, 2, 5, 7, 10, .., 28) and linK.model.1.weight [1, C, 1, 1], K =
// 0..4. F32, F16 or BF16; numbers of channels are what the file says. Other names without features. in front may be
// there. Storage and arithmetic are fp32.
class Lpips {
  public:
    // Errors, bad_input: missing, misshapen and unexpected tensors, NaN
    static Result<std::unique_ptr<Lpips>> load(Device& device, const Path& path);
    ~Lpips();

    std::string_view backbone() const; // "alex" or "vgg", as lpips calls them
    uint32_t least_side() const;       // pixels that pictures must have each way

    // Of two pictures of one size, least_side() or more each way; 0 where they are equal. A program is made when the
    // size is another than before. Errors: out_of_memory where the pair does not fit the device's budget; internal for
    // NaN; the device's
    Result<double> distance(const ImageRgb8& a, const ImageRgb8& b);

  private:
    struct Impl;
    explicit Lpips(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace semrover
