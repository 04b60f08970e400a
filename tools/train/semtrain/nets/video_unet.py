# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""UNetSpatioTemporalConditionModel of Stable Video Diffusion, with diffusers' tensor names and fields
(docs/models.md §4.1)."""
import math

import torch
from torch import nn
from torch.nn import functional as F

from .image_blocks import Downsampler, GroupNorm, LayerNorm, Upsampler, per_level
from .unet import FeedForward, TransformerBlock
from .video_blocks import TimeMixer, VideoResnet

GROUPS, EPS, BLOCK_EPS = 32, 1e-5, 1e-6  # BLOCK_EPS: of resnets in down blocks with attention, and in up blocks
DEFAULTS = {"in_channels": 8, "out_channels": 4, "block_out_channels": [320, 640, 1280, 1280], "layers_per_block": 2,
            "down_block_types": ["CrossAttnDownBlockSpatioTemporal"] * 3 + ["DownBlockSpatioTemporal"],
            "up_block_types": ["UpBlockSpatioTemporal"] + ["CrossAttnUpBlockSpatioTemporal"] * 3,
            "num_attention_heads": [5, 10, 20, 20], "transformer_layers_per_block": 1, "cross_attention_dim": 1024,
            "addition_time_embed_dim": 256, "projection_class_embeddings_input_dim": 768, "num_frames": 25}


def sinusoids(numbers, width):
    """[N] -> [N, width], cosines first"""
    half = width // 2
    waves = torch.exp(-math.log(10000.0) * torch.arange(half, dtype=torch.float32, device=numbers.device) / half)
    a = numbers[:, None].float() * waves
    return torch.cat([a.cos(), a.sin()], 1)


class Embedding(nn.Module):
    def __init__(self, width_in, width, width_out):
        super().__init__()
        self.linear_1 = nn.Linear(width_in, width)
        self.linear_2 = nn.Linear(width, width_out)

    def forward(self, x):
        return self.linear_2(F.silu(self.linear_1(x)))


class FrameTransformerBlock(TransformerBlock):
    """over the frames of each pixel; a GEGLU comes before the block"""

    def __init__(self, channels, context, heads):
        super().__init__(channels, context, heads)
        self.norm_in = LayerNorm(channels)
        self.ff_in = FeedForward(channels)

    def forward(self, x, context, frames):
        """x [videos * frames, N, C], context [videos, S, D] -> the same"""
        pixels = x.shape[1]
        y = x.unflatten(0, (-1, frames)).transpose(1, 2).flatten(0, 1)
        y = y + self.ff_in(self.norm_in(y))
        y = super().forward(y, context.repeat_interleave(pixels, 0))
        return y.unflatten(0, (-1, pixels)).transpose(1, 2).flatten(0, 1)


class VideoTransformer(nn.Module):
    """diffusers' TransformerSpatioTemporalModel"""

    def __init__(self, channels, context, heads, layers):
        super().__init__()
        self.norm = GroupNorm(GROUPS, channels, 1e-6)
        self.proj_in = nn.Linear(channels, channels)
        self.transformer_blocks = nn.ModuleList(TransformerBlock(channels, context, heads) for _ in range(layers))
        self.temporal_transformer_blocks = nn.ModuleList(FrameTransformerBlock(channels, context, heads)
                                                         for _ in range(layers))
        self.time_pos_embed = Embedding(channels, 4 * channels, channels)
        self.time_mixer = TimeMixer()
        self.proj_out = nn.Linear(channels, channels)

    def forward(self, x, frames, context):
        """x [videos * frames, C, H, W], context [videos, S, D] -> the same"""
        size, videos = x.shape[2:], x.shape[0] // frames
        numbers = torch.arange(frames, device=x.device).repeat(videos)
        place = self.time_pos_embed(sinusoids(numbers, x.shape[1]).to(x.dtype))[:, None]
        y = self.proj_in(self.norm(x).flatten(2).transpose(1, 2))
        of_images = context.repeat_interleave(frames, 0)
        for block, frame_block in zip(self.transformer_blocks, self.temporal_transformer_blocks):
            y = block(y, of_images)
            y = self.time_mixer(y, frame_block(y + place, context, frames))
        return x + self.proj_out(y).transpose(1, 2).unflatten(2, size)


class Level(nn.Module):
    """resnets of one resolution, each followed by a transformer where the level has attention"""

    def __init__(self, widths_in, width, c, level, attention, eps):
        super().__init__()
        time = 4 * c["block_out_channels"][0]
        self.resnets = nn.ModuleList(VideoResnet(n, width, GROUPS, eps, time) for n in widths_in)
        if attention:
            self.attentions = nn.ModuleList(_transformer(c, level) for _ in widths_in)

    def layers(self):
        return zip(self.resnets, getattr(self, "attentions", [None] * len(self.resnets)))


