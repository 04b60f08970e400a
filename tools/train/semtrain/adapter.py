# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What a trained transformer has learnt beyond the weights that it began with, as a low-rank adapter beside these: the
nearest matrices of that rank. Weights stay as they are, a file of a few MB makes the difference, and without it the
model is what it was. Biases and embeddings keep the former values."""
import argparse
import os
import shutil

import torch
from torch import nn

from . import safetensors_file
from .low_rank import DOWN, FILE, UP, merged, read_adapter
from .model_folder import read_component, rounded_half, weights_of
from .nets.transformer import VoxfieldTransformer
from .regenerate import network_of


def nearest(difference, rank):
    """[N, K] -> A [rank, K], B [N, rank] of which B A is nearest to it (Eckart & Young 1936), both of like size"""
    u, s, v = torch.linalg.svd(difference, full_matrices=False)
    root = s[:rank].sqrt()
    return root[:, None] * v[:rank], u[:, :rank] * root


def adapter_between(before, after, layers, rank):
    """-> {name: tensor} for the layers whose weights differ"""
    out = {}
    for layer in layers:
        difference = after[f"{layer}.weight"].float() - before[f"{layer}.weight"].float()
        if difference.any():
            out[layer + DOWN], out[layer + UP] = nearest(difference, rank)
    return out


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run adapter", description=__doc__)
    p.add_argument("-o", "--output", required=True, help="voxfield_transformer folder: BASE's weights, the adapter")
    p.add_argument("--base", required=True, help="voxfield_transformer folder; its own adapter is replaced")
    p.add_argument("--trained", required=True, help="voxfield_transformer folder of the same shape")
    p.add_argument("--rank", type=int, default=32)
    options = p.parse_args(arguments)
    (config, before), (of_trained, after) = (read_component(folder) for folder in (options.base, options.trained))
    if network_of(config) != network_of(of_trained):
        raise SystemExit(f"{options.trained} is a network of another shape than {options.base}")
    layers = [name for name, layer in VoxfieldTransformer(**network_of(config)).named_modules()
              if isinstance(layer, nn.Linear)]
    adapter = adapter_between(before, merged(after, read_adapter(options.trained)), layers, options.rank)
    os.makedirs(options.output, exist_ok=True)
    for path in (os.path.join(options.base, "config.json"), weights_of(options.base)):
        shutil.copy(path, options.output)
    halves = {name: rounded_half(tensor) for name, tensor in adapter.items()}
    safetensors_file.write(os.path.join(options.output, FILE), halves, {"format": "pt"})
    print(f"{len(halves) // 2} layers, {os.path.getsize(os.path.join(options.output, FILE)) / 1e6:.1f} MB", flush=True)


if __name__ == "__main__":
    main()
