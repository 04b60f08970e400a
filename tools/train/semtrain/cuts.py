# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Pieces of streets: the voxels of a grid in a slab across it, or in a part of one, as a true and as a semantic grid.
Small enough to generate with many settings."""
import argparse
import math
import os
import shutil

import torch

from . import safetensors_file
from .grids import find_grids


def cut_grid(path, folder, along, across):
    """voxels whose centres lie within along = (low, high) metres of x, and within across of y
    -> FOLDER/truth/NAME.sgrid, FOLDER/semantic/NAME.sgrid; NAME is that of the grid's folder. The street's objects and
    labels go whole to FOLDER/objects/NAME.json and FOLDER/street/NAME.sgrid"""
    tensors, metadata = safetensors_file.read(path), safetensors_file.read_header(path)[1]
    centers = (tensors["cells"][:, :2].double() + 0.5) * float(metadata["voxel_size"])
    low, high = torch.tensor([along, across], dtype=torch.float64).T
    chosen = ((centers >= low) & (centers < high)).all(1).nonzero()[:, 0]
    name = os.path.basename(os.path.dirname(os.path.abspath(path))) + ".sgrid"
    for kind, names in (("truth", list(tensors)), ("semantic", ["cells", "labels"])):
        os.makedirs(os.path.join(folder, kind), exist_ok=True)
        safetensors_file.write(os.path.join(folder, kind, name), {n: tensors[n][chosen] for n in names}, metadata)
    for source, kind in (("objects.json", "objects"), ("semantic.sgrid", "street")):
        beside = os.path.join(os.path.dirname(os.path.abspath(path)), source)
        if os.path.exists(beside):
            os.makedirs(os.path.join(folder, kind), exist_ok=True)
            shutil.copy(beside, os.path.join(folder, kind, os.path.splitext(name)[0] + os.path.splitext(source)[1]))
    return len(chosen)


def main():
    p = argparse.ArgumentParser(prog="tools/train/run cuts", description=__doc__)
    p.add_argument("grids", nargs="+", help="grids with points, or folders of them")
    p.add_argument("-o", "--output", required=True, help="folder")
    p.add_argument("--low", type=float, required=True, help="metres, where the slab begins along x")
    p.add_argument("--high", type=float, required=True, help="metres, where it ends")
    p.add_argument("--right", type=float, default=-math.inf, help="metres, where it begins along y")
    p.add_argument("--left", type=float, default=math.inf, help="metres, where it ends")
    options = p.parse_args()
    for path in find_grids(options.grids):
        count = cut_grid(path, options.output, (options.low, options.high), (options.right, options.left))
        print(path, count, "cells", flush=True)


if __name__ == "__main__":
    main()