class MidBlock(nn.Module):
    def __init__(self, c):
        super().__init__()
        width, time = c["block_out_channels"][-1], 4 * c["block_out_channels"][0]
        self.resnets = nn.ModuleList(VideoResnet(width, width, GROUPS, EPS, time) for _ in range(2))
        self.attentions = nn.ModuleList([_transformer(c, len(c["block_out_channels"]) - 1)])

    def forward(self, x, frames, time, context):
        x = self.attentions[0](self.resnets[0](x, frames, time), frames, context)
        return self.resnets[1](x, frames, time)


class UNetSpatioTemporalConditionModel(nn.Module):
    """`config`: fields of diffusers' config.json; those that are missing have its defaults, others are ignored"""

    def __init__(self, config):
        super().__init__()
        c = {name: value if config.get(name) is None else config[name] for name, value in DEFAULTS.items()}
        self.config = c
        channels = c["block_out_channels"]
        count, time = per_level(c["layers_per_block"], len(channels)), 4 * channels[0]
        self.conv_in = nn.Conv2d(c["in_channels"], channels[0], 3, padding=1)
        self.time_embedding = Embedding(channels[0], time, time)
        self.add_embedding = Embedding(c["projection_class_embeddings_input_dim"], time, time)
        self.down_blocks = nn.ModuleList(_down_level(c, i, count[i]) for i in range(len(channels)))
        self.mid_block = MidBlock(c)
        self.up_blocks = nn.ModuleList(_up_level(c, i, count[-1 - i] + 1) for i in range(len(channels)))
        self.conv_norm_out = GroupNorm(GROUPS, channels[0], EPS)
        self.conv_out = nn.Conv2d(channels[0], c["out_channels"], 3, padding=1)

    def forward(self, sample, timestep, context, added):
        """sample [videos, frames, in_channels, H, W]; timestep [videos] or []; context [videos or 1, S, D]; added
        [videos or 1, numbers] -> [videos, frames, out_channels, H, W]"""
        videos, frames = sample.shape[:2]
        time = self._times(timestep.expand(videos), added.expand(videos, -1))
        context = context.expand(videos, -1, -1)
        x = self.conv_in(sample.flatten(0, 1))
        skips = [x]
        for level in self.down_blocks:
            for resnet, attention in level.layers():
                x = resnet(x, frames, time)
                x = attention(x, frames, context) if attention else x
                skips.append(x)
            for sampler in getattr(level, "downsamplers", ()):
                x = sampler(x)
                skips.append(x)
        x = self.mid_block(x, frames, time, context)
        for level in self.up_blocks:
            for resnet, attention in level.layers():
                x = resnet(torch.cat([x, skips.pop()], 1), frames, time)
                x = attention(x, frames, context) if attention else x
            for sampler in getattr(level, "upsamplers", ()):
                x = sampler(x, skips[-1].shape[2:])
        return self.conv_out(F.silu(self.conv_norm_out(x))).unflatten(0, (videos, frames))

    def config_json(self):
        """what the engine's renderer/config.json says"""
        return {"_class_name": "UNetSpatioTemporalConditionModel", **self.config}

    def _times(self, timestep, added):
        """-> [videos, 4 * block_out_channels[0]]"""
        numbers = sinusoids(added.flatten(), self.config["addition_time_embed_dim"])
        return (self.time_embedding(sinusoids(timestep, self.config["block_out_channels"][0]))
                + self.add_embedding(numbers.reshape(len(added), -1)))


def _transformer(c, level):
    levels, width = len(c["block_out_channels"]), c["block_out_channels"][level]
    return VideoTransformer(width, c["cross_attention_dim"], per_level(c["num_attention_heads"], levels)[level],
                            per_level(c["transformer_layers_per_block"], levels)[level])


def _down_level(c, i, layers):
    channels = c["block_out_channels"]
    widths_in = [channels[max(i - 1, 0)]] + [channels[i]] * (layers - 1)
    attention = c["down_block_types"][i] == "CrossAttnDownBlockSpatioTemporal"
    level = Level(widths_in, channels[i], c, i, attention, BLOCK_EPS if attention else EPS)
    if i + 1 < len(channels):
        level.downsamplers = nn.ModuleList([Downsampler(channels[i], one_sided=False)])
    return level


def _up_level(c, index, layers):
    """the last layer's skip comes from the level above, with that level's channels"""
    channels = c["block_out_channels"]
    i = len(channels) - 1 - index
    below = [channels[min(i + 1, len(channels) - 1)]] + [channels[i]] * (layers - 1)
    skips = [channels[i]] * (layers - 1) + [channels[max(i - 1, 0)]]
    level = Level([a + b for a, b in zip(below, skips)], channels[i], c, i,
                  c["up_block_types"][index] == "CrossAttnUpBlockSpatioTemporal", BLOCK_EPS)
    if i > 0:
        level.upsamplers = nn.ModuleList([Upsampler(channels[i])])
    return level
