// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/refine/latent_codec.h"

namespace semrover {

// Decodes the latents of a video's frames together, which a decoder of videos makes hold together in time. One of
// images decodes each alone.
class VideoDecoder {
  public:
    static Result<std::unique_ptr<VideoDecoder>> create(Device& device, const Vae& vae, const LatentSize& size,
                                                        uint32_t frames);
    // device memory beside the VAE's weights
    static Result<uint64_t> planned_bytes(const DeviceLimits& limits, const Vae& vae, const LatentSize& size,
                                          uint32_t frames);

    // latents: [frames, height, width, latent_channels], scaled as the denoiser makes them -> [frames, image_height,
    // image_width, out_channels], -1..1 or beyond. Errors: internal when there is NaN or infinity in the result; device
    // errors
    Result<std::vector<float>> decode(std::span<const float> latents);

    // The same to bytes on the device, where there are three channels. What bytes() shows of a frame - red, green,
    // blue, four bytes a word - is good until the next call.
    Status decode_bytes(std::span<const float> latents);
    Slot bytes(uint32_t frame) const;

    uint32_t frames() const;

  private:
    struct Ends; // memory of what goes in and what comes out
    VideoDecoder(Device& device, std::unique_ptr<Ends> ends);

    Device& device_;
    std::unique_ptr<Ends> ends_;
    std::unique_ptr<Program> program_;

  public:
    ~VideoDecoder();
};

} // namespace semrover
