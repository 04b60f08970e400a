# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Components of a model folder, in the diffusers layout that the engine reads (docs/models.md §1)."""
import os

import torch

from . import safetensors_file
from .json_file import read_json, write_json


def write_component(folder, config, state):
    """FOLDER/config.json and the weights in fp16"""
    os.makedirs(folder, exist_ok=True)
    write_json(os.path.join(folder, "config.json"), config)
    safetensors_file.write(os.path.join(folder, "diffusion_pytorch_model.safetensors"),
                           {name: t.to(torch.float16) for name, t in state.items()}, {"format": "pt"})


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
    """-> (config, {name: tensor})"""
    weights = os.path.join(folder, "diffusion_pytorch_model.safetensors")
    return read_json(os.path.join(folder, "config.json")), safetensors_file.read(weights)
