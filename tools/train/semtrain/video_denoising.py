# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The video renderer's noise levels, its Euler sampler, and windows over a trajectory (docs/method.md §6.3, §6.4)."""
import torch

from .denoising import block_shares

SCHEDULER = {"_class_name": "EulerDiscreteScheduler", "num_train_timesteps": 1000, "beta_schedule": "scaled_linear",
             "beta_start": 0.00085, "beta_end": 0.012, "prediction_type": "v_prediction", "use_karras_sigmas": True,
             "sigma_min": 0.002, "sigma_max": 700.0, "timestep_type": "continuous", "timestep_spacing": "leading",
             "steps_offset": 1}


def karras_sigmas(steps, low=SCHEDULER["sigma_min"], high=SCHEDULER["sigma_max"]):
    """[steps + 1], falling to 0 (Karras et al. 2022, formula 5)"""
    ramp = torch.linspace(0, 1, steps, dtype=torch.float64)
    sigmas = (high ** (1 / 7) + ramp * (low ** (1 / 7) - high ** (1 / 7))) ** 7
    return torch.cat([sigmas, torch.zeros(1, dtype=torch.float64)]).float()


def timestep_of(sigma):
    """the network's input for a level of noise"""
    return 0.25 * torch.log(sigma)


def velocity_target(clean, noise, sigma):
    """what the network learns for the state clean + sigma noise"""
    scale = 1 / (sigma ** 2 + 1).sqrt()
    return scale * (noise - sigma * clean)


def clean_of(made, x, sigma):
    """what a network said of the state x -> the clean latents in it"""
    return (x / (sigma ** 2 + 1).sqrt() - sigma * made) / (sigma ** 2 + 1).sqrt()


def video_input(x, buffer, visible, sigma):
    """[F, 4, h, w] twice and [F, 1, h, w] -> the UNet's 9 channels, in the engine's order"""
    return torch.cat([x / (sigma ** 2 + 1).sqrt(), buffer, visible], 1)


def guidance_of(frames, first, last):
    """[F, 1, 1, 1], linear"""
    return torch.linspace(first, last, frames).view(-1, 1, 1, 1) if frames > 1 else torch.full((1, 1, 1, 1), first)


def known_frame_weights(frames, known, sigma, correlation):
    """[frames - known, known]: how much of what known frames are off by the others are off by, if frames are Gaussian
    and their correlation falls from one to the next"""
    at = torch.arange(frames)
    before = (correlation ** (at[:, None] - at).abs()).double()
    given = torch.linalg.solve(before + float(sigma) ** 2 * torch.eye(frames, dtype=torch.float64), before)
    return torch.linalg.solve(given[:known, :known], given[:known, known:]).T.float()


def denoise_window(clean, noise, steps, known=None, correlation=0.9):
    """Euler's steps over one window. clean(x, sigma) -> clean latents in the state; noise [F, ...]; known [K, ...]: of
    the first frames, which are held: at every level they are what they are plus the noise that they began with. What
    `clean` says wrongly of them corrects what it says of the others; a correlation of 0 leaves that out"""
    sigmas = karras_sigmas(steps).to(noise.device)
    held = 0 if known is None else len(known)

    def corrected(x, sigma):
        out = clean(x, sigma)
        if held in (0, len(noise)) or correlation == 0:
            return out
        weights = known_frame_weights(len(noise), held, sigma, correlation).to(out.device)
        return torch.cat([out[:held], out[held:] + torch.tensordot(weights, known - out[:held], 1)])

    def hold(x, sigma):
        return x if held == 0 else torch.cat([known + sigma * noise[:held], x[held:]])
    x = hold((sigmas[0] ** 2 + 1).sqrt() * noise, sigmas[0])
    for now, after in zip(sigmas[:-1], sigmas[1:]):
        x = hold(x + (x - corrected(x, now)) / now * (after - now), after)
    return x


def window_denoiser(unet, text, added, buffer, visible, first, last):
    """-> clean(x, sigma) for denoise_window; buffer [F, 4, h, w], not scaled; visible [F, 1, h, w]"""
    guidance = guidance_of(len(buffer), first, last).to(buffer.device)

    def clean(x, sigma):
        def made(seen):
            return unet(video_input(x, buffer, seen, sigma)[None], timestep_of(sigma), text, added)[0]
        out = made(visible)
        if (first, last) != (1, 1):
            free = made(torch.zeros_like(visible))
            out = free + guidance * (out - free)
        return clean_of(out, x, sigma)
    return clean


def windows(frames, length, overlap):
    """-> [(first, known, end)]: as the engine cuts a trajectory"""
    out, after = [], 0
    while after < frames:
        first = max(0, min(after - min(overlap, after), frames - length))
        end = min(first + length, frames)
        out.append((first, after - first, end))
        after = end
    return out


@torch.no_grad()
def render_window(unet, vae, text, added, buffers, visible, noise, steps, first, last):
    """buffers [F, 3, H, W], -1..1; visible [F, 1, H, W]; noise [F, 4, h, w] -> latents [F, 4, h, w], pictures"""
    buffer, seen = vae.moments(buffers)[0], block_shares(visible, vae.downscale)
    latents = denoise_window(window_denoiser(unet, text, added, buffer, seen, first, last), noise, steps)
    return latents, vae.decode_scaled(latents)
