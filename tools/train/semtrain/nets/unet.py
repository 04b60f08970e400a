# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""UNet2DConditionModel of Stable Diffusion 1.5, with diffusers' tensor names and fields (docs/models.md §4)."""
import math

import torch
from torch import nn
from torch.nn import functional as F

from .attention import attend
from .image_blocks import Downsampler, GroupNorm, LayerNorm, ResnetBlock, Upsampler, per_level

DEFAULTS = {"in_channels": 4, "out_channels": 4, "block_out_channels": [320, 640, 1280, 1280], "layers_per_block": 2,
            "down_block_types": ["CrossAttnDownBlock2D"] * 3 + ["DownBlock2D"],
            "mid_block_type": "UNetMidBlock2DCrossAttn",
            "up_block_types": ["UpBlock2D"] + ["CrossAttnUpBlock2D"] * 3,
            "attention_head_dim": 8, "transformer_layers_per_block": 1, "cross_attention_dim": 768,
            "norm_num_groups": 32, "norm_eps": 1e-5, "use_linear_projection": False, "flip_sin_to_cos": True,
            "freq_shift": 0}


class Attention(nn.Module):
    """of pixels to themselves or to the text; no bias but on the way out"""

    def __init__(self, channels, context, heads):
        super().__init__()
        self.heads = heads
        self.to_q = nn.Linear(channels, channels, bias=False)
        self.to_k = nn.Linear(context, channels, bias=False)
        self.to_v = nn.Linear(context, channels, bias=False)
        self.to_out = nn.ModuleList([nn.Linear(channels, channels)])

    def forward(self, x, context):
        """x [B, N, C], context [B, M, context] -> [B, N, C]"""
        def heads(y):
            return y.unflatten(2, (self.heads, -1)).transpose(1, 2)
        q, k, v = heads(self.to_q(x)), heads(self.to_k(context)), heads(self.to_v(context))
        return self.to_out[0](attend(q, k, v).transpose(1, 2).flatten(2))


class FeedForward(nn.Module):
    """GEGLU; diffusers' names net.0.proj and net.2"""

    def __init__(self, channels):
        super().__init__()
        first = nn.Module()
        first.proj = nn.Linear(channels, 8 * channels)
        self.net = nn.ModuleList([first, nn.Identity(), nn.Linear(4 * channels, channels)])

    def forward(self, x):
        hidden, gate = self.net[0].proj(x).chunk(2, -1)
        return self.net[2](hidden * F.gelu(gate))


class TransformerBlock(nn.Module):
    def __init__(self, channels, context, heads):
        super().__init__()
        self.norm1, self.norm2, self.norm3 = (LayerNorm(channels) for _ in range(3))
        self.attn1 = Attention(channels, channels, heads)
        self.attn2 = Attention(channels, context, heads)
        self.ff = FeedForward(channels)

    def forward(self, x, context):
        y = self.norm1(x)
        x = x + self.attn1(y, y)
        x = x + self.attn2(self.norm2(x), context)
        return x + self.ff(self.norm3(x))


class Transformer2D(nn.Module):
    """blocks over the pixels of a picture"""

    def __init__(self, channels, context, heads, layers, groups, linear):
        super().__init__()
        self.linear = linear
        self.norm = GroupNorm(groups, channels, 1e-6)
        self.proj_in = nn.Linear(channels, channels) if linear else nn.Conv2d(channels, channels, 1)
        self.transformer_blocks = nn.ModuleList(TransformerBlock(channels, context, heads) for _ in range(layers))
        self.proj_out = nn.Linear(channels, channels) if linear else nn.Conv2d(channels, channels, 1)

    def forward(self, x, context):
        """x [B, C, H, W], context [B, S, D] -> [B, C, H, W]"""
        size = x.shape[2:]
        y = self.norm(x)
        y = y if self.linear else self.proj_in(y)
        y = y.flatten(2).transpose(1, 2)
        y = self.proj_in(y) if self.linear else y
        for block in self.transformer_blocks:
            y = block(y, context)
        y = self.proj_out(y) if self.linear else y
        y = y.transpose(1, 2).unflatten(2, size)
        return x + (y if self.linear else self.proj_out(y))


class Level(nn.Module):
    """resnets of one resolution, each followed by a transformer where the level has attention"""

    def __init__(self, widths_in, width, c, level, attention):
        super().__init__()
        groups, time = c["norm_num_groups"], 4 * c["block_out_channels"][0]
        self.resnets = nn.ModuleList(ResnetBlock(n, width, groups, c["norm_eps"], time) for n in widths_in)
        if attention:
            self.attentions = nn.ModuleList(_transformer(c, level) for _ in widths_in)

    def layers(self):
        return zip(self.resnets, getattr(self, "attentions", [None] * len(self.resnets)))


