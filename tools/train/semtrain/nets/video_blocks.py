# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What networks of videos have beside those of images, with the tensor names of diffusers (docs/models.md §4.1).

The frames of videos are images one after the other: [videos * frames, C, H, W].
"""
import torch
from torch import nn
from torch.nn import functional as F

from .image_blocks import GroupNorm, ResnetBlock


class TimeMixer(nn.Module):
    """a learned share of what frames make alone and of what they make together; `switched` as of a VAE's decoder"""

    def __init__(self, switched=False):
        super().__init__()
        self.switched = switched
        self.mix_factor = nn.Parameter(torch.tensor([0.5]))

    def forward(self, alone, together):
        share = torch.sigmoid(self.mix_factor)
        share = share if self.switched else 1 - share
        return alone + share.to(alone.dtype) * (together - alone)


def frames_inside(x, frames):
    """[videos * frames, C, H, W] -> [videos, C, frames, H, W]"""
    return x.unflatten(0, (-1, frames)).transpose(1, 2)


def frames_outside(x):
    return x.transpose(1, 2).flatten(0, 1)


class FrameResnet(nn.Module):
    """convolutions along time, group norms over all frames of a video"""

    def __init__(self, channels, groups, eps, time_width=0):
        super().__init__()
        self.norm1 = GroupNorm(groups, channels, eps)
        self.conv1 = nn.Conv3d(channels, channels, (3, 1, 1), padding=(1, 0, 0))
        if time_width:
            self.time_emb_proj = nn.Linear(time_width, channels)
        self.norm2 = GroupNorm(groups, channels, eps)
        self.conv2 = nn.Conv3d(channels, channels, (3, 1, 1), padding=(1, 0, 0))

    def forward(self, x, time=None):
        """x [videos, C, frames, H, W]; time [videos, time_width]"""
        y = self.conv1(F.silu(self.norm1(x)))
        if time is not None:
            y = y + self.time_emb_proj(F.silu(time))[:, :, None, None, None]
        return x + self.conv2(F.silu(self.norm2(y)))


class VideoResnet(nn.Module):
    """diffusers' SpatioTemporalResBlock"""

    def __init__(self, channels_in, channels_out, groups, eps, time_width=0, frame_eps=None, switched=False):
        super().__init__()
        self.spatial_res_block = ResnetBlock(channels_in, channels_out, groups, eps, time_width)
        self.temporal_res_block = FrameResnet(channels_out, groups, eps if frame_eps is None else frame_eps, time_width)
        self.time_mixer = TimeMixer(switched)

    def forward(self, x, frames, time=None):
        """x [videos * frames, C, H, W]; time [videos, time_width]"""
        alone = self.spatial_res_block(x, None if time is None else time.repeat_interleave(frames, 0))
        together = frames_outside(self.temporal_res_block(frames_inside(alone, frames), time))
        return self.time_mixer(alone, together)
