// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/loaded_networks.h"

namespace semrover {

Result<std::shared_ptr<const Unet>> LoadedNetworks::unet(const LoadProgress& progress)
{
    if (auto there = unet_.lock())
        return there;
    SR_TRY(const Checkpoint weights, model_.open_unet());
    SR_TRY(std::shared_ptr<const Unet> loaded, Unet::load(device_, model_.unet, weights, precision_, progress));
    unet_ = loaded;
    return loaded;
}

Result<std::shared_ptr<const Vae>> LoadedNetworks::vae(const LoadProgress& progress)
{
    if (auto there = vae_.lock())
        return there;
    SR_TRY(const Checkpoint weights, model_.open_vae());
    SR_TRY(std::shared_ptr<const Vae> loaded, Vae::load(device_, model_.vae, weights, precision_, progress));
    vae_ = loaded;
    return loaded;
}

Status LoadedNetworks::keep(const LoadProgress& progress)
{
    SR_TRY(kept_vae_, vae(progress));
    SR_TRY(kept_unet_, unet(progress));
    return {};
}

LoadedNetworks::Loaded LoadedNetworks::loaded() const
{
    Loaded bytes;
    const auto count = [&](const auto& network, const auto& kept, uint64_t& used) {
        if (const auto there = network.lock())
            (there.use_count() > (kept ? 2 : 1) ? used : bytes.kept) += there->device_bytes(device_.limits());
    };
    count(unet_, kept_unet_, bytes.unet);
    count(vae_, kept_vae_, bytes.vae);
    return bytes;
}

Result<const Unet*> NetworksInUse::unet()
{
    if (!unet_) {
        SR_TRY(unet_, networks_->unet());
    }
    return unet_.get();
}

Result<const Vae*> NetworksInUse::vae()
{
    if (!vae_) {
        SR_TRY(vae_, networks_->vae());
    }
    return vae_.get();
}

void NetworksInUse::drop_unet()
{
    unet_.reset();
    networks_->kept_unet_.reset();
}

void NetworksInUse::drop_vae()
{
    vae_.reset();
    networks_->kept_vae_.reset();
}

} // namespace semrover
