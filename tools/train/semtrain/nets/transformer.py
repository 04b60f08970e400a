# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The Σ-Voxfield transformer: SD3's joint blocks over voxel tokens and semantic tokens (docs/method.md §2)."""
import math

import torch
from torch import nn
from torch.nn import functional as F

from ..condition import WIDTHS, width_of
from .attention import attend

CONFIG_FIELDS = ("num_layers", "num_attention_heads", "attention_head_dim", "points_per_voxel", "num_classes",
                 "voxel_size", "attention_radius", "pos_embed_dim", "context_pos_embed", "condition",
                 "condition_voxels")


def sinusoids(x, width, max_period=10000.0):
    """[...] -> [..., width]: sin(x w_i), then cos(x w_i), w_i = max_period^(-i / (width / 2))"""
    half = width // 2
    w = torch.exp(-math.log(max_period) / half * torch.arange(half, dtype=torch.float32, device=x.device))
    a = x[..., None].float() * w
    return torch.cat([a.sin(), a.cos()], -1)


def layer_norm(x):
    """in fp32: on CPUs PyTorch's own takes ten times as long in bf16"""
    return F.layer_norm(x.float(), x.shape[-1:], eps=1e-6)


class Attention(nn.Module):
    def __init__(self, width, heads, last):
        super().__init__()
        self.heads = heads
        for name in ("to_q", "to_k", "to_v", "add_q_proj", "add_k_proj", "add_v_proj"):
            setattr(self, name, nn.Linear(width, width))
        self.to_out = nn.ModuleList([nn.Linear(width, width)])
        self.to_add_out = None if last else nn.Linear(width, width)

    def forward(self, x, c, mask):
        """x, c [B, N, D]; mask [B, 1, 2N, 2N], 0 or a large negative number -> the same shapes; c None in the last"""
        n = x.shape[1]

        def heads(a, b):
            return torch.cat([a, b], 1).unflatten(2, (self.heads, -1)).transpose(1, 2)
        q = heads(self.to_q(x), self.add_q_proj(c))
        k = heads(self.to_k(x), self.add_k_proj(c))
        v = heads(self.to_v(x), self.add_v_proj(c))
        y = attend(q, k, v, mask).transpose(1, 2).flatten(2)
        return self.to_out[0](y[:, :n]), self.to_add_out(y[:, n:]) if self.to_add_out else None


def gelu_tanh(x):
    """x (1 + tanh(sqrt(2/pi) (x + 0.044715 x^3))) / 2 by a sigmoid of twice the argument: on CPUs PyTorch's own takes
    ten times as long in bf16. There the exact GELU stands in for it: 5e-4 apart at most, less than bf16 rounds by where
    that is felt, and a quarter of a step is saved"""
    if x.dtype == torch.bfloat16 and x.device.type == "cpu":
        return F.gelu(x)
    return x * torch.sigmoid(x * (1.5957691216057308 + 0.07135481282636 * x * x))


class FeedForward(nn.Module):
    """GELU-tanh; diffusers' names net.0.proj and net.2"""

    def __init__(self, width):
        super().__init__()
        first = nn.Module()
        first.proj = nn.Linear(width, 4 * width)
        self.net = nn.ModuleList([first, nn.Identity(), nn.Linear(4 * width, width)])

    def forward(self, x):
        return self.net[2](gelu_tanh(self.net[0].proj(x)))


class Modulation(nn.Module):
    def __init__(self, width, count):
        super().__init__()
        self.linear = nn.Linear(width, count * width)
        self.count = count

    def forward(self, temb):
        return self.linear(F.silu(temb))[:, None].chunk(self.count, -1)


class JointBlock(nn.Module):
    def __init__(self, width, heads, last):
        super().__init__()
        self.norm1 = Modulation(width, 6)
        self.norm1_context = Modulation(width, 2 if last else 6)
        self.attn = Attention(width, heads, last)
        self.ff = FeedForward(width)
        self.ff_context = None if last else FeedForward(width)

    def forward(self, x, c, temb, mask):
        shift, scale, gate, shift_mlp, scale_mlp, gate_mlp = self.norm1(temb)
        of_context = self.norm1_context(temb)
        if self.ff_context is None:
            c_scale, c_shift = of_context
        else:
            c_shift, c_scale, c_gate, c_shift_mlp, c_scale_mlp, c_gate_mlp = of_context
        y, z = self.attn(layer_norm(x) * (1 + scale) + shift, layer_norm(c) * (1 + c_scale) + c_shift, mask)
        x = x + gate * y
        x = x + gate_mlp * self.ff(layer_norm(x) * (1 + scale_mlp) + shift_mlp)
        if self.ff_context is None:
            return x, None
        c = c + c_gate * z
        return x, c + c_gate_mlp * self.ff_context(layer_norm(c) * (1 + c_scale_mlp) + c_shift_mlp)


