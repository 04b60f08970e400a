// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/network/vae.h"
#include "engine/refine/latent_size.h"
#include "runtime/device/program.h"
#include "runtime/device/state.h"

#include <memory>
#include <span>
#include <vector>

namespace semrover {

// [image_height, image_width], 0 or not -> [height, width]: share of each block that is not 0
std::vector<float> block_shares(const LatentSize& size, std::span<const uint8_t> visible);

enum class CodecDirection {
    encode,
    decode,
    encode_unscaled, // as encode, but the latent is z itself: what the video renderer sees of a splat buffer
};

// The ends of a codec on the device; pictures and latents are matrices, a row a pixel, padded as images are. Latents of
// codecs and denoisers of one size have the same shape, so that one may be copied to the other.
struct CodecSlots {
    Slot image;  // [pixels of whole blocks, channels] fp32
    Slot latent; // [latent pixels, latent_channels] fp32
    Slot bad;    // [1] u32: first_non_finite() of what came out
    Slot
        seen; // of an encoder of three channels: [image pixels] u32, as splat_pixels() makes it, what encode_seen takes
    Slot shares; // likewise: [latent pixels] fp32, the visible share of each block
    Slot bytes;  // of a decoder of three channels: the picture, red, green, blue, four bytes a word
};

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

    // the same on the device, submitted and not waited for, between slots that the caller copies to and from
    const CodecSlots& slots() const;
    Status encode_seen();   // slots().seen -> latent, shares
    Status decode_latent(); // slots().latent -> image, bytes
    // waits for it. Errors: internal when there was NaN or infinity in the result
    Status check() const;

  private:
    struct Ends; // memory of what goes in and what comes out
    LatentCodec(Device& device, const Vae& vae, const LatentSize& size);

    Device& device_;
    const Vae& vae_;
    LatentSize size_;
    std::unique_ptr<Ends> ends_;
    std::unique_ptr<Program> intake_, program_; // intake: of what was seen

  public:
    ~LatentCodec();
};

// pictures as the VAE wants them and back
std::vector<float> floats_of_pixels(std::span<const uint8_t> pixels); // 0..255 -> -1..1
std::vector<uint8_t> pixels_of_floats(std::span<const float> values); // rounded, cut to 0..255

// internal: a number that is NaN or infinite, and its index
tl::unexpected<Error> not_finite(float value, size_t element, std::string_view what);
Status check_finite(std::span<const float> values, std::string_view what);

} // namespace semrover
