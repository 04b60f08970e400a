# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""AutoencoderKLTemporalDecoder of Stable Video Diffusion, with diffusers' tensor names and fields (docs/models.md §5)."""
from torch import nn
from torch.nn import functional as F

from .image_blocks import GroupNorm, Upsampler
from .vae import EPS, Encoder, SingleHeadAttention
from .video_blocks import VideoResnet, frames_inside, frames_outside

GROUPS, FRAME_EPS = 32, 1e-5
DEFAULTS = {"in_channels": 3, "out_channels": 3, "latent_channels": 4, "block_out_channels": [128, 256, 512, 512],
            "layers_per_block": 2, "scaling_factor": 0.18215, "force_upcast": True}


def _resnet(channels_in, channels_out):
    return VideoResnet(channels_in, channels_out, GROUPS, EPS, frame_eps=FRAME_EPS, switched=True)


class MidBlock(nn.Module):
    """`layers` resnets, of which two run, with the attention between them; of one the attention does not run"""

    def __init__(self, channels, layers):
        super().__init__()
        self.resnets = nn.ModuleList(_resnet(channels, channels) for _ in range(layers))
        self.attentions = nn.ModuleList([SingleHeadAttention(channels, GROUPS)])

    def forward(self, x, frames):
        x = self.resnets[0](x, frames)
        for resnet, attention in zip(self.resnets[1:], self.attentions):
            x = resnet(attention(x), frames)
        return x


class Level(nn.Module):
    def __init__(self, channels_in, channels_out, layers):
        super().__init__()
        self.resnets = nn.ModuleList(_resnet(channels_in if j == 0 else channels_out, channels_out)
                                     for j in range(layers))

    def forward(self, x, frames):
        for resnet in self.resnets:
            x = resnet(x, frames)
        for sampler in getattr(self, "upsamplers", ()):
            x = sampler(x)
        return x


class VideoDecoder(nn.Module):
    def __init__(self, c):
        super().__init__()
        channels = list(reversed(c["block_out_channels"]))
        self.conv_in = nn.Conv2d(c["latent_channels"], channels[0], 3, padding=1)
        self.mid_block = MidBlock(channels[0], c["layers_per_block"])
        self.up_blocks = nn.ModuleList()
        for i, out in enumerate(channels):
            level = Level(channels[max(i - 1, 0)], out, c["layers_per_block"] + 1)
            if i + 1 < len(channels):
                level.upsamplers = nn.ModuleList([Upsampler(out)])
            self.up_blocks.append(level)
        self.conv_norm_out = GroupNorm(GROUPS, channels[-1], EPS)
        self.conv_out = nn.Conv2d(channels[-1], c["out_channels"], 3, padding=1)
        self.time_conv_out = nn.Conv3d(c["out_channels"], c["out_channels"], (3, 1, 1), padding=(1, 0, 0))

    def forward(self, z, frames):
        x = self.mid_block(self.conv_in(z), frames)
        for level in self.up_blocks:
            x = level(x, frames)
        x = self.conv_out(F.silu(self.conv_norm_out(x)))
        return frames_outside(self.time_conv_out(frames_inside(x, frames)))


class AutoencoderKLTemporalDecoder(nn.Module):
    """`config`: fields of diffusers' config.json; those that are missing have its defaults, others are ignored"""

    def __init__(self, config):
        super().__init__()
        c = {name: value if config.get(name) is None else config[name] for name, value in DEFAULTS.items()}
        self.config = c
        self.encoder = Encoder({**c, "norm_num_groups": GROUPS, "mid_block_add_attention": True})
        self.decoder = VideoDecoder(c)
        self.quant_conv = nn.Conv2d(2 * c["latent_channels"], 2 * c["latent_channels"], 1)

    @property
    def downscale(self):
        return 2 ** (len(self.config["block_out_channels"]) - 1)

    def moments(self, image):
        """image [F, 3, H, W], -1..1 -> mean, log of the variance, each [F, 4, H / 8, W / 8]; frames are encoded alone"""
        mean, logvar = self.quant_conv(self.encoder(image)).chunk(2, 1)
        return mean, logvar.clamp(-30, 20)

    def decode(self, z, frames):
        """z [videos * frames, 4, h, w] -> [videos * frames, 3, 8 h, 8 w]"""
        return self.decoder(z, frames)

    def encode_scaled(self, image):
        """the latent that a denoiser sees: the posterior's mode, scaled"""
        return self.moments(image)[0] * self.config["scaling_factor"]

    def decode_scaled(self, latents):
        """of one video"""
        return self.decode(latents / self.config["scaling_factor"], len(latents))
