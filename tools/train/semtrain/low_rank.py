# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Low-rank adapters (LoRA, Hu et al. 2021, arXiv 2106.09685): a layer's weight W stays, and B A is added to it, of which
A is [rank, inputs] and B [outputs, rank]. Files are named as diffusers names them: a component's folder holds
pytorch_lora_weights.safetensors with NAME.lora_A.weight and NAME.lora_B.weight for some of its layers."""
import os
from fnmatch import fnmatchcase

from torch import nn

from . import safetensors_file

FILE = "pytorch_lora_weights.safetensors"
DOWN, UP = ".lora_A.weight", ".lora_B.weight"


class LowRankLinear(nn.Linear):
    """what add_low_rank makes of an nn.Linear"""

    def forward(self, x):
        return super().forward(x) + self.lora_B(self.lora_A(x))


def add_low_rank(model, rank, patterns):
    """gives the layers whose names match one of these (`*` stands for anything) an adapter that at first adds nothing"""
    for pattern in patterns if rank else ():
        layers = {name: layer for name, layer in model.named_modules()
                  if isinstance(layer, nn.Linear) and fnmatchcase(name, pattern) and ".lora_" not in name}
        if not layers:
            raise SystemExit(f"low_rank_of: no layer is called {pattern}")
        for layer in layers.values():
            if not isinstance(layer, LowRankLinear):
                layer.__class__ = LowRankLinear
                layer.lora_A = nn.Linear(layer.in_features, rank, bias=False)
                layer.lora_B = nn.Linear(rank, layer.out_features, bias=False)
                nn.init.zeros_(layer.lora_B.weight)


def is_adapter(name):
    return name.endswith((DOWN, UP))


def read_adapter(folder, file=FILE):
    """-> {name: tensor}, empty where the folder has none"""
    path = os.path.join(folder, file)
    return safetensors_file.read(path) if os.path.exists(path) else {}


def merged(state, adapter):
    """weights of a model, with what an adapter adds: W + B A, in fp32"""
    state = dict(state)
    for name in adapter:
        if name.endswith(DOWN):
            layer = name[:-len(DOWN)]
            state[layer + ".weight"] = state[layer + ".weight"].float() + \
                adapter[layer + UP].float() @ adapter[name].float()
    return state
