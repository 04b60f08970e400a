# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of drives: what the renderer knows (splat buffer, visibility) and what it should draw (the shaded truth).

A drive is a folder anywhere below the root, its frames numbered in the order in which they were driven:
    color/000000.png            the truth, RGB; .jpg and .jpeg, too
    buffer/color/000000.png     splats over black, RGB; likewise
    buffer/visible/000000.png   grey: 0 where there is no splat
    label/000000.png            class numbers, for `inception` alone
    used/000000.png             where it is there: 0 for pixels that `asd` and `vsd` are not trained on; `run logs`
                                leaves out what moves
    buffer/run.json             of `semrover render`: says how large the splats were
`semrover streets --images` writes the first and the labels, `semrover render GRID --path transforms.json -o buffer` the
others. Of a rig each camera is a drive: CAMERA/color, CAMERA/label, CAMERA/used, buffer/CAMERA/color,
buffer/CAMERA/visible. Any of these folders may be in a shard set.
"""
import os

import numpy as np
import torch
from PIL import Image

from .json_file import read_json
from .pictures import pictures_below



def picture_name(number):
    return f"{number:06d}.png"


class Drive:
    """One as above, or one camera's; a frame that lacks one of the three pictures is left out, and begins a new
    sequence. The arguments are {number: Picture}, and the folder that has run.json"""

    def __init__(self, folder, truths, buffers, visible, labels, used, of_buffers):
        self.folder, self.parts, self.of_buffers = folder, (truths, buffers, visible), of_buffers
        self.labels, self.of_used = labels, used
        self.numbers = sorted(set(truths) & set(buffers) & set(visible))

    def truth(self, number):
        """-> uint8 [3, H, W]"""
        return read_rgb(self.parts[0][number])

    def buffer(self, number):
        """-> uint8 [3, H, W]"""
        return read_rgb(self.parts[1][number])

    def visible(self, number):
        """-> float [1, H, W], 0 or 1"""
        return read_mask(self.parts[2][number])

    def used(self, number):
        """-> float [1, H, W], 0 or 1, or None: all"""
        return read_mask(self.of_used[number]) if number in self.of_used else None

    def used_truth(self, number):
        """`truth`, and the buffer where it is not used: a network that sees around a pixel sees nothing of what is left
        out"""
        used = self.used(number)
        return self.truth(number) if used is None else torch.where(used != 0, self.truth(number), self.buffer(number))

    def has_previous(self, number):
        return all(number - 1 in part for part in self.parts)

    def pictures(self, numbers):
        """the Pictures of these frames"""
        return [part[n] for part in (*self.parts, self.of_used) for n in numbers if n in part]

    def splat_radius(self):
        """of the buffers: "auto", metres, or None where nothing says it"""
        path = os.path.join(self.of_buffers, "run.json")
        run = read_json(path) if os.path.exists(path) else {}
        radius = run.get("settings", {}).get("drive", {}).get("splat_radius")
        return radius if radius in ("auto", None) else float(radius)


def find_drives(root):
    """all drives below root that have frames, sorted by path"""
    found, drives = pictures_below(root, ("color", "visible", "label", "used")), []
    for color in sorted(found, key=lambda path: path.split(os.sep)):
        folder, name = os.path.split(color)
        of_all, camera = os.path.split(folder)
        for of_buffers, inner in ((os.path.join(folder, "buffer"), ""), (os.path.join(of_all, "buffer"), camera)):
            buffers, visible = (found.get(os.path.join(of_buffers, inner, part)) for part in ("color", "visible"))
            if name == "color" and buffers and visible:
                labels, used = (found.get(os.path.join(folder, part), {}) for part in ("label", "used"))
                drives.append(Drive(folder, found[color], buffers, visible, labels, used, of_buffers))
                break
    drives = [drive for drive in drives if drive.numbers]
    if not drives:
        raise SystemExit(f"{root}: no frames; expected color/, buffer/color/ and buffer/visible/ with 000000.png, ... "
                         "in some folder (make them with tools/train/run drives), or CAMERA/color/, "
                         "buffer/CAMERA/color/ and buffer/CAMERA/visible/")
    return drives


def find_made_drives(root):
    """those of find_drives, which have to be as `run drives` writes them: PNG in folders, of one camera"""
    drives = find_drives(root)
    for drive in drives:
        for part, name in zip(drive.parts, ("color", "buffer/color", "buffer/visible")):
            for number in drive.numbers:
                path = os.path.join(drive.folder, name, picture_name(number))
                if part[number].file != path:
                    raise SystemExit(f"expected {path}, as `run drives` writes it, found {part[number].file}")
    return drives


def splats_of(drives, defaults):
    """defaults of a renderer, with the splat_radius that the drives' buffers were drawn with: what it is trained on is
    what it has to see"""
    first, radius = drives[0], drives[0].splat_radius()
    for other in drives:
        if other.splat_radius() != radius:
            raise SystemExit(
                f"buffers of two kinds: {first.folder} was drawn with splat_radius {radius or 'unknown'}, {other.folder} "
                f"with {other.splat_radius() or 'unknown'} (buffer/run.json says it). Draw one of them again")
    if radius is None:
        print(f"{first.folder}: no buffer/run.json says with which --splat-radius the buffers were drawn; the model will say "
              f"{defaults.get('splat_radius', 'nothing, which is 0.04')}", flush=True)
        return defaults
    return {**defaults, "splat_radius": radius}


def read_rgb(picture):
    """of a Picture -> uint8 [3, H, W]"""
    with picture.open() as image:
        return torch.from_numpy(np.array(image.convert("RGB"))).permute(2, 0, 1).contiguous()


def read_mask(picture):
    """of a Picture -> float [1, H, W]: 0 where it is black, else 1"""
    with picture.open() as image:
        return torch.from_numpy(np.array(image.convert("L")) != 0).float()[None]


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
