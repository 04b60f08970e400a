# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Components of a model folder, in the diffusers layout that the engine reads (docs/models.md §1)."""
import os
import re

import torch

from . import safetensors_file
from .json_file import read_json, write_json
from .low_rank import FILE, is_adapter

WEIGHTS = "diffusion_pytorch_model.safetensors"
HALF_WEIGHTS = "diffusion_pytorch_model.fp16.safetensors"
OLD_NAMES = {"query": "to_q", "key": "to_k", "value": "to_v", "proj_attn": "to_out.0"}  # of a VAE's attention, in 2022
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
    for file, adapter in ((WEIGHTS, False), (FILE, True)):
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


def weights_of(folder):
    """the file that has a component's weights"""
    for name in (WEIGHTS, HALF_WEIGHTS):
        if os.path.exists(os.path.join(folder, name)):
            return os.path.join(folder, name)
    raise SystemExit(f"{folder}: expected {WEIGHTS} or {HALF_WEIGHTS}, found neither; `semrover convert MODEL NEW` reads "
                     "shards and single files, too, and writes the former")


def vae_of(folder):
    """the VAE in a model folder, which may be None"""
    vae = os.path.join(folder or "", "vae")
    if not folder or not os.path.isdir(vae):
        raise SystemExit("--vae is missing" + (f", and {folder} has no vae/" if folder else ""))
    return vae


def name_today(name):
    """of a tensor: as diffusers calls it now"""
    return re.sub(r"(?<=\.)(query|key|value|proj_attn)(?=\.)", lambda found: OLD_NAMES[found[0]], name)


def read_component(folder):
    """-> (config, {name: tensor}), adapters left out"""
    state = safetensors_file.read(weights_of(folder))
    return read_json(os.path.join(folder, "config.json")), {name_today(name): t for name, t in state.items()}
