# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Inception v3 in front of its classifier (Szegedy et al. 2015), with tensor names and pools as FID uses it
(pytorch-fid; docs/eval.md): mean pools leave the padding out, and the last block has a max pool."""
import torch
from torch import nn
from torch.nn import functional as F

SIDE = 299  # pixels: pictures are resized to squares of this side
EPS = 1e-3  # of batch norms
HALVE = ("max", 2)
MEAN, MAX = ("mean", 1), ("max", 1)  # padded to keep the size

# a branch is (pool or None, convolutions one after the other, then those that all see the last one's output);
# a convolution is (name, height, width, outputs of the usual network, stride)


def block_a(pooled):
    return [(None, [("branch1x1", 1, 1, 64, 1)], []),
            (None, [("branch5x5_1", 1, 1, 48, 1), ("branch5x5_2", 5, 5, 64, 1)], []),
            (None, [("branch3x3dbl_1", 1, 1, 64, 1), ("branch3x3dbl_2", 3, 3, 96, 1), ("branch3x3dbl_3", 3, 3, 96, 1)],
             []),
            (MEAN, [("branch_pool", 1, 1, pooled, 1)], [])]


def block_b():
    return [(None, [("branch3x3", 3, 3, 384, 2)], []),
            (None, [("branch3x3dbl_1", 1, 1, 64, 1), ("branch3x3dbl_2", 3, 3, 96, 1), ("branch3x3dbl_3", 3, 3, 96, 2)],
             []),
            (HALVE, [], [])]


def block_c(n):
    return [(None, [("branch1x1", 1, 1, 192, 1)], []),
            (None, [("branch7x7_1", 1, 1, n, 1), ("branch7x7_2", 1, 7, n, 1), ("branch7x7_3", 7, 1, 192, 1)], []),
            (None, [("branch7x7dbl_1", 1, 1, n, 1), ("branch7x7dbl_2", 7, 1, n, 1), ("branch7x7dbl_3", 1, 7, n, 1),
                    ("branch7x7dbl_4", 7, 1, n, 1), ("branch7x7dbl_5", 1, 7, 192, 1)], []),
            (MEAN, [("branch_pool", 1, 1, 192, 1)], [])]


def block_d():
    return [(None, [("branch3x3_1", 1, 1, 192, 1), ("branch3x3_2", 3, 3, 320, 2)], []),
            (None, [("branch7x7x3_1", 1, 1, 192, 1), ("branch7x7x3_2", 1, 7, 192, 1), ("branch7x7x3_3", 7, 1, 192, 1),
                    ("branch7x7x3_4", 3, 3, 192, 2)], []),
            (HALVE, [], [])]


def block_e(pool):
    return [(None, [("branch1x1", 1, 1, 320, 1)], []),
            (None, [("branch3x3_1", 1, 1, 384, 1)], [("branch3x3_2a", 1, 3, 384, 1), ("branch3x3_2b", 3, 1, 384, 1)]),
            (None, [("branch3x3dbl_1", 1, 1, 448, 1), ("branch3x3dbl_2", 3, 3, 384, 1)],
             [("branch3x3dbl_3a", 1, 3, 384, 1), ("branch3x3dbl_3b", 3, 1, 384, 1)]),
            (pool, [("branch_pool", 1, 1, 192, 1)], [])]


BLOCKS = {"Mixed_5b": block_a(32), "Mixed_5c": block_a(64), "Mixed_5d": block_a(64), "Mixed_6a": block_b(),
          "Mixed_6b": block_c(128), "Mixed_6c": block_c(160), "Mixed_6d": block_c(160), "Mixed_6e": block_c(192),
          "Mixed_7a": block_d(), "Mixed_7b": block_e(MEAN), "Mixed_7c": block_e(MAX)}


class Convolution(nn.Module):
    """a convolution without bias, batch norm, ReLU"""

    def __init__(self, inputs, outputs, taps, stride=1, padded=True):
        super().__init__()
        padding = [n // 2 for n in taps] if stride == 1 and padded else 0
        self.conv = nn.Conv2d(inputs, outputs, taps, stride, padding, bias=False)
        self.bn = nn.BatchNorm2d(outputs, eps=EPS)

    def forward(self, x):
        return F.relu(self.bn(self.conv(x)), inplace=True)


def pool_of(x, pool):
    kind, stride = pool
    padding = 1 if stride == 1 else 0
    if kind == "max":
        return F.max_pool2d(x, 3, stride, padding)
    return F.avg_pool2d(x, 3, stride, padding, count_include_pad=False)


class Block(nn.Module):
    """branches that see the same input, their outputs concatenated"""

    def __init__(self, inputs, branches, width_of):
        super().__init__()
        self.branches, self.outputs = branches, 0
        for _, chain, heads in branches:
            width = inputs
            for row in chain:
                width = self._add(width, row, width_of)
            self.outputs += sum(self._add(width, row, width_of) for row in heads) if heads else width

    def _add(self, inputs, row, width_of):
        name, height, width, outputs, stride = row
        self.add_module(name, Convolution(inputs, width_of(outputs), (height, width), stride))
        return width_of(outputs)

    def forward(self, x):
        outputs = []
        for pool, chain, heads in self.branches:
            y = pool_of(x, pool) if pool else x
            for row in chain:
                y = getattr(self, row[0])(y)
            outputs += [getattr(self, row[0])(y) for row in heads] or [y]
        return torch.cat(outputs, 1)


class Inception(nn.Module):
    """Every layer has `width` times the usual network's channels, rounded, and at least `least`."""

    def __init__(self, width=1.0, least=4):
        super().__init__()

        def width_of(usual):
            return max(round(width * usual), least)
        self.Conv2d_1a_3x3 = Convolution(3, width_of(32), (3, 3), 2)
        self.Conv2d_2a_3x3 = Convolution(width_of(32), width_of(32), (3, 3), padded=False)
        self.Conv2d_2b_3x3 = Convolution(width_of(32), width_of(64), (3, 3))
        self.Conv2d_3b_1x1 = Convolution(width_of(64), width_of(80), (1, 1))
        self.Conv2d_4a_3x3 = Convolution(width_of(80), width_of(192), (3, 3), padded=False)
        inputs = width_of(192)
        for name, branches in BLOCKS.items():
            block = Block(inputs, branches, width_of)
            self.add_module(name, block)
            inputs = block.outputs
        self.features = inputs

    def forward(self, x):
        """[B, 3, 299, 299], -1..1 -> [B, features]"""
        x = self.Conv2d_2b_3x3(self.Conv2d_2a_3x3(self.Conv2d_1a_3x3(x)))
        x = self.Conv2d_4a_3x3(self.Conv2d_3b_1x1(pool_of(x, HALVE)))
        x = pool_of(x, HALVE)
        for name in BLOCKS:
            x = getattr(self, name)(x)
        return x.mean((2, 3))


def resized(pixels):
    """[B, 3, H, W], 0..255 -> [B, 3, 299, 299], -1..1; bilinear between pixel centres, without antialiasing"""
    pixels = pixels if pixels.is_floating_point() else pixels.float()
    return F.interpolate(pixels, (SIDE, SIDE), mode="bilinear", align_corners=False) / 127.5 - 1
