// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/unet.h"
#include "engine/network/vae.h"
#include "runtime/base/file.h"

namespace semrover {

struct RendererNetworks {
    std::unique_ptr<Unet> unet;
    std::unique_ptr<Vae> vae;
};

// how the configs are read says whether they are of images or of videos
using UnetParser = Result<UnetConfig> (*)(const nlohmann::json&);
using VaeParser = Result<VaeConfig> (*)(const nlohmann::json&);

// MODEL/unet and MODEL/vae
Result<RendererNetworks> load_networks(Device& device, const Path& model, DType precision, UnetParser parse_unet,
                                       VaeParser parse_vae);

} // namespace semrover
