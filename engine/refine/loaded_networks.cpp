// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/loaded_networks.h"

namespace semrover {

Result<const Unet*> LoadedNetworks::unet()
{
    if (!unet_) {
        SR_TRY(const Checkpoint weights, model_.open_unet());
        SR_TRY(unet_, Unet::load(device_, model_.unet, weights, precision_));
    }
    return unet_.get();
}

Result<const Vae*> LoadedNetworks::vae()
{
    if (!vae_) {
        SR_TRY(const Checkpoint weights, model_.open_vae());
        SR_TRY(vae_, Vae::load(device_, model_.vae, weights, precision_));
    }
    return vae_.get();
}

} // namespace semrover
