# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Components of a model folder, in the diffusers layout that the engine reads (docs/models.md §1)."""
import os

import torch

from . import safetensors_file
from .json_file import read_json, write_json
from .low_rank import FILE, is_adapter

HALF_BITS = 10  # of an fp16 number's mantissa, its leading one not counted


def rounded_half(tensor, bits=HALF_BITS):
    """fp16 with so many bits of mantissa, 1 to 10, ties to even: the fewer, the smaller what git and zip make of it"""
    half, drop = tensor.to(torch.float16), HALF_BITS - bits
    if drop == 0:
        return half
    code = half.contiguous().view(torch.int16).int()
    odd = code >> drop & 1
    code = (code + (1 << drop - 1) - 1 + odd) >> drop << drop
    return code.short().view(torch.float16)


def write_component(folder, config, state, mantissa_bits=HALF_BITS):
    """FOLDER/config.json and the weights in fp16; those of adapters in a file of their own"""
    os.makedirs(folder, exist_ok=True)
    write_json(os.path.join(folder, "config.json"), config)
    rounded = {name: rounded_half(t, mantissa_bits) for name, t in state.items()}
    for file, adapter in (("diffusion_pytorch_model.safetensors", False), (FILE, True)):
        tensors = {name: t for name, t in rounded.items() if is_adapter(name) == adapter}
        if tensors or not adapter:
            safetensors_file.write(os.path.join(folder, file), tensors, {"format": "pt"})
        elif os.path.exists(os.path.join(folder, file)):
            os.remove(os.path.join(folder, file))


def write_scheduler(folder, config):
    os.makedirs(folder, exist_ok=True)
    write_json(os.path.join(folder, "scheduler_config.json"), config)


def add_to_index(folder, components, defaults=None):
    """what model_index.json says, with these components ({name: [library, class]}) and defaults added"""
    path = os.path.join(folder, "model_index.json")
    index = {"_class_name": "SemRoverPipeline"}
    if os.path.exists(path):
        index = read_json(path)
    index.update(components)
    if defaults:
        index["defaults"] = {**index.get("defaults", {}), **defaults}
    write_json(path, index)


def read_component(folder):
    """-> (config, {name: tensor}), adapters left out"""
    weights = os.path.join(folder, "diffusion_pytorch_model.safetensors")
    return read_json(os.path.join(folder, "config.json")), safetensors_file.read(weights)
