# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Settings of a recipe: configs/RECIPE.NAME.json, overridden on the command line by --set key=value."""
import argparse
import json
import os

import torch

from . import processes
from .model_folder import HALF_BITS

CONFIGS = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "configs")
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
COMMON = {"seed": 1, "precision": "bf16", "device": DEVICE, "minutes": 0.0,
          "save_minutes": 10.0, "workers": 0, "warmup": 200, "decay": 0.3, "ema": 0.999, "clip": 1.0,
          "betas": [0.9, 0.99], "examples": 0,
          "mantissa_bits": HALF_BITS, "accumulate": 1, "recompute": False, "keep": 1, "tensorboard": False,
          "encode_batch": 8 if DEVICE == "cuda" else 1}  # a CPU spends more than it saves on the memory of larger ones


def parser(recipe, about):
    p = argparse.ArgumentParser(prog=f"tools/train/run {recipe}", description=about)
    p.add_argument("-o", "--output", required=True, help="folder of the run; one that exists is continued")
    p.add_argument("--config", default="paper", help=f"configs/{recipe}.NAME.json: paper, small, or a file")
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a setting in place of the file's")
    p.add_argument("--threads", type=int, default=0, help="of the CPU; 0: all")
    return p


def resolve(recipe, options):
    """the settings of a run: COMMON, then the file, then --set. A misspelt key is an error. The process joins those
    that train with it."""
    path = options.config
    if not path.endswith(".json"):
        path = os.path.join(CONFIGS, f"{recipe}.{options.config}.json")
    with open(path) as file:
        config = {**COMMON, **json.load(file)}
    for item in options.set:
        key, _, text = item.partition("=")
        if key not in config:
            raise SystemExit(f"--set {item}: {recipe} has no setting {key}; it has {', '.join(sorted(config))}")
        try:
            config[key] = json.loads(text)
        except json.JSONDecodeError:
            config[key] = text
    bits = config["mantissa_bits"]
    if not isinstance(bits, int) or bits not in range(1, HALF_BITS + 1):
        raise SystemExit(f"mantissa_bits: expected a whole number from 1 to {HALF_BITS}, found {bits}")
    for name in ("accumulate", "keep", "encode_batch"):
        if not isinstance(config[name], int) or config[name] < 1:
            raise SystemExit(f"{name}: expected a whole number from 1, found {config[name]}")
    use_threads(options.threads)
    processes.join(config["device"])
    return config


def use_threads(count):
    """of the CPU, 0: $OMP_NUM_THREADS, or as many as there are"""
    torch.set_num_threads(count or int(os.environ.get("OMP_NUM_THREADS", 0)) or os.cpu_count())
