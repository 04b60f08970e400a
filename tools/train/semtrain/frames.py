# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of drives: what the renderer knows (splat buffer, visibility) and what it should draw (the shaded truth).

A drive is a folder anywhere below the root, its frames numbered in the order in which they were driven:
    color/000000.png            the truth, RGB
    buffer/color/000000.png     splats over black, RGB
    buffer/visible/000000.png   grey: 0 where there is no splat
    buffer/splats.json          how large the splats were, {"splat_radius": "auto" or metres}; `run drives` writes it
`semrover streets --images` writes the first, `semrover render GRID --path transforms.json -o buffer` the others.
"""
import os

import numpy as np
import torch
from PIL import Image

from .json_file import read_json

PARTS = ("color", "buffer/color", "buffer/visible")
SPLATS = "buffer/splats.json"


def picture_name(number):
    return f"{number:06d}.png"


class Drive:
    """A folder as above; a frame that lacks one of the three pictures is left out, and begins a new sequence."""

    def __init__(self, folder):
        self.folder = folder
        found = [set(_numbers(os.path.join(folder, part))) for part in PARTS]
        self.numbers = sorted(set.intersection(*found))

    def truth(self, number):
        """-> uint8 [3, H, W]"""
        return read_rgb(os.path.join(self.folder, "color", picture_name(number)))

    def buffer(self, number):
        """-> uint8 [3, H, W]"""
        return read_rgb(os.path.join(self.folder, "buffer", "color", picture_name(number)))

    def visible(self, number):
        """-> float [1, H, W], 0 or 1"""
        with Image.open(os.path.join(self.folder, "buffer", "visible", picture_name(number))) as image:
            return torch.from_numpy(np.array(image.convert("L")) != 0).float()[None]

    def has_previous(self, number):
        return number - 1 in self.numbers

    def pictures(self):
        """the files of all frames"""
        return [os.path.join(self.folder, part, picture_name(n)) for part in PARTS for n in self.numbers]

    def splat_radius(self):
        """of the buffers: "auto", metres, or None where nothing says it"""
        path = os.path.join(self.folder, SPLATS)
        return read_json(path)["splat_radius"] if os.path.exists(path) else None


def find_drives(root):
    """all drives below root that have frames, sorted by path"""
    drives = []
    for folder, folders, _ in os.walk(root, followlinks=True):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        if "color" in folders and os.path.isdir(os.path.join(folder, "buffer", "color")):
            drive = Drive(folder)
            if drive.numbers:
                drives.append(drive)
    if not drives:
        raise SystemExit(f"{root}: no frames; expected color/, buffer/color/ and buffer/visible/ with 000000.png, ... "
                         "in some folder (make them with tools/train/run drives)")
    return drives


def splats_of(drives, defaults):
    """defaults of a renderer, with the splat_radius that the drives' buffers were drawn with: what it is trained on is
    what it has to see"""
    first, radius = drives[0], drives[0].splat_radius()
    for other in drives:
        if other.splat_radius() != radius:
            raise SystemExit(
                f"buffers of two kinds: {first.folder} was drawn with splat_radius {radius or 'unknown'}, {other.folder} "
                f"with {other.splat_radius() or 'unknown'} ({SPLATS} says it). Draw one of them again, or write that "
                "file where you know the radius")
    if radius is None:
        print(f"{first.folder}: no {SPLATS} says with which --splat-radius the buffers were drawn; the model will say "
              f"{defaults.get('splat_radius', 'nothing, which is 0.04')}", flush=True)
        return defaults
    return {**defaults, "splat_radius": radius}


def read_rgb(path):
    """-> uint8 [3, H, W]"""
    with Image.open(path) as image:
        return torch.from_numpy(np.array(image.convert("RGB"))).permute(2, 0, 1).contiguous()


def to_floats(pixels):
    """0..255 -> -1..1, as the VAE wants them"""
    return pixels.float() / 127.5 - 1


def to_pixels(values):
    """-1..1 or beyond -> uint8"""
    return ((values.float() + 1) * 127.5).clamp(0, 255).round().to(torch.uint8)


def fill_blocks(image, block):
    """[..., H, W] -> both multiples of `block`, the last column and row repeated, as the engine does"""
    down, right = -image.shape[-2] % block, -image.shape[-1] % block
    image = torch.cat([image, image[..., -1:, :].expand(*image.shape[:-2], down, image.shape[-1])], -2)
    return torch.cat([image, image[..., -1:].expand(*image.shape[:-1], right)], -1)


def psnr(a, b):
    """of two uint8 pictures, dB"""
    error = (a.float() - b.float()).square().mean().item()
    return 10 * np.log10(255 ** 2 / max(error, 1e-10))


def write_beside(path, pictures):
    """uint8 [3, H, W] each, side by side"""
    Image.fromarray(torch.cat(pictures, 2).permute(1, 2, 0).contiguous().numpy()).save(path)


def _numbers(folder):
    if not os.path.isdir(folder):
        return []
    return [int(name[:-4]) for name in os.listdir(folder) if name.endswith(".png") and name[:-4].isdecimal()]
