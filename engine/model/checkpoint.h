// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/safetensors.h"

#include <map>
#include <memory>

namespace semrover {

// The weights of one network under diffusers' names, whatever the file calls them: a component's folder (one file or
// shards), or its part of a single-file LDM checkpoint; old names of VAE attention; 1x1 convolutions stored as matrices
// and the other way round. Or no file at all: seeded random numbers, for benchmarks and tests.
class Checkpoint {
  public:
    enum class Network { unet, vae };

    // errors: bad_input
    static Result<Checkpoint> open_folder(const Path& folder, Network network);
    // part of a single-file LDM checkpoint: the network's config is given (ldm_config.h), the other may be null
    static Result<Checkpoint> open_ldm(const Path& file, Network network, const struct UnetConfig* unet,
                                       const struct VaeConfig* vae);
    // every tensor exists: weights of variance 1 / fan-in, norm weights 1, biases small; a function of (seed, name)
    static Checkpoint random(uint64_t seed);

    // the checkpoint holds what the network needs: one error lists all missing, misshapen and unexpected tensors, by
    // their names in the file
    Status require(std::span<const TensorSpec> schema) const;
    // the values of a tensor that require() accepted, as fp32, in the order of `shape`; bad_input if one is no number
    Status read(const TensorSpec& spec, std::vector<float>& values) const;

    // the tensor for another file, under the spec's name and shape: as it is stored (random numbers: F32) or as `dtype`
    TensorStream stream(const TensorSpec& spec, std::optional<DType> dtype = {}) const;

  private:
    const TensorInfo* find(const TensorSpec& spec) const; // null when the file has no such tensor
    const std::string& file_name(const std::string& name) const;

    std::shared_ptr<const SafetensorsSet> set_; // none: random
    std::map<std::string, std::string> names_;  // diffusers name -> name in the file, where they differ
    std::string prefix_;                        // of this network's tensors in the file
    uint64_t seed_ = 0;
};

// Stable Diffusion's own UNet, with 4 input channels, where the deferred renderer's 13 are needed: what is missing and
// the command that adds it
tl::unexpected<Error> refuse_plain_unet(const Path& path);

} // namespace semrover
