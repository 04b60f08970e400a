// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/verify/golden_networks.h"

#include "runtime/base/json.h"

namespace semrover {

Result<GoldenNetworks> load_networks(Device& device, const Path& model, DType precision)
{
    GoldenNetworks n;
    SR_TRY(const nlohmann::json unet_json, read_json(model / "unet" / "config.json"));
    SR_TRY(const UnetConfig unet, parse_any_unet_config(unet_json));
    SR_TRY(const Checkpoint unet_weights, Checkpoint::open_folder(model / "unet", Checkpoint::Network::unet));
    SR_TRY(n.unet, Unet::load(device, unet, unet_weights, precision));
    SR_TRY(const nlohmann::json vae_json, read_json(model / "vae" / "config.json"));
    SR_TRY(const VaeConfig vae, parse_any_vae_config(vae_json));
    SR_TRY(const Checkpoint vae_weights, Checkpoint::open_folder(model / "vae", Checkpoint::Network::vae));
    SR_TRY(n.vae, Vae::load(device, vae, vae_weights, precision));
    return n;
}

} // namespace semrover
