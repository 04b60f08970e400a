# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Ways to spoil a picture, each with a strength of LEAST to 1: what generated frames look like, and what not.

Lengths are pixels of the frame, levels are of 0..255. Several may follow one another, in the order of KINDS.
"""
import io

import numpy as np
import torch
from PIL import Image
from torch.nn import functional as F

LEAST = 0.2


def splats(picture, buffer, strength, draw):
    """patches of the splat buffer instead, over that share of the picture"""
    height, width = picture.shape[1:]
    field = _smooth(1, height, width, 80, draw)[0]
    kept = int((1 - strength) * height * width)
    if kept == 0:
        return buffer
    return torch.where(field > field.flatten().kthvalue(kept)[0], buffer, picture)


def warp(picture, _, strength, draw):
    """every pixel from elsewhere: 6 strength pixels root mean square, changing over some 24"""
    height, width = picture.shape[1:]
    moved = _smooth(2, height, width, 24, draw)
    moved *= 6 * strength / moved.square().sum(0).mean().sqrt()
    rows, cols = torch.arange(height)[:, None] + moved[0] + 0.5, torch.arange(width)[None] + moved[1] + 0.5
    places = torch.stack([2 * cols / width - 1, 2 * rows / height - 1], -1)
    return F.grid_sample(picture[None], places[None], padding_mode="border", align_corners=False)[0]


def color(picture, _, strength, draw):
    """60 strength levels more or less, in a random direction of red, green and blue"""
    direction = torch.randn(3, generator=draw)
    return picture + (60 * strength * direction / direction.norm())[:, None, None]


def blur(picture, _, strength, draw):
    """Gaussian, with a deviation of 4 strength^1.5 pixels: 0.36 to 4"""
    return gaussian_blur(picture, 4 * strength ** 1.5)


def pixels(picture, _, strength, draw):
    """means over squares of 1 + 5 strength pixels"""
    height, width = picture.shape[1:]
    small = [max(1, round(n / (1 + 5 * strength))) for n in (height, width)]
    return F.interpolate(F.adaptive_avg_pool2d(picture, small)[None], (height, width), mode="nearest")[0]


def noise(picture, _, strength, draw):
    """Gaussian, with a deviation of 40 strength^1.5 levels: 3.6 to 40"""
    return picture + 40 * strength ** 1.5 * torch.randn(picture.shape, generator=draw)


def jpeg(picture, _, strength, draw):
    """of quality 51 to 3"""
    file = io.BytesIO()
    levels = picture.clamp(0, 255).round().to(torch.uint8).permute(1, 2, 0).contiguous()
    Image.fromarray(levels.numpy()).save(file, "JPEG", quality=round(3 + 60 * (1 - strength)))
    with Image.open(file) as image:
        return torch.from_numpy(np.array(image)).permute(2, 0, 1).float()


KINDS = {f.__name__: f for f in (splats, warp, color, blur, pixels, noise, jpeg)}


def spoil(picture, buffer, strengths, draw):
    """float [3, H, W], 0..255, twice, and a strength for each of KINDS, 0 for none -> float of whole levels"""
    for (name, damage), strength in zip(KINDS.items(), strengths):
        if strength > 0:
            picture = damage(picture, buffer, float(strength), draw)
    return picture.clamp(0, 255).round()


def gaussian_blur(picture, deviation):
    """float [3, H, W]; the edges' pixels go on outside"""
    rows, cols = (_blur_matrix(n, deviation) for n in picture.shape[1:])
    return rows @ (picture @ cols.t())


def _blur_matrix(size, deviation):
    """[size, size] of a Gaussian out to three deviations: a product is sooner done than a convolution of one channel"""
    reach = max(1, int(np.ceil(3 * deviation)))
    steps = torch.arange(-reach, reach + 1)
    weights = torch.exp(-0.5 * (steps / deviation) ** 2)
    places = (torch.arange(size)[:, None] + steps).clamp(0, size - 1)
    return torch.zeros(size, size).scatter_add_(1, places, (weights / weights.sum()).expand(size, -1))


def _smooth(channels, height, width, period, draw):
    """random numbers that change over `period` pixels"""
    coarse = torch.randn(1, channels, height // period + 2, width // period + 2, generator=draw)
    return F.interpolate(coarse, (height, width), mode="bicubic", align_corners=True)[0]
