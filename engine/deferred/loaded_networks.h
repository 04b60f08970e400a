// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/renderer_model.h"
#include "engine/network/unet.h"
#include "engine/network/vae.h"

namespace semrover {

// A renderer's networks on a device, shared by all that render with them: loaded when somebody wants them, and freed
// when the last one drops them. One thread at a time.
class LoadedNetworks {
  public:
    LoadedNetworks(Device& device, RendererModel model, DType precision)
        : device_(device), model_(std::move(model)), precision_(precision)
    {
    }

    const RendererModel& model() const { return model_; }
    DType precision() const { return precision_; }

    // errors: bad_input for weights that do not fit the model; device errors
    Result<std::shared_ptr<const Unet>> unet(const LoadProgress& progress = {});
    Result<std::shared_ptr<const Vae>> vae(const LoadProgress& progress = {});

    // Both stay on the device from now on, though nobody uses them, until somebody who has no room for both drops one.
    // Errors: as above
    Status keep(const LoadProgress& progress);

    // device bytes of the weights that are loaded: those that somebody uses, and those that are only kept
    struct Loaded {
        uint64_t unet = 0, vae = 0, kept = 0;
    };
    Loaded loaded() const;

  private:
    friend class NetworksInUse;
    Device& device_;
    RendererModel model_;
    DType precision_;
    std::weak_ptr<const Unet> unet_;
    std::weak_ptr<const Vae> vae_;
    std::shared_ptr<const Unet> kept_unet_;
    std::shared_ptr<const Vae> kept_vae_;
};

// what one of those who render has of them
class NetworksInUse {
  public:
    explicit NetworksInUse(std::shared_ptr<LoadedNetworks> networks) : networks_(std::move(networks)) {}

    const RendererModel& model() const { return networks_->model(); }
    // errors: as LoadedNetworks has them
    Result<const Unet*> unet();
    Result<const Vae*> vae();
    void drop_unet(); // it is freed, unless others use it
    void drop_vae();

  private:
    std::shared_ptr<LoadedNetworks> networks_;
    std::shared_ptr<const Unet> unet_;
    std::shared_ptr<const Vae> vae_;
};

} // namespace semrover
