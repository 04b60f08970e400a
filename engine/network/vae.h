// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/checkpoint.h"
#include "engine/model/load_progress.h"
#include "engine/model/vae_config.h"
#include "kernels/network.h"
#include "runtime/device/device.h"

#include <memory>

namespace semrover {

// AutoencoderKL or AutoencoderKLTemporalDecoder (docs/models.md §5). Its functions add to a graph. Where the config
// asks for force_upcast and the precision is fp16, the residual stream is stored divided by a power of two, which group
// norms undo exactly; the encoder of a video's VAE is then in fp32.
class Vae {
  public:
    ~Vae();
    static Result<std::unique_ptr<Vae>> load(Device& device, const VaeConfig& config, const Checkpoint& weights,
                                             DType precision, const LoadProgress& progress = {});
    // lays out the weights without loading them, to plan memory
    static std::unique_ptr<Vae> plan(const VaeConfig& config, DType precision);

    const VaeConfig& config() const;
    uint64_t parameters() const;
    uint64_t device_bytes(const DeviceLimits& limits) const; // of the weights

    // image: in_channels, -1..1, fp32 -> 2 * latent_channels, fp32: mean, log-variance
    [[nodiscard]] FeatureMap encode(Graph& g, FeatureMap image) const;
    // latent: latent_channels, fp32, not scaled -> out_channels, fp32, -1..1 or beyond. Of a config of videos the
    // images are the frames of one.
    [[nodiscard]] FeatureMap decode(Graph& g, FeatureMap latent) const;

  private:
    struct Impl;
    explicit Vae(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace semrover
