// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/weight_loader.h"
#include "runtime/base/safetensors.h"

#include <map>
#include <memory>

namespace semrover {

// Gives access to the weights of one network by diffusers' names. The weights are in a component's folder (one file or
// shards) or in a single-file LDM checkpoint, whose names it maps. It also maps old names of VAE attention, and takes
// 1x1 convolutions stored as matrices and the reverse. random() needs no file: seeded numbers, for benchmarks and
// tests.
class Checkpoint {
  public:
    enum class Network { unet, vae };

    // errors: bad_input
    static Result<Checkpoint> open_folder(const Path& folder, Network network);
    // one network of a single-file LDM checkpoint. Its config (ldm_config.h) must be given; the other may be null.
    static Result<Checkpoint> open_ldm(const Path& file, Network network, const struct UnetConfig* unet,
                                       const struct VaeConfig* vae);
    // has every tensor: weights of variance 1 / fan-in, norm weights 1, small biases, as a function of (seed, name)
    static Checkpoint random(uint64_t seed);

    // Checks that the checkpoint has what the network needs. bad_input: one line lists all missing, misshapen and
    // unexpected tensors by their names in the file.
    Status require(std::span<const TensorSpec> schema) const;
    // the values of a tensor that require() accepted, in the order of `shape`: as the file has them, or random ones in
    // `scratch`
    Result<TensorValues> values(const TensorSpec& spec, std::vector<float>& scratch) const;

    // the tensor, to be written under the spec's name and shape: in `dtype`, else as it is stored (random numbers: F32)
    TensorStream stream(const TensorSpec& spec, std::optional<DType> dtype = {}) const;

  private:
    const TensorInfo* find(const TensorSpec& spec) const; // null when the file has no such tensor
    const std::string& file_name(const std::string& name) const;

    std::shared_ptr<const SafetensorsSet> set_; // none: random
    std::map<std::string, std::string> names_;  // diffusers name -> name in the file, where they differ
    std::string prefix_;                        // of this network's tensors in the file
    uint64_t seed_ = 0;
};

// Fills a tensor of an untrained network as a function of (seed, name, shape), the same on every machine. Weights are
// uniform with variance 1 / fan-in, so that activations neither grow nor fade with depth; norms are 1 +- 0.1, biases
// +- 0.05.
void random_tensor(uint64_t seed, const TensorSpec& spec, std::vector<float>& values);

// bad_input for Stable Diffusion's own UNet, which has 4 input channels and not the deferred renderer's 13. The message
// says which command adds the others.
tl::unexpected<Error> refuse_plain_unet(const Path& path);

} // namespace semrover
