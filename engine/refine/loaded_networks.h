// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/renderer_model.h"
#include "engine/network/unet.h"
#include "engine/network/vae.h"

namespace semrover {

// A renderer's networks, read when they are first wanted and dropped when there is no room for them.
class LoadedNetworks {
  public:
    LoadedNetworks(Device& device, const RendererModel& model, DType precision)
        : device_(device), model_(model), precision_(precision)
    {
    }

    // errors: bad_input for weights that do not fit the model; device errors
    Result<const Unet*> unet();
    Result<const Vae*> vae();
    void drop_unet() { unet_.reset(); }
    void drop_vae() { vae_.reset(); }

  private:
    Device& device_;
    const RendererModel& model_;
    DType precision_;
    std::unique_ptr<Unet> unet_;
    std::unique_ptr<Vae> vae_;
};

} // namespace semrover
