// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/latent_size.h"
#include "engine/network/unet.h"
#include "engine/network/vae.h"
#include "runtime/base/json.h"

#include <cmath>
#include <gtest/gtest.h>

namespace semrover {

const LatentSize kOddSize{51, 38, 8}; // a latent of 7 x 5 whose last blocks are not full

// the networks of a golden case of renderers, of images or of videos, and a text of tokens that differ
struct GoldenRenderer {
    std::unique_ptr<Unet> unet;
    std::unique_ptr<Vae> vae;
    std::vector<float> text;

    GoldenRenderer(Device& device, const std::string& name, uint32_t tokens, DType precision = DType::f16)
    {
        const Path model = Path(SEMROVER_SOURCE_DIR "/tests/golden") / name / "model";
        unet = std::move(*Unet::load(device, *parse_any_unet_config(*read_json(model / "unet" / "config.json")),
                                     *Checkpoint::open_folder(model / "unet", Checkpoint::Network::unet), precision));
        vae = std::move(*Vae::load(device, *parse_any_vae_config(*read_json(model / "vae" / "config.json")),
                                   *Checkpoint::open_folder(model / "vae", Checkpoint::Network::vae), precision));
        for (size_t i = 0; i < size_t(tokens) * unet->config().cross_attention_dim; ++i)
            text.push_back(std::sin(float(i)));
    }
};

} // namespace semrover
