# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What a transformer is conditioned on beside a voxel's label (docs/method.md §2.1): where it lies in the box of its
object, a colour, and where it lies in the box of a part, a window. What is not given is zeros, and its flag is 0."""
import math

import numpy as np

from .objects import has_box, place_in

WIDTHS = {"object": 60, "tint": 4, "part": 64}
WAVES = (1.0, 2.0, 4.0, 8.0)  # metres
NEAREST, FARTHEST = -2.0, 8.0  # metres from a face, beyond which a voxel is taken to lie there


def width_of(condition):
    """numbers of a voxel, for a list of parts"""
    return sum(WIDTHS[part] for part in condition)


def object_part(centers, boxes, given):
    """centers [N, 3] metres, boxes [N, 7] (centre, size, heading), given bool [N] -> f32 [N, 60]: a flag; distances
    from front, back, left, right, top and bottom in units of 4 m; sines and cosines of these; size; sine and cosine of
    the heading"""
    boxes = np.where(given[:, None], boxes, np.ones(7))
    place, half = place_in(boxes, centers), boxes[:, 3:6] / 2
    faces = np.stack([half - place, half + place], -1).reshape(-1, 6).clip(NEAREST, FARTHEST)
    waves = (faces[:, :, None] * (2 * math.pi / np.array(WAVES))).reshape(-1, 24)
    size = np.log2(boxes[:, 3:6].clip(1 / 16, 64)) / 4
    heading = boxes[:, 6:]
    parts = [np.ones((len(boxes), 1)), faces / 4, np.sin(waves), np.cos(waves), size, np.sin(heading), np.cos(heading)]
    return np.where(given[:, None], np.concatenate(parts, 1), 0).astype(np.float32)


def tint_part(tints, given):
    """tints [N, 3], 0..1, given bool [N] -> f32 [N, 4]: a flag; the colour in -1..1"""
    tints = np.where(given[:, None], tints, 0)
    return np.where(given[:, None], np.concatenate([np.ones((len(tints), 1)), 2 * tints - 1], 1), 0).astype(np.float32)


def vector_of(condition, centers, boxes, has_box, tints, has_tint, of_part=None):
    """what `condition` lists for N voxels, in its order; of_part: the same four of the parts that they lie in or beside,
    needed where "part" is listed -> f32 [N, width_of(condition)]"""
    def both(boxes, has_box, tints, has_tint):
        return np.concatenate([object_part(centers, boxes, has_box), tint_part(tints, has_tint)], 1)
    parts = {"object": lambda: object_part(centers, boxes, has_box), "tint": lambda: tint_part(tints, has_tint),
             "part": lambda: both(*of_part)}
    return np.concatenate([np.zeros((len(centers), 0), np.float32)] + [parts[name]() for name in condition], 1)


def mirrored(boxes, axis):
    """boxes [N, 7] of a world whose x (axis 0) or y (axis 1) is turned over"""
    boxes = boxes.copy()
    boxes[:, axis] *= -1
    boxes[:, 6] = (math.pi if axis == 0 else 0) - boxes[:, 6]
    return boxes


def share_given(random, config):
    """of the objects or voxels of a set: none with a chance of `dropout`; else all, but with a chance of `partial` any
    share"""
    if random.random() < config["dropout"]:
        return 0.0
    return random.random() if random.random() < config["partial"] else 1.0


def given_boxes(random, owners, labels, config):
    """which voxels are given the box of their object -> bool [N]; an object is given as a whole"""
    _, of_cells = np.unique(owners, return_inverse=True)
    share = share_given(random, config)
    return has_box(owners, labels) & (random.random(of_cells.max() + 1) < share)[of_cells]


def given_parts(random, parts, config):
    """which voxels are given the part that they lie in or beside -> bool [N]; a part is given as a whole"""
    _, of_cells = np.unique(parts, return_inverse=True)
    share = share_given(random, config)
    return (parts >= 0) & (random.random(of_cells.max() + 1) < share)[of_cells]


def given_tints(random, owners, config):
    """which voxels are given a colour -> bool [N]"""
    share = share_given(random, config)
    return (owners >= 0) & (random.random(len(owners)) < share)


def drawn_boxes(random, owners, boxes, config):
    """boxes [N, 7] as somebody might give them: exact or, in every other set, each object's off by `jitter` metres in
    place and size, and by a little in heading"""
    if not config["jitter"] or random.random() < 0.5:
        return boxes
    _, of_cells = np.unique(owners, return_inverse=True)
    off = random.normal(0, 1, (of_cells.max() + 1, 7)) * [*[config["jitter"]] * 6, 0.04]
    boxes = boxes + off[of_cells]
    boxes[:, 3:6] = boxes[:, 3:6].clip(0.1)
    return boxes


def drawn_tints(random, owners, local, whole, config):
    """colours 0..1 as somebody might give them: of the whole object or, with a chance of `local`, those near the voxel;
    each object's off by `noise`"""
    tints = (local if random.random() < config["local"] else whole).astype(np.float64)
    _, of_cells = np.unique(owners, return_inverse=True)
    off = random.normal(0, config["noise"], (of_cells.max() + 1, 3))[of_cells]
    return (tints + off).clip(0, 1)
