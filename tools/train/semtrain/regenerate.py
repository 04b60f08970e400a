# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""A street as a trained transformer would have placed it: noise on the truth's tokens, up to a level at which the
street can still be seen, and denoised from there. What the transformer cannot draw is then wrong as it is in generated
streets. A model that is conditioned on objects and colours is given the street's own, and what it makes of an object
gets the object's mean colour: a car of another colour than its picture would teach a renderer to leave colours out of
account."""
import numpy as np
import torch

from .condition import vector_of
from .draws import Draws
from .grids import read_tokens
from .low_rank import FILE, merged, read_adapter
from .model_folder import read_component
from .nets.transformer import VoxfieldTransformer
from .objects import has_box, owned
from .precision import autocast
from .sampler import linear_alphas, posterior
from .transformer import noised

LEVELS = (250, 600)  # of 1000 timesteps, between which the noise of a street is drawn
STEPS = 6
MOST_CELLS = 160     # of a set
SETS = 8             # of a batch


def network_of(config):
    """a transformer's config.json -> the arguments of VoxfieldTransformer"""
    return {name: value for name, value in config.items()
            if not name.startswith("_") and name not in ("prediction_type", "placement")}


def load_transformer(folder, adapter=FILE):
    """-> VoxfieldTransformer of a voxfield_transformer folder, an adapter of it merged, evaluating"""
    config, state = read_component(folder)
    model = VoxfieldTransformer(**network_of(config))
    state = merged(state, read_adapter(folder, adapter))
    model.load_state_dict({name: t.float() for name, t in state.items()})
    return model.eval().requires_grad_(False)


def bisected(cells, most):
    """cells [V, 3] -> [indices] of sets of at most `most` neighbours, halved across their longest side"""
    def halves(chosen):
        if len(chosen) <= most:
            return [chosen]
        of_these = cells[chosen]
        along = of_these[:, np.argmax(of_these.max(0) - of_these.min(0))]
        order = np.argsort(along, kind="stable")
        return halves(chosen[order[:len(order) // 2]]) + halves(chosen[order[len(order) // 2:]])
    return halves(np.arange(len(cells)))


def levels_between(first, steps):
    """falling timesteps from `first`, -1 (no noise) after the last"""
    return [round(first * (steps - i) / steps) for i in range(steps)] + [-1]


def ancestral_step(x, x0, a, b, random):
    """DDPM's step (Ho et al. 2020) between any two levels: x at the share a of the signal's variance -> at b"""
    of_x0, of_x, variance = posterior(a, b)
    return of_x0 * x0 + of_x * x + variance.sqrt() * torch.randn(x.shape, generator=random)


def of_owners(owners, boxes, tints):
    """-> for each voxel the box of its owner, whether it has one, its colour, and whether it has one"""
    if not len(boxes):
        boxes, tints = np.ones((1, 7)), np.full((1, 3), np.nan)
    has, of_cells = owners >= 0, np.maximum(owners, 0)
    return boxes[of_cells], has, tints[of_cells], has & ~np.isnan(tints[of_cells]).any(1)


class Objects:
    """the objects.json beside a .sgrid, if there is one: owners i32 [V] of the voxels, -1 for none; boxes and tints"""

    def __init__(self, path, centers, labels):
        self.centers = centers
        self.owners, self.boxes, self.tints = owned(path, centers, labels)
        self.parts, self.part_boxes, self.part_tints = owned(path, centers, labels, parts=True)
        self.has_box = has_box(self.owners, labels)

    def conditions(self, parts):
        """boxes, and colours of whole objects -> f32 [V, W]"""
        boxes, _, tints, has_tint = of_owners(self.owners, self.boxes, self.tints)
        return vector_of(parts, self.centers, boxes, self.has_box, tints, has_tint,
                         of_owners(self.parts, self.part_boxes, self.part_tints))

    def keep_colors(self, made, true):
        """tokens [V, n, 6]: moves the colours that were made so that those of each object have the true mean"""
        for owner in np.unique(self.owners[self.owners >= 0]):
            cells = self.owners == owner
            made[cells, :, 3:] += true[cells, :, 3:].mean((0, 1)) - made[cells, :, 3:].mean((0, 1))


@torch.no_grad()
def regenerate(model, path, seed):
    """the .sgrid's voxels that have points -> {cells, labels, points, colors}, as the file has them"""
    cells, labels, tokens = read_tokens(path)
    size, n = model.config["voxel_size"], model.config["points_per_voxel"]
    objects = Objects(path, (cells + 0.5) * size, labels)
    conditions = objects.conditions(model.config["condition"])
    random = torch.Generator().manual_seed(seed)
    first = int(torch.randint(*LEVELS, (1,), generator=random))
    out, sets = np.empty(tokens.shape, np.float32), bisected(cells, MOST_CELLS)
    for i in range(0, len(sets), SETS):
        denoise_sets(model, sets[i:i + SETS], cells, labels, tokens, conditions, out, first, random)
    out = out.reshape(len(cells), n, 6)
    objects.keep_colors(out, tokens.astype(np.float32).reshape(out.shape))
    out = torch.from_numpy(out).clamp(-1, 1)
    return {"cells": torch.from_numpy(cells), "labels": torch.from_numpy(labels),
            "points": (out[..., :3] * (size / 2)).half(),
            "colors": ((out[..., 3:] + 1) * 127.5).round().to(torch.uint8)}


def denoise_sets(model, sets, cells, labels, tokens, conditions, out, first, random):
    """one batch of sets, from timestep `first` on -> written to out"""
    rows = np.stack([np.resize(s, MOST_CELLS) for s in sets])  # what fills a row is marked as not there
    valid = torch.stack([torch.arange(MOST_CELLS) < len(s) for s in sets])
    x0 = torch.from_numpy(tokens[rows].astype(np.float32))
    centers = torch.from_numpy((cells[rows] + 0.5) * model.config["voxel_size"])
    of_rows, conditions = torch.from_numpy(labels[rows].astype(np.int64)), torch.from_numpy(conditions[rows])
    alphas = linear_alphas({"beta_start": 1e-4, "beta_end": 0.02, "num_train_timesteps": 1000})
    levels = levels_between(first, STEPS)
    x = noised(x0, alphas, torch.full((len(x0),), first), Draws(random, len(x0)))
    for t, after in zip(levels, levels[1:]):
        with autocast("bf16", "cpu"):
            made = model(x, of_rows, centers, valid, torch.full((len(x),), t), conditions).float().clamp(-1, 1)
        x = made if after < 0 else ancestral_step(x, made, alphas[t], alphas[after], random)
    for s, made in zip(sets, x.numpy()):
        out[s] = made[:len(s)]
