# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A discriminator of patches (Isola et al. 2017, arXiv 1611.07004) for latents: which of them are true."""
import torch
from torch import nn
from torch.nn import functional as F

from .image_blocks import GroupNorm


class PatchDiscriminator(nn.Module):
    """[B, channels, h, w] -> features of each layer, the last of which is [B, 1, h / 4, w / 4]: 1 where a patch seems
    true, 0 where made. A patch is 26 latents wide."""

    def __init__(self, channels, widths=(64, 128, 256)):
        super().__init__()
        first, second, third = widths
        self.convs = nn.ModuleList([nn.Conv2d(channels, first, 4, 2, 1), nn.Conv2d(first, second, 4, 2, 1),
                                    nn.Conv2d(second, third, 3, 1, 1), nn.Conv2d(third, 1, 3, 1, 1)])
        self.norms = nn.ModuleList([GroupNorm(width // 16, width) for width in widths[1:]])

    def forward(self, x):
        x = F.leaky_relu(self.convs[0](x), 0.2)
        features = [x]
        for conv, norm in zip(self.convs[1:3], self.norms):
            x = F.leaky_relu(norm(conv(x)), 0.2)
            features.append(x)
        return features + [self.convs[3](x)]
