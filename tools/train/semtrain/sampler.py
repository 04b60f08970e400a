# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The transformer's sampler as the engine runs it (docs/method.md §3): DDPM's steps, and guidance."""
from typing import NamedTuple

import numpy as np
import torch


def linear_alphas(config):
    """[T] running products of 1 - beta"""
    beta = torch.linspace(config["beta_start"], config["beta_end"], config["num_train_timesteps"], dtype=torch.float64)
    return torch.cumprod(1 - beta, 0).float()


def posterior(a, b):
    """of DDPM's step from the share a of the signal's variance to b (Ho et al. 2020, formula 7) -> factors of x0 and of
    x in the mean, and the variance"""
    beta = 1 - a / b
    return b.sqrt() * beta / (1 - a), (a / b).sqrt() * (1 - b) / (1 - a), (1 - b) / (1 - a) * beta


class Steps(NamedTuple):
    """of a sampling run, each [n]; fresh [n, 2] is the deviation of the noise on places and on colours"""
    timesteps: torch.Tensor
    of_x0: torch.Tensor
    of_x: torch.Tensor
    fresh: torch.Tensor

    def to(self, device):
        return Steps(*(part.to(device) for part in self))


def timesteps_of(train, steps, spacing):
    """falling, as the engine spaces them (engine/sampling/schedule.cpp)"""
    left = np.arange(steps, 0, -1) / steps
    if spacing == "quadratic":
        return np.maximum(np.rint(train * left ** 2) - 1, np.arange(steps - 1, -1, -1)).astype(int)
    if spacing == "trailing":
        return np.rint(train * left).astype(int) - 1
    raise SystemExit(f"timestep_spacing: expected quadratic or trailing, found {spacing}")


def steps_of(scheduler, steps, error_scale=1):
    """scheduler: a transformer's scheduler_config.json; error_scale: of its prediction_errors -> Steps"""
    kind, variance = scheduler["_class_name"], scheduler.get("variance_type", "fixed_small")
    if kind != "DDPMScheduler" or scheduler["beta_schedule"] != "linear" or variance not in ("fixed_small", "analytic"):
        raise SystemExit(f"expected a DDPMScheduler with linear betas and variance_type fixed_small or analytic, found "
                         f"{kind}, {scheduler['beta_schedule']}, {variance}")
    t = timesteps_of(scheduler["num_train_timesteps"], steps, scheduler.get("timestep_spacing", "leading"))
    alphas = linear_alphas(scheduler).double()[torch.from_numpy(t)]
    of_x0, of_x, small = posterior(alphas, torch.cat([alphas[1:], torch.ones(1, dtype=torch.float64)]))
    errors = torch.zeros(steps, 2, dtype=torch.float64)
    if variance == "analytic":
        rows = np.array(scheduler["prediction_errors"])
        errors = torch.from_numpy(np.stack([np.interp(t, rows[:, 0], rows[:, i]) for i in (1, 2)], 1))
    fresh = (small[:, None] + of_x0[:, None] ** 2 * error_scale * errors).sqrt()
    fresh[-1] = 0
    return Steps(torch.from_numpy(t), of_x0.float(), of_x.float(), fresh.float())


class Guidance(NamedTuple):
    """of a model's defaults (docs/method.md §3.1)"""
    scale: float
    first: float = 0
    last: float = 10000
    radius: float = None

    @classmethod
    def of(cls, defaults):
        return cls(defaults["guidance_scale"], defaults.get("guidance_from", 0), defaults.get("guidance_until", 10000),
                   defaults.get("guidance_radius"))

    def at(self, timesteps):
        """which of them are guided"""
        return (timesteps >= self.first) & (timesteps <= self.last) & (self.scale != 1)


def guided_x0(model, guidance, x, labels, centers, valid, timesteps, condition):
    """what the sampler takes for x0 [B, N, 6n]; at guided timesteps it is led away from an unconditional pass"""
    x0 = model(x, labels, centers, valid, timesteps, condition).float()
    rows = guidance.at(timesteps).nonzero()[:, 0]
    if len(rows):
        null = torch.full_like(labels[rows], model.config["num_classes"])
        blind = model(x[rows], null, centers[rows], valid[rows], timesteps[rows], torch.zeros_like(condition[rows]),
                      guidance.radius).float()
        x0[rows] = blind + guidance.scale * (x0[rows] - blind)
    return x0.clamp(-1, 1)
