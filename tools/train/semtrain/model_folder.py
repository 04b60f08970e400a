# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Components of a model folder, in the diffusers layout that the engine reads (spec: models.md)."""
import json
import os

import torch

from . import safetensors_file


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
    return read_json(os.path.join(folder, "config.json")), safetensors_file.read(os.path.join(folder, "diffusion_pytorch_model.safetensors"))


def read_json(path):
    with open(path) as file:
        return json.load(file)


def write_json(path, value):
    with open(path + ".part", "w") as file:
        json.dump(value, file, indent=1)
        file.write("\n")
    os.replace(path + ".part", path)
