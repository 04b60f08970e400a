// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/denoiser.h"
#include "engine/network/vae.h"

// The VAE's two halves of a deferred renderer, each for one picture size and in memory of its own. Latents are scaled
// as the denoiser sees them: (z - shift_factor) * scaling_factor, z the mode of the posterior, that is its mean.
namespace semrover {

// a splat buffer as the denoiser sees it; pixels are those of the latent
struct EncodedBuffer {
    std::vector<float> latent;  // [pixels, C]
    std::vector<float> visible; // [pixels] 0..1
};

class FrameEncoder {
  public:
    // unscaled: the latent is z itself, as the video renderer sees it. arena: null: its own
    static Result<std::unique_ptr<FrameEncoder>> create(Device& device, const Vae& vae, const LatentSize& size,
                                                        bool unscaled, SharedArena arena = {});
    static Result<PartBytes> planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size);

    // image: [image_height, image_width, in_channels], -1..1 -> [height, width, latent_channels].
    // Errors: internal when there is NaN or infinity in the result; device errors
    Result<std::vector<float>> encode(std::span<const float> image);

    // the same of pixels on the device, [image pixels] u32 as splat_pixels() makes them: the caller fills seen()
    const DeviceTensor& seen() const;
    Result<EncodedBuffer> encode_seen();

  private:
    struct Ends; // memory of what goes in and what comes out
    FrameEncoder(Device& device, std::unique_ptr<Ends> ends);
    Status check() const;

    Device& device_;
    std::unique_ptr<Ends> ends_;
    SharedArena arena_;                               // of the executables
    std::unique_ptr<Executable> intake_, executable_; // intake: of what was seen

  public:
    ~FrameEncoder();
};

// Decodes the latents of some frames together, which a decoder of videos makes hold together in time. One of images
// decodes each alone.
class FrameDecoder {
  public:
    static Result<std::unique_ptr<FrameDecoder>> create(Device& device, const Vae& vae, const LatentSize& size,
                                                        uint32_t frames, SharedArena arena = {});
    static Result<PartBytes> planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size,
                                           uint32_t frames);

    // latents: [frames, height, width, latent_channels] -> [frames, image_height, image_width, out_channels], -1..1 or
    // beyond. Errors: internal when there is NaN or infinity in the result; device errors
    Result<std::vector<float>> decode(std::span<const float> latents);

    // The same to bytes on the device, where there are three channels. What bytes() shows of a frame - red, green,
    // blue, four bytes a word - is good until the next call.
    Status decode_bytes(std::span<const float> latents);
    DeviceTensor bytes(uint32_t frame) const;

  private:
    struct Ends;
    FrameDecoder(Device& device, std::unique_ptr<Ends> ends);

    Device& device_;
    std::unique_ptr<Ends> ends_;
    SharedArena arena_; // of the executable
    std::unique_ptr<Executable> executable_;

  public:
    ~FrameDecoder();
};

// [image_height, image_width], 0 or not -> [height, width]: share of each block that is not 0
std::vector<float> block_shares(const LatentSize& size, std::span<const uint8_t> visible);

} // namespace semrover
