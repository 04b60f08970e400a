# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""make_golden.py: writes golden cases of what public code lacks, as the modules of the recipes compute them.

- transformer_objects and transformer_voxels, transformers conditioned on objects: semantic tokens alone, and voxel
  tokens too. The inputs but the condition are those of transformer_tiny; the weights are random.
- sampling_distilled: the few steps of a distilled model, each one pass, with quadratic spacing and fresh noise that makes
  up for errors. Weights and inputs are those of sampling_ddpm."""
import json
import os

import numpy as np
import torch

import golden
from semtrain import safetensors_file
from semtrain.condition import vector_of
from semtrain.model_folder import write_component
from semtrain.nets.transformer import VoxfieldTransformer
from semtrain.regenerate import network_of
from semtrain.objects import owners_of
from semtrain.sampler import steps_of

NAMES = {"transformer_objects": False, "transformer_voxels": True}
NETWORK = {"num_layers": 2, "num_attention_heads": 2, "attention_head_dim": 32, "points_per_voxel": 20,
           "num_classes": 20, "voxel_size": 0.6, "attention_radius": 3.0, "pos_embed_dim": 16,
           "context_pos_embed": True, "condition": ["object", "tint"]}
TOLERANCE = {"fp32": 1e-4, "fp16": 1e-2}


def random_weights(model):
    """values that fp16 holds exactly, of a size that lets every layer be heard"""
    random = torch.Generator().manual_seed(5)
    for name, p in model.named_parameters():
        scale = 0.05 if p.dim() == 1 else (2.0 if "condition" in name else 0.7) / p.shape[1] ** 0.5
        p.data = (torch.randn(p.shape, generator=random) * scale).half().float()


def condition_of(centers, labels):
    """[B, N, 64]: in each set two boxes of the commonest class, one with a colour; others have no conditions"""
    random, rows = np.random.default_rng(5), []
    for places, of_cells in zip(centers.numpy().astype(np.float64), labels.numpy()):
        common = np.bincount(of_cells).argmax()
        middles = places[of_cells == common][[0, -1]]
        boxes = np.concatenate([middles + [0.2, -0.1, 0.3], [[4.3, 1.8, 1.5], [3.0, 2.5, 2.0]], [[0.4], [-2.0]]], 1)
        owners = owners_of(places, of_cells, boxes, np.array([common] * 2))
        tints = random.random((2, 3))[owners]
        rows.append(vector_of(NETWORK["condition"], places, boxes[owners], owners >= 0, tints, owners == 1))
    return torch.from_numpy(np.stack(rows))


def make(name, voxels):
    network = {**NETWORK, "attention_head_dim": 16, "condition_voxels": True} if voxels else NETWORK
    _, given = golden.read_case("transformer_tiny")
    inputs = {name: t for name, t in given.items() if name.startswith("input.")}
    model = VoxfieldTransformer(**network).eval()
    random_weights(model)
    labels = inputs["input.labels"].long()
    inputs["input.condition"] = condition_of(inputs["input.centers"], labels)
    with torch.no_grad():
        made = model(inputs["input.tokens"], labels, inputs["input.centers"], inputs["input.valid"].bool(),
                     inputs["input.timestep"], inputs["input.condition"])
    folder = os.path.join(golden.FOLDER, name)
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, "case.json"), "w") as file:
        json.dump({"kind": "voxfield_transformer", "note": "by tools/train/tests/make_golden.py: rows with valid 0 are "
                   "padding; input.condition as docs/method.md 2.1 has it", "params": {}, "model": "model",
                   "tolerance": TOLERANCE}, file, indent=1)
        file.write("\n")
    safetensors_file.write(os.path.join(folder, "tensors.safetensors"), {**inputs, "expect.sample": made})
    write_component(os.path.join(folder, "model"), {"_class_name": "VoxfieldTransformer", **network,
                                                    "prediction_type": "sample"}, model.state_dict())


def make_sampling():
    case, given = golden.read_case("sampling_ddpm")
    inputs = {name: t for name, t in given.items() if name.startswith("input.")}
    scheduler = {name: case["params"][name] for name in ("num_train_timesteps", "beta_schedule", "beta_start", "beta_end")}
    scheduler.update(timestep_spacing="quadratic", variance_type="analytic",
                     prediction_errors=[[0, 0.0, 0.001], [500, 0.001, 0.07], [999, 0.002, 0.1]])
    steps = steps_of({"_class_name": "DDPMScheduler", **scheduler}, 4)
    inputs["input.noise"] = inputs["input.noise"][:4].clone()
    model, x = golden.load_network(lambda config: VoxfieldTransformer(**network_of(config)), "sampling_ddpm"), \
        inputs["input.noise_initial"]
    labels, centers, valid = inputs["input.labels"].long(), inputs["input.centers"], inputs["input.valid"].bool()
    for (t, of_x0, of_x, fresh), noise in zip(zip(*steps), inputs["input.noise"]):
        with torch.no_grad():
            x0 = model(x, labels, centers, valid, t[None]).clamp(-1, 1)
        x = of_x0 * x0 + of_x * x + (noise.unflatten(2, (-1, 2, 3)) * fresh[:, None]).flatten(2)
    folder = os.path.join(golden.FOLDER, "sampling_distilled")
    os.makedirs(folder, exist_ok=True)
    params = {"sampler": "ddpm", "steps": 4, "guidance_scale": 1.0, **scheduler, "clip_sample": True,
              "timesteps": steps.timesteps.tolist()}
    with open(os.path.join(folder, "case.json"), "w") as file:
        json.dump({"kind": "voxfield_sampling", "note": "by tools/train/tests/make_golden.py: one pass a step",
                   "params": params, "model": "../sampling_ddpm/model", "tolerance": case["tolerance"]}, file, indent=1)
        file.write("\n")
    safetensors_file.write(os.path.join(folder, "tensors.safetensors"), {**inputs, "expect.sample": x})


def main():
    for name, voxels in NAMES.items():
        make(name, voxels)
    make_sampling()


if __name__ == "__main__":
    main()
