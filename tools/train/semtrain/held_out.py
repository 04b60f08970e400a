# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Squared errors of transformers on streets that they were not trained on, at three noise levels, nothing known, with
labels alone and with what else each can be conditioned on: a table in Markdown. All see the same sets and noise."""
import argparse
import os
import tempfile

import torch

from .condition import WIDTHS
from .draws import draws
from .grids import Grids, LocalSets
from .precision import autocast
from .regenerate import load_transformer
from .sampler import linear_alphas
from .transformer import mean_error, noised

LEVELS = (200, 600, 999)
CONFIG = {"seed": 1, "batch": 8, "label_dropout": 0, "class_balance": 0.35, "mirror": False, "ordered_points": True,
          "known_share": 0, "telling": {"dropout": 0, "partial": 0, "local": 0, "noise": 0, "jitter": 0, "repaint": 0},
          "num_train_timesteps": 1000, "beta_start": 1e-4, "beta_end": 0.02}


def only_given(conditions, parts, given):
    """conditions [B, N, W] of a model that takes `parts`, only those of `given` left"""
    kept, at = conditions.clone(), 0
    for part in parts:
        if part not in given:
            kept[..., at:at + WIDTHS[part]] = 0
        at += WIDTHS[part]
    return kept


@torch.no_grad()
def errors_of(model, sets, batches, given, levels=LEVELS):
    """-> [(places, colours) of each level]"""
    alphas, sums = linear_alphas(CONFIG), torch.zeros(len(levels), 2)
    for step in range(batches):
        centers, labels, x0, known, conditions = (torch.from_numpy(a) for a in sets.batch(step))
        valid, parts = torch.ones_like(known), model.config["condition"]
        for i, level in enumerate(levels):
            t = torch.full((len(x0),), level)
            noisy = noised(x0, alphas, t, draws(CONFIG, step, i))
            with autocast("bf16", "cpu"):
                made = model(noisy, labels, centers, valid, t, only_given(conditions, parts, given))
            sums[i] += torch.stack([e.mean() for e in mean_error(made.float(), x0, ~known)]) / batches
    return sums.tolist()


def choices(parts):
    """what is given, from nothing to everything"""
    return [(), *((part,) for part in parts if len(parts) > 1), *([tuple(parts)] if parts else [])]


def main(arguments=None):
    p = argparse.ArgumentParser(prog="tools/train/run held_out", description=__doc__)
    p.add_argument("--grids", nargs="+", required=True, help=".sgrid files with points, or folders of them")
    p.add_argument("--model", action="append", required=True, metavar="NAME=FOLDER",
                   help="a voxfield_transformer folder")
    p.add_argument("--batches", type=int, default=6, help="of 8 sets")
    p.add_argument("--cells", type=int, default=128, help="of a set")
    p.add_argument("--threads", type=int, default=0, help="of the CPU; 0: all")
    options = p.parse_args(arguments)
    torch.set_num_threads(options.threads or os.cpu_count())
    head = ["model", "given", *(f"{what}, t = {t}" for what in ("places", "colours") for t in LEVELS)]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    with tempfile.TemporaryDirectory() as cache:
        grids = Grids(options.grids, cache)
        for name, folder in (item.split("=", 1) for item in options.model):
            model = load_transformer(folder)
            config = {**CONFIG, "set_size": [options.cells] * 2, "network": model.config}
            sets = LocalSets(grids, config)
            for given in choices(model.config["condition"]):
                errors = errors_of(model, sets, options.batches, given)
                row = [name, " and ".join(given) or "labels", *(f"{e[i]:.4f}" for i in range(2) for e in errors)]
                print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
