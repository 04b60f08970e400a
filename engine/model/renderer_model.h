// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/checkpoint.h"
#include "engine/model/unet_config.h"
#include "engine/model/vae_config.h"
#include "engine/sampling/scheduler_config.h"

#include <optional>

namespace semrover {

// How a frame's noise follows from that of the frame before.
enum class FrameNoise {
    fresh,  // it does not
    warped, // it stays on the surfaces that both frames show
};

constexpr uint32_t kMostWindowFrames = 64; // as many as kernels attend to (kMostFrames)

// what a renderer of videos has beside: "first_guidance_scale", "window_frames", "window_overlap", "frame_correlation",
// "decode_frames", "added_time_ids"
struct VideoDefaults {
    float first_guidance_scale = 1;
    uint32_t window_frames = 12;                        // the UNet's num_frames, where it is not said
    uint32_t window_overlap = 4;                        // a third of them, and at most 4
    float frame_correlation = 0.9f;                     // of neighbouring frames' latents (docs/method.md §6.4)
    uint32_t decode_frames = 2;                         // that the VAE decodes together
    std::vector<float> added_numbers = {6, 127, 0.02f}; // SVD's: frames a second less 1, motion, noise of the image
};

constexpr float kMostFrameHistory = 0.95f; // with more, nothing new would come in

// model_index.json's "defaults": {"renderer": {"num_inference_steps": 20, "guidance_scale": 1.5, "previous_noise": 0.3,
// "frame_noise": "fresh", "frame_history": 0, "visible_threshold": 0.5, "splat_radius": 0.04}}: what a command uses
// where no option overrides it. The other fields of "defaults" are the transformer's.
struct RendererDefaults {
    int num_inference_steps = 20;
    float guidance_scale = 1.5f; // of a video: of a window's last frame
    float previous_noise = 0.3f; // scale of the noise on the previous frame's latent
    float frame_history = 0;     // share of the frame before in a finished one, 0 to kMostFrameHistory
    VideoDefaults video;         // of a renderer of videos, which has neither of the two
    FrameNoise frame_noise = FrameNoise::fresh;
    float visible_threshold = 0.5f; // alpha from which splats cover a pixel
    // standard deviation of the splats in its buffers, metres; none ("auto"): from the spacing of the points. It must
    // be what the renderer was trained on
    std::optional<float> splat_radius = 0.04f;
};

// A deferred renderer's configs, without the weights: Unet::load and Vae::load read those. On disk: a folder in the
// diffusers layout (renderer/ or unet/, vae/, scheduler/, conditioning/), or a single-file LDM checkpoint.
struct RendererModel {
    Path folder; // or the LDM file
    bool ldm = false;
    Path unet_folder, vae_folder; // with ldm: the file
    UnetConfig unet;
    VaeConfig vae;
    SchedulerConfig scheduler;         // none on disk: Stable Diffusion's, with DDIM
    std::vector<float> conditioning;   // [conditioning_tokens, unet.cross_attention_dim]: the constant text
    uint32_t conditioning_tokens = 77; // 1 where a video's is missing
    RendererDefaults defaults;
    std::vector<std::string> warnings;

    // Opens a model that can render: its UNet takes noisy, previous and buffer latents and visibility, or of videos
    // noisy and buffer latents and visibility, and its weights fit its configs. Errors: bad_input, with what is missing
    // and where it should be
    static Result<RendererModel> open(const Path& path, std::optional<Sampler> sampler = {});
    // Reads the configs of any model of the shape of Stable Diffusion 1.5 or Stable Video Diffusion; does not check the
    // UNet's input or the weights.
    static Result<RendererModel> read(const Path& path, std::optional<Sampler> sampler = {});

    bool video() const { return unet.video; } // its frames are made together, windows at a time

    Result<Checkpoint> open_unet() const;
    Result<Checkpoint> open_vae() const;
    Result<uint64_t> hash() const; // of the files that the renderer reads
};

// the constant text [1, tokens, cross_attention_dim]: a tensor of conditioning/conditioning.safetensors, or of an LDM
// file that semrover's own tools wrote (others have none)
constexpr std::string_view kConditioning = "encoder_hidden_states";
constexpr std::string_view kLdmConditioning = "conditioning.encoder_hidden_states";

// noisy latent, previous latent (but of videos), buffer latent, visibility
inline uint32_t renderer_channels(const VaeConfig& vae, bool video = false)
{
    return (video ? 2 : 3) * vae.latent_channels + 1;
}

// Stable Diffusion's noise schedule (docs/method.md §6.1), and its scheduler_config.json
SchedulerConfig stable_diffusion_scheduler(std::optional<Sampler> sampler = {});
nlohmann::json stable_diffusion_scheduler_json();
// Stable Video Diffusion's (docs/method.md §6.3)
nlohmann::json video_scheduler_json();

} // namespace semrover