class TimeEmbedding(nn.Module):
    """256 sinusoids, cosines first"""

    def __init__(self, width):
        super().__init__()
        self.linear_1 = nn.Linear(256, width)
        self.linear_2 = nn.Linear(width, width)

    def forward(self, timestep):
        sin, cos = sinusoids(timestep, 256).chunk(2, -1)
        return self.linear_2(F.silu(self.linear_1(torch.cat([cos, sin], -1))))


class ConditionEmbedding(nn.Module):
    """Conditions of voxels, for semantic tokens and, if `voxels`, for voxel tokens. Without bias: a voxel without
    conditions gets exactly nothing."""

    def __init__(self, parts, width, voxels):
        super().__init__()
        self.linear_1 = nn.Linear(width_of(parts), width, bias=False)
        self.linear_2 = nn.Linear(width, width, bias=False)
        self.linear_voxels = nn.Linear(width, width, bias=False) if voxels else None
        at = 0
        for part in parts:  # each is heard alike, whether it has four numbers or sixty
            nn.init.normal_(self.linear_1.weight.data[:, at:at + WIDTHS[part]], std=(2 / WIDTHS[part]) ** 0.5)
            at += WIDTHS[part]

    def start_at_zero(self):
        for linear in (self.linear_2, self.linear_voxels):
            if linear:
                nn.init.zeros_(linear.weight)

    def forward(self, x):
        """[B, N, W] -> what semantic tokens and what voxel tokens get, [B, N, D] each"""
        hidden = F.silu(self.linear_1(x))
        return self.linear_2(hidden), self.linear_voxels(hidden) if self.linear_voxels else 0


class VoxfieldTransformer(nn.Module):
    def __init__(self, num_layers=12, num_attention_heads=8, attention_head_dim=128, points_per_voxel=20,
                 num_classes=20, voxel_size=0.6, attention_radius=3.0, pos_embed_dim=128, context_pos_embed=True,
                 condition=(), condition_voxels=False):
        super().__init__()
        values = locals()
        self.config = {name: values[name] for name in CONFIG_FIELDS}
        d, c = num_attention_heads * attention_head_dim, 6 * points_per_voxel
        self.proj_in = nn.Linear(c, d)
        self.pos_embed = nn.Linear(3 * pos_embed_dim, d)
        self.semantic_embed = nn.Embedding(num_classes + 1, d)  # the last row is the null label
        self.condition_embed = ConditionEmbedding(condition, d, condition_voxels) if condition else None
        self.time_embed = TimeEmbedding(d)
        self.transformer_blocks = nn.ModuleList(
            JointBlock(d, num_attention_heads, last=i == num_layers - 1) for i in range(num_layers))
        self.norm_out = Modulation(d, 2)
        self.proj_out = nn.Linear(d, c)

    def start_at_zero(self):
        """adaLN-Zero: at first every block is the identity and the output 0; conditions say nothing"""
        for module in self.modules():
            if isinstance(module, Modulation):
                nn.init.zeros_(module.linear.weight)
                nn.init.zeros_(module.linear.bias)
        nn.init.zeros_(self.proj_out.weight)
        nn.init.zeros_(self.proj_out.bias)
        if self.condition_embed:
            self.condition_embed.start_at_zero()

    @staticmethod
    def attention_mask(centers, valid, radius):
        """[B, 1, 2N, 2N]: 0 where a token may look, else -1e9; padded rows see themselves"""
        apart = (centers[:, :, None] - centers[:, None]).double().square().sum(-1).sqrt()
        near = (apart <= radius + 1e-6) & valid[:, None] & valid[:, :, None]
        near = near | torch.eye(near.shape[1], dtype=torch.bool, device=near.device)
        return torch.zeros(near.shape, device=near.device).masked_fill_(~near, -1e9).repeat(1, 2, 2)[:, None]

    def forward(self, tokens, labels, centers, valid, timestep, condition=None, radius=None):
        """tokens [B, N, 6n] noisy; labels [B, N], num_classes = null; centers [B, N, 3] metres, in double where
        voxels that are just as far apart as the radius have to see each other, as in the engine; valid [B, N] bool;
        timestep [B]; condition [B, N, W] or None; radius: metres beyond which a voxel sees no others, if less than the
        attention radius -> x0 [B, N, 6n]"""
        w = valid[..., None].to(centers.dtype)
        origin = (centers * w).sum(1, keepdim=True) / w.sum(1, keepdim=True)
        places = sinusoids((centers - origin) / self.config["voxel_size"], self.config["pos_embed_dim"]).flatten(-2)
        position = self.pos_embed(places)
        x = self.proj_in(tokens) + position
        c = self.semantic_embed(labels)
        if condition is not None and self.condition_embed:
            of_labels, of_voxels = self.condition_embed(condition)
            c, x = c + of_labels, x + of_voxels
        if self.config["context_pos_embed"]:
            c = c + position
        temb = self.time_embed(timestep)
        widest = self.config["attention_radius"]
        mask = self.attention_mask(centers, valid, widest if radius is None else min(radius, widest))
        for block in self.transformer_blocks:
            x, c = block(x, c, temb, mask)
        scale, shift = self.norm_out(temb)
        return self.proj_out(layer_norm(x) * (1 + scale) + shift) * w.to(x.dtype)
