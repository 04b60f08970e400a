# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""AutoencoderKL of Stable Diffusion, with diffusers' tensor names and fields (docs/models.md §5)."""
from torch import nn
from torch.nn import functional as F

from .attention import attend
from .image_blocks import Downsampler, GroupNorm, ResnetBlock, Upsampler

EPS = 1e-6
DEFAULTS = {"in_channels": 3, "out_channels": 3, "latent_channels": 4, "block_out_channels": [128, 256, 512, 512],
            "layers_per_block": 2, "norm_num_groups": 32, "mid_block_add_attention": True, "use_quant_conv": True,
            "use_post_quant_conv": True, "force_upcast": True, "scaling_factor": 0.18215, "shift_factor": 0.0}


class SingleHeadAttention(nn.Module):
    """over all pixels, one head"""

    def __init__(self, channels, groups):
        super().__init__()
        self.group_norm = GroupNorm(groups, channels, EPS)
        for name in ("to_q", "to_k", "to_v"):
            setattr(self, name, nn.Linear(channels, channels))
        self.to_out = nn.ModuleList([nn.Linear(channels, channels)])

    def forward(self, x):
        """[B, C, H, W] -> the same"""
        y = self.group_norm(x).flatten(2).transpose(1, 2)
        y = self.to_out[0](attend(self.to_q(y), self.to_k(y), self.to_v(y)))
        return x + y.transpose(1, 2).unflatten(2, x.shape[2:])


class MidBlock(nn.Module):
    def __init__(self, channels, groups, attention):
        super().__init__()
        self.resnets = nn.ModuleList(ResnetBlock(channels, channels, groups, EPS) for _ in range(2))
        self.attentions = nn.ModuleList([SingleHeadAttention(channels, groups)] if attention else [])

    def forward(self, x):
        x = self.resnets[0](x)
        for attention in self.attentions:
            x = attention(x)
        return self.resnets[1](x)


class Level(nn.Module):
    """resnets of one resolution, then, but for the last level, the way to the next"""

    def __init__(self, channels_in, channels_out, layers, groups):
        super().__init__()
        self.resnets = nn.ModuleList(ResnetBlock(channels_in if j == 0 else channels_out, channels_out, groups, EPS)
                                     for j in range(layers))

    def forward(self, x):
        for resnet in self.resnets:
            x = resnet(x)
        for sampler in getattr(self, "downsamplers", getattr(self, "upsamplers", ())):
            x = sampler(x)
        return x


class Encoder(nn.Module):
    def __init__(self, c):
        super().__init__()
        channels, groups = c["block_out_channels"], c["norm_num_groups"]
        self.conv_in = nn.Conv2d(c["in_channels"], channels[0], 3, padding=1)
        self.down_blocks = nn.ModuleList()
        for i, out in enumerate(channels):
            level = Level(channels[max(i - 1, 0)], out, c["layers_per_block"], groups)
            if i + 1 < len(channels):
                level.downsamplers = nn.ModuleList([Downsampler(out, one_sided=True)])
            self.down_blocks.append(level)
        self.mid_block = MidBlock(channels[-1], groups, c["mid_block_add_attention"])
        self.conv_norm_out = GroupNorm(groups, channels[-1], EPS)
        self.conv_out = nn.Conv2d(channels[-1], 2 * c["latent_channels"], 3, padding=1)

    def forward(self, x):
        x = self.conv_in(x)
        for level in self.down_blocks:
            x = level(x)
        return self.conv_out(F.silu(self.conv_norm_out(self.mid_block(x))))


class Decoder(nn.Module):
    def __init__(self, c):
        super().__init__()
        channels, groups = list(reversed(c["block_out_channels"])), c["norm_num_groups"]
        self.conv_in = nn.Conv2d(c["latent_channels"], channels[0], 3, padding=1)
        self.mid_block = MidBlock(channels[0], groups, c["mid_block_add_attention"])
        self.up_blocks = nn.ModuleList()
        for i, out in enumerate(channels):
            level = Level(channels[max(i - 1, 0)], out, c["layers_per_block"] + 1, groups)
            if i + 1 < len(channels):
                level.upsamplers = nn.ModuleList([Upsampler(out)])
            self.up_blocks.append(level)
        self.conv_norm_out = GroupNorm(groups, channels[-1], EPS)
        self.conv_out = nn.Conv2d(channels[-1], c["out_channels"], 3, padding=1)

    def forward(self, z):
        z = self.mid_block(self.conv_in(z))
        for level in self.up_blocks:
            z = level(z)
        return self.conv_out(F.silu(self.conv_norm_out(z)))


class AutoencoderKL(nn.Module):
    """`config`: fields of diffusers' config.json; those that are missing have its defaults, others are ignored"""

    def __init__(self, config):
        super().__init__()
        c = {name: value if config.get(name) is None else config[name] for name, value in DEFAULTS.items()}
        self.config = c
        self.encoder, self.decoder = Encoder(c), Decoder(c)
        n = c["latent_channels"]
        self.quant_conv = nn.Conv2d(2 * n, 2 * n, 1) if c["use_quant_conv"] else nn.Identity()
        self.post_quant_conv = nn.Conv2d(n, n, 1) if c["use_post_quant_conv"] else nn.Identity()

    @property
    def downscale(self):
        return 2 ** (len(self.config["block_out_channels"]) - 1)

    def moments(self, image):
        """image [B, 3, H, W], -1..1 -> mean, log of the variance, each [B, 4, H / 8, W / 8]"""
        mean, logvar = self.quant_conv(self.encoder(image)).chunk(2, 1)
        return mean, logvar.clamp(-30, 20)

    def decode(self, z):
        """z [B, 4, h, w], as `moments` gives it -> [B, 3, 8 h, 8 w]"""
        return self.decoder(self.post_quant_conv(z))

    def encode_scaled(self, image):
        """the latent that a denoiser sees: the posterior's mode, moved and scaled"""
        return (self.moments(image)[0] - self.config["shift_factor"]) * self.config["scaling_factor"]

    def decode_scaled(self, latent):
        return self.decode(latent / self.config["scaling_factor"] + self.config["shift_factor"])

    def config_json(self):
        """what the engine's vae/config.json says"""
        levels = len(self.config["block_out_channels"])
        return {"_class_name": "AutoencoderKL", **self.config, "act_fn": "silu",
                "down_block_types": ["DownEncoderBlock2D"] * levels, "up_block_types": ["UpDecoderBlock2D"] * levels}
