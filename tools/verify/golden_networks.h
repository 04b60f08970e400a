// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/unet.h"
#include "engine/network/vae.h"
#include "runtime/base/file.h"

#include <cstddef>
#include <vector>

namespace semrover {

struct GoldenNetworks {
    std::unique_ptr<Unet> unet;
    std::unique_ptr<Vae> vae;
};

// MODEL/unet and MODEL/vae, of images or of videos
Result<GoldenNetworks> load_networks(Device& device, const Path& model, DType precision);

// images of a case are planar [frames, channels, height, width]; the renderer's are [height, width, channels]
struct Planar {
    size_t channels, pixels;

    std::vector<float> interleaved(const std::vector<float>& all, size_t frame) const
    {
        std::vector<float> out(channels * pixels);
        for (size_t i = 0; i < out.size(); ++i)
            out[i] = all[(frame * channels + i % channels) * pixels + i / channels];
        return out;
    }
    void append(const std::vector<float>& interleaved, std::vector<float>& all) const
    {
        for (size_t c = 0; c < channels; ++c)
            for (size_t p = 0; p < pixels; ++p)
                all.push_back(interleaved[p * channels + c]);
    }
};

} // namespace semrover
