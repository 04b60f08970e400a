# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Activations that are computed again when the backward pass needs them, in place of being kept (Chen et al. 2016,
arXiv 1604.06174)."""
from functools import partial

from torch.utils.checkpoint import checkpoint

from .image_blocks import ResnetBlock
from .transformer import JointBlock
from .unet import Transformer2D
from .vae import SingleHeadAttention
from .video_blocks import VideoResnet
from .video_unet import VideoTransformer

BLOCKS = (JointBlock, ResnetBlock, SingleHeadAttention, Transformer2D, VideoResnet, VideoTransformer)


def blocks_of(model):
    """the outermost BLOCKS of a network, in its order"""
    for module in model.children():
        if isinstance(module, BLOCKS):
            yield module
        else:
            yield from blocks_of(module)


def recompute_blocks(model):
    """from now on only the inputs of blocks are kept for the backward pass"""
    blocks = list(blocks_of(model))
    if not blocks:
        names = ", ".join(kind.__name__ for kind in BLOCKS)
        raise SystemExit(f"recompute: this network has no block of these: {names}")
    for block in blocks:
        block.forward = partial(checkpoint, block.forward, use_reentrant=False, preserve_rng_state=False)
