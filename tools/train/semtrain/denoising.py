# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The renderer's noise schedule, its DDIM sampler and the rollout over frames (docs/method.md §6.1)."""
import torch
from torch.nn import functional as F

SCHEDULER = {"_class_name": "DDIMScheduler", "num_train_timesteps": 1000, "beta_schedule": "scaled_linear",
             "beta_start": 0.00085, "beta_end": 0.012, "prediction_type": "epsilon", "clip_sample": False,
             "set_alpha_to_one": False, "steps_offset": 1, "timestep_spacing": "leading"}


def alphas_cumprod():
    """[1000] f32: share of the signal's variance at each timestep"""
    betas = torch.linspace(SCHEDULER["beta_start"] ** 0.5, SCHEDULER["beta_end"] ** 0.5, 1000) ** 2
    return torch.cumprod(1 - betas, 0)


def block_shares(visible, block=8):
    """[B, 1, H, W] -> [B, 1, H / 8, W / 8]: share of each block's pixels that are visible"""
    return F.avg_pool2d(visible, block)


def mean_of_used(squares, used):
    """[B, ...] -> [B]: the mean over all, or for `used` [B, ..., 1, h, w] over what is 1 there; of nothing it is 0"""
    axes = tuple(range(1, squares.dim()))
    if used is None:
        return squares.mean(axes)
    return (squares * used).sum(axes) / used.expand_as(squares).sum(axes).clamp(min=1)


def input_of(noisy, previous, buffer, visible):
    """latents [B, 4, h, w] each, visible [B, 1, h, w] -> the UNet's 13 channels, in the engine's order"""
    return torch.cat([noisy, previous, buffer, visible], 1)


def scheduler_of(config):
    """the fields that a recipe's config may change: what is predicted, and which timesteps a sampler takes"""
    return {**SCHEDULER, **{name: config[name] for name in ("prediction_type", "timestep_spacing")}}


def ddim_timesteps(steps, spacing="leading"):
    """falling, as diffusers spaces them"""
    if spacing == "trailing":
        return [round(1000 - i * 1000 / steps) - 1 for i in range(steps)]
    ratio = 1000 // steps
    return [i * ratio + SCHEDULER["steps_offset"] for i in range(steps)][::-1]


def velocity(clean, noise, a):
    """what a network of `v_prediction` learns (Salimans and Ho 2022); a: share of the signal's variance"""
    return a.sqrt() * noise - (1 - a).sqrt() * clean


def noise_of(made, noisy, a, prediction):
    """what a network said of `noisy` -> the noise in it"""
    return a.sqrt() * made + (1 - a).sqrt() * noisy if prediction == "v_prediction" else made


def ddim_step(predicted, t, steps, x, alphas):
    """eta 0: the state at t, and the noise predicted in it -> the state at the next timestep"""
    before = t - 1000 // steps
    a, b = alphas[t], alphas[max(before, 0)]
    clean = (x - (1 - a).sqrt() * predicted) / a.sqrt()
    return b.sqrt() * clean + (1 - b).sqrt() * predicted


def denoise(unet, text, noise, previous, buffer, visible, steps, guidance=1.0, scheduler=SCHEDULER):
    """one frame (or a batch of unrelated ones); shapes as in `input_of` -> latent [B, 4, h, w].
    previous: with its noise already on it, zeros for a first frame"""
    alphas, x = alphas_cumprod().to(noise.device), noise
    for t in ddim_timesteps(steps, scheduler["timestep_spacing"]):
        time = torch.tensor(t, device=noise.device)
        made = unet(input_of(x, previous, buffer, visible), time, text)
        if guidance != 1:
            free = unet(input_of(x, torch.zeros_like(previous), buffer, torch.zeros_like(visible)), time, text)
            made = free + guidance * (made - free)
        x = ddim_step(noise_of(made, x, alphas[t], scheduler["prediction_type"]), t, steps, x, alphas)
    return x


@torch.no_grad()
def rollout(unet, vae, text, buffers, visible, noise, noise_on_previous, steps, guidance, previous_noise=0.3):
    """frames one after the other: buffers [F, 3, H, W], -1..1; visible [F, 1, H, W]; noises [F, 4, h, w]
    -> latents [F, 4, h, w], pictures [F, 3, H, W]"""
    latents, pictures, last = [], [], None
    for i in range(len(buffers)):
        buffer = vae.encode_scaled(buffers[i:i + 1])
        seen = block_shares(visible[i:i + 1], vae.downscale)
        previous = torch.zeros_like(buffer) if last is None else last + previous_noise * noise_on_previous[i:i + 1]
        last = denoise(unet, text, noise[i:i + 1], previous, buffer, seen, steps, guidance)
        latents.append(last)
        pictures.append(vae.decode_scaled(last))
    return torch.cat(latents), torch.cat(pictures)
