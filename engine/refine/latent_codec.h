// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/vae.h"
#include "engine/refine/latent_size.h"
#include "runtime/device/program.h"

#include <memory>
#include <span>
#include <vector>

namespace semrover {

// [image_height, image_width], 0 or not -> [height, width]: share of each block that is not 0
std::vector<float> block_shares(const LatentSize& size, std::span<const uint8_t> visible);

enum class CodecDirection { encode, decode };

// A VAE for one picture size and one direction, in memory of its own. Latents are scaled as the denoiser sees them:
// (z - shift_factor) * scaling_factor, z the mode of the posterior, that is its mean.
class LatentCodec {
  public:
    static Result<std::unique_ptr<LatentCodec>> create(Device& device, const Vae& vae, const LatentSize& size,
                                                       CodecDirection direction);
    // device memory beside the VAE's weights
    static Result<uint64_t> planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size,
                                          CodecDirection direction);

    // image: [image_height, image_width, in_channels], -1..1 -> [height, width, latent_channels].
    // Errors: internal when there is NaN or infinity in the result; device errors
    Result<std::vector<float>> encode(std::span<const float> image);
    // latent: [height, width, latent_channels] -> [image_height, image_width, out_channels], -1..1 or beyond. Likewise
    Result<std::vector<float>> decode(std::span<const float> latent);

  private:
    struct Ends; // memory of what goes in and what comes out
    LatentCodec(Device& device, const Vae& vae, const LatentSize& size);
    Result<std::vector<float>> run(std::span<const float> padded);

    Device& device_;
    const Vae& vae_;
    LatentSize size_;
    std::unique_ptr<Ends> ends_;
    std::unique_ptr<Program> program_;

  public:
    ~LatentCodec();
};

// pictures as the VAE wants them and back
std::vector<float> floats_of_pixels(std::span<const uint8_t> pixels); // 0..255 -> -1..1
std::vector<uint8_t> pixels_of_floats(std::span<const float> values); // rounded, cut to 0..255

// internal, with the index and the value, when one is NaN or infinite
Status check_finite(std::span<const float> values, std::string_view what);

} // namespace semrover
