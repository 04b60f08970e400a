# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Pieces of streets: the cells of a grid in a slab across it, as a true and as a semantic grid. Small enough to generate
with many settings."""
import argparse
import os

import numpy as np
import torch

from . import safetensors_file
from .grids import find_grids


def cut_grid(path, folder, low, high):
    """cells whose centres have low <= x < high metres -> FOLDER/truth/NAME.sgrid, FOLDER/semantic/NAME.sgrid; NAME is
    that of the grid's folder"""
    tensors, metadata = safetensors_file.read(path), safetensors_file.read_header(path)[1]
    x = (tensors["cells"][:, 0].double() + 0.5) * float(metadata["voxel_size"])
    chosen = torch.from_numpy(np.flatnonzero(((x >= low) & (x < high)).numpy()))
    name = os.path.basename(os.path.dirname(os.path.abspath(path))) + ".sgrid"
    for kind, names in (("truth", list(tensors)), ("semantic", ["cells", "labels"])):
        os.makedirs(os.path.join(folder, kind), exist_ok=True)
        safetensors_file.write(os.path.join(folder, kind, name), {n: tensors[n][chosen] for n in names}, metadata)
    return len(chosen)


def main():
    p = argparse.ArgumentParser(prog="tools/train/run cuts", description=__doc__)
    p.add_argument("grids", nargs="+", help="grids with points, or folders of them")
    p.add_argument("-o", "--output", required=True, help="folder")
    p.add_argument("--low", type=float, required=True, help="metres, where the slab begins along x")
    p.add_argument("--high", type=float, required=True, help="metres, where it ends")
    options = p.parse_args()
    for path in find_grids(options.grids):
        print(path, cut_grid(path, options.output, options.low, options.high), "cells", flush=True)


if __name__ == "__main__":
    main()