class MidBlock(nn.Module):
    def __init__(self, c):
        super().__init__()
        width, attention = c["block_out_channels"][-1], c["mid_block_type"] == "UNetMidBlock2DCrossAttn"
        self.resnets = nn.ModuleList(
            ResnetBlock(width, width, c["norm_num_groups"], c["norm_eps"], 4 * c["block_out_channels"][0])
            for _ in range(2 if attention else 1))
        if attention:
            self.attentions = nn.ModuleList([_transformer(c, len(c["block_out_channels"]) - 1)])

    def forward(self, x, time, context):
        x = self.resnets[0](x, time)
        return self.resnets[1](self.attentions[0](x, context), time) if len(self.resnets) > 1 else x


class TimeEmbedding(nn.Module):
    def __init__(self, width):
        super().__init__()
        self.linear_1 = nn.Linear(width, 4 * width)
        self.linear_2 = nn.Linear(4 * width, 4 * width)

    def forward(self, x):
        return self.linear_2(F.silu(self.linear_1(x)))


class UNet2DConditionModel(nn.Module):
    """`config`: fields of diffusers' config.json; those that are missing have its defaults, others are ignored"""

    def __init__(self, config):
        super().__init__()
        c = {name: value if config.get(name) is None else config[name] for name, value in DEFAULTS.items()}
        if config.get("num_attention_heads") is not None:
            c["attention_head_dim"] = config["num_attention_heads"]
        self.config = c
        channels = c["block_out_channels"]
        count = per_level(c["layers_per_block"], len(channels))
        self.conv_in = nn.Conv2d(c["in_channels"], channels[0], 3, padding=1)
        self.time_embedding = TimeEmbedding(channels[0])
        self.down_blocks = nn.ModuleList(_down_level(c, i, count[i]) for i in range(len(channels)))
        self.mid_block = MidBlock(c)
        self.up_blocks = nn.ModuleList(_up_level(c, i, count[-1 - i] + 1) for i in range(len(channels)))
        self.conv_norm_out = GroupNorm(c["norm_num_groups"], channels[0], c["norm_eps"])
        self.conv_out = nn.Conv2d(channels[0], c["out_channels"], 3, padding=1)

    def forward(self, sample, timestep, context):
        """sample [B, in_channels, H, W], any size; timestep [B] or []; context [B or 1, S, cross_attention_dim]
        -> [B, out_channels, H, W]"""
        batch = sample.shape[0]
        time = self.time_embedding(self._sinusoids(timestep.expand(batch)))
        context = context.expand(batch, -1, -1)
        x = self.conv_in(sample)
        skips = [x]
        for level in self.down_blocks:
            for resnet, attention in level.layers():
                x = resnet(x, time)
                x = attention(x, context) if attention else x
                skips.append(x)
            for sampler in getattr(level, "downsamplers", ()):
                x = sampler(x)
                skips.append(x)
        x = self.mid_block(x, time, context)
        for level in self.up_blocks:
            for resnet, attention in level.layers():
                x = resnet(torch.cat([x, skips.pop()], 1), time)
                x = attention(x, context) if attention else x
            for sampler in getattr(level, "upsamplers", ()):
                x = sampler(x, skips[-1].shape[2:])
        return self.conv_out(F.silu(self.conv_norm_out(x)))

    def config_json(self):
        """what the engine's renderer/config.json says"""
        return {"_class_name": "UNet2DConditionModel", **self.config}

    def _sinusoids(self, timestep):
        """[B] -> [B, block_out_channels[0]]"""
        half = self.config["block_out_channels"][0] // 2
        exponent = torch.arange(half, dtype=torch.float32, device=timestep.device) / (half - self.config["freq_shift"])
        a = timestep[:, None].float() * torch.exp(-math.log(10000.0) * exponent)
        return torch.cat([a.cos(), a.sin()] if self.config["flip_sin_to_cos"] else [a.sin(), a.cos()], 1)


def _transformer(c, level):
    levels, width = len(c["block_out_channels"]), c["block_out_channels"][level]
    return Transformer2D(width, c["cross_attention_dim"], per_level(c["attention_head_dim"], levels)[level],
                         per_level(c["transformer_layers_per_block"], levels)[level], c["norm_num_groups"],
                         c["use_linear_projection"])


def _down_level(c, i, layers):
    channels = c["block_out_channels"]
    widths_in = [channels[max(i - 1, 0)]] + [channels[i]] * (layers - 1)
    level = Level(widths_in, channels[i], c, i, c["down_block_types"][i] == "CrossAttnDownBlock2D")
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
                  c["up_block_types"][index] == "CrossAttnUpBlock2D")
    if i > 0:
        level.upsamplers = nn.ModuleList([Upsampler(channels[i])])
    return level
