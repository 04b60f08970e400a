// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/unet.h"
#include "engine/network/vae.h"
#include "runtime/base/file.h"

namespace semrover {

struct GoldenNetworks {
    std::unique_ptr<Unet> unet;
    std::unique_ptr<Vae> vae;
};

// MODEL/unet and MODEL/vae, of images or of videos
Result<GoldenNetworks> load_networks(Device& device, const Path& model, DType precision);

} // namespace semrover
