# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What the UNet and the VAE are both made of, with the tensor names of diffusers (docs/models.md §4, §5)."""
from torch import nn
from torch.nn import functional as F


class GroupNorm(nn.GroupNorm):
    """in fp32 at any precision: that of PyTorch 1.13 on a CPU is wrong for bf16 with channels last"""

    def forward(self, x):
        return super().forward(x.float()).to(x.dtype)


class LayerNorm(nn.LayerNorm):
    """in fp32 at any precision: that of PyTorch 1.13 on a CPU refuses bf16 with weights of fp32"""

    def forward(self, x):
        return super().forward(x.float()).to(x.dtype)


class ResnetBlock(nn.Module):
    """norm1, conv1, (time_emb_proj,) norm2, conv2, conv_shortcut where the channels change"""

    def __init__(self, channels_in, channels_out, groups, eps, time_width=0):
        super().__init__()
        self.norm1 = GroupNorm(groups, channels_in, eps)
        self.conv1 = nn.Conv2d(channels_in, channels_out, 3, padding=1)
        if time_width:
            self.time_emb_proj = nn.Linear(time_width, channels_out)
        self.norm2 = GroupNorm(groups, channels_out, eps)
        self.conv2 = nn.Conv2d(channels_out, channels_out, 3, padding=1)
        self.conv_shortcut = nn.Conv2d(channels_in, channels_out, 1) if channels_in != channels_out else None

    def forward(self, x, time=None):
        """x [B, channels_in, H, W]; time [B, time_width] -> [B, channels_out, H, W]"""
        y = self.conv1(F.silu(self.norm1(x)))
        if time is not None:
            y = y + self.time_emb_proj(F.silu(time))[:, :, None, None]
        y = self.conv2(F.silu(self.norm2(y)))
        return y + (x if self.conv_shortcut is None else self.conv_shortcut(x))


class Downsampler(nn.Module):
    """stride 2, padded by 1 on all sides, or by 1 on the right and below only (the VAE)"""

    def __init__(self, channels, one_sided):
        super().__init__()
        self.one_sided = one_sided
        self.conv = nn.Conv2d(channels, channels, 3, stride=2, padding=0 if one_sided else 1)

    def forward(self, x):
        """[B, C, H, W] -> [B, C, ceil(H / 2), ceil(W / 2)] (one-sided: floor)"""
        return self.conv(F.pad(x, (0, 1, 0, 1)) if self.one_sided else x)


class Upsampler(nn.Module):
    """nearest, then a convolution"""

    def __init__(self, channels):
        super().__init__()
        self.conv = nn.Conv2d(channels, channels, 3, padding=1)

    def forward(self, x, size=None):
        """[B, C, H, W] -> [B, C, *size], size twice that of x if not given"""
        if size is None:
            size = (2 * x.shape[2], 2 * x.shape[3])
        return self.conv(F.interpolate(x, size=tuple(size), mode="nearest"))


def per_level(value, levels):
    """a number that holds for all levels, or one of each -> list"""
    if isinstance(value, (list, tuple)):
        if len(value) != levels:
            raise ValueError(f"{value}: expected {levels} numbers, one of each level")
        return list(value)
    return [value] * levels
