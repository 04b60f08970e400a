# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Drives once more with rougher buffers: of points as a trained transformer places them (--transformer), or off their
surfaces and washed out at random. A renderer that has seen only buffers of true points keeps every flaw of generated ones."""
import argparse
import itertools
import os

import numpy as np
import torch

from . import safetensors_file
from .content import digest_of_folder, keep_made_of
from .drives import make_buffers
from .frames import find_made_drives
from .regenerate import load_transformer, regenerate


def roughened(tensors, half, random):
    """points moved by up to 2.5 cm (standard deviation) and kept inside their voxels of half size `half`; colours drawn
    towards their voxel's mean; voxels, and points, a little off in colour. How much of all that is drawn at random."""
    points, colors = tensors["points"].numpy().astype(np.float32), tensors["colors"].numpy().astype(np.float32)
    cells = len(points)
    strength = random.random()
    points = points + random.normal(size=points.shape) * 0.025 * strength
    mean = colors.mean(1, keepdims=True)
    colors = mean + (colors - mean) * (1 - 0.7 * strength * random.random((cells, 1, 1)))
    colors += random.normal(size=(cells, 1, 3)) * 8 * strength + random.normal(size=colors.shape) * 10 * strength
    return {**tensors, "points": torch.from_numpy(points.clip(-half, half).astype(np.float16)),
            "colors": torch.from_numpy(colors.round().clip(0, 255).astype(np.uint8))}


def write_rough(path, output, seed, transformer=None):
    metadata = safetensors_file.read_header(path)[1]
    if transformer:
        tensors = regenerate(transformer, path, seed)
    else:
        tensors = roughened(safetensors_file.read(path), float(metadata["voxel_size"]) / 2, np.random.default_rng(seed))
    safetensors_file.write(output, tensors, metadata)


def render_rough(drive, grid, folder, splat_radius):
    """FOLDER/buffer as in DRIVE but of another grid, FOLDER/color a link to DRIVE's"""
    os.makedirs(folder, exist_ok=True)
    link = os.path.join(folder, "color")
    if not os.path.islink(link):
        os.symlink(os.path.abspath(os.path.join(drive.folder, "color")), link)
    height, width = drive.truth(drive.numbers[0]).shape[1:]
    make_buffers(grid, drive.folder, folder, (width, height), splat_radius)


def main():
    p = argparse.ArgumentParser(prog="tools/train/run roughen", description=__doc__)
    p.add_argument("-o", "--output", required=True, help="folder; its drives go to `run asd --frames` beside the others")
    p.add_argument("--frames", required=True, help="folder of SEED/..., as `run drives` writes it")
    p.add_argument("--streets", required=True, help="folder of SEED/truth.sgrid")
    p.add_argument("--transformer", help="voxfield_transformer folder whose points these should be like")
    p.add_argument("--splat-radius", default="auto", help="of the buffers, as `semrover render` takes it")
    options = p.parse_args()
    transformer = load_transformer(options.transformer) if options.transformer else None
    keep_made_of(options.output, {
        "transformer": digest_of_folder(options.transformer) if options.transformer else "none",
        "splat_radius": options.splat_radius})

    def name_of(drive):
        return os.path.relpath(drive.folder, options.frames)

    def is_left(drive):
        return not os.path.exists(os.path.join(options.output, name_of(drive), "buffer", "color"))

    left = filter(is_left, find_made_drives(options.frames))
    for seed, drives in itertools.groupby(left, lambda drive: name_of(drive).split(os.sep)[0]):
        grid = os.path.join(options.output, seed + ".sgrid")  # for all drives of the street
        write_rough(os.path.join(options.streets, seed, "truth.sgrid"), grid, int(seed), transformer)
        for drive in drives:
            folder = os.path.join(options.output, name_of(drive))
            render_rough(drive, grid, folder, options.splat_radius)
            print(folder, flush=True)
        os.remove(grid)


if __name__ == "__main__":
    main()
