# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Objects of a scene (docs/formats.md §2.8): which voxels are theirs, and which colours these have."""
import os

import numpy as np

from .json_file import read_json

CLASSES = ("road", "sidewalk", "building", "wall", "fence", "pole", "traffic light", "traffic sign", "vegetation",
           "terrain", "sky", "person", "rider", "car", "truck", "bus", "train", "motorcycle", "bicycle", "road-lane")
GROUND = tuple(CLASSES.index(name) for name in ("road", "sidewalk", "terrain", "road-lane"))  # given colours, no boxes
BOX_REACH = 1.5   # metres by which boxes are widened: balconies and mirrors stand out of them
PART_REACH = 0.6  # metres by which the boxes of parts are: what lies beside a window sees its edge
TINT_REACH = 3.0  # metres within which the points of an object make a local tint


def read_objects(path, parts=False):
    """objects or, if asked for, the parts of objects -> boxes f64 [O, 7] (centre, size, heading), labels i64 [O], tints
    f32 [O, 3], 0..1, NaN where there is none"""
    about = read_json(path)
    if about.get("format") != "semrover.objects" or about.get("version") != 1:
        raise SystemExit(f"{path}: not a file of objects, version 1")
    objects = [o for o in about["objects"] if o.get("part", False) == parts]
    boxes = [[*o["center"], *o["size"], o["heading"]] for o in objects]
    tints = [tint_of(o.get("tint")) for o in objects]
    return (np.array(boxes, np.float64).reshape(-1, 7),
            np.array([CLASSES.index(o["class"]) for o in objects], np.int64),
            np.array(tints, np.float32).reshape(-1, 3))


def tint_of(value):
    if value is None:
        return [np.nan] * 3
    if isinstance(value, str):
        return [int(value[i:i + 2], 16) / 255 for i in (1, 3, 5)]
    return value


def place_in(boxes, points):
    """boxes [..., 7], points [..., 3] -> place in the box's axes, metres from its middle"""
    x, y, z = np.moveaxis(points - boxes[..., :3], -1, 0)
    c, s = np.cos(boxes[..., 6]), np.sin(boxes[..., 6])
    return np.stack([c * x + s * y, c * y - s * x, z], -1)


def owners_of(centers, labels, boxes, box_labels, reach=BOX_REACH):
    """centers [V, 3] metres -> i32 [V]: the object of its class in which each voxel lies deepest, among those whose
    widened box holds its centre; -1 for none. Of parts the reach is PART_REACH"""
    owners, depths = np.full(len(centers), -1, np.int32), np.full(len(centers), -reach)
    of_class = {label: np.flatnonzero(labels == label) for label in np.unique(box_labels)}
    for o, (box, label) in enumerate(zip(boxes, box_labels)):
        cells = of_class[label]
        depth = (box[3:6] / 2 - np.abs(place_in(box, centers[cells]))).min(1)
        deeper = depth > depths[cells]
        owners[cells[deeper]], depths[cells[deeper]] = o, depth[deeper]
    return owners


def objects_beside(grid):
    """the file of objects of a .sgrid, whether it is there or not"""
    return os.path.join(os.path.dirname(grid), "objects.json")


def owned(path, centers, labels, parts=False):
    """of the objects.json beside a .sgrid, if there is one, what its voxels are of, or which parts they lie in or beside
    -> owners i32 [V], boxes f64 [O, 7], tints f32 [O, 3]"""
    about = objects_beside(path)
    if not os.path.exists(about):
        return np.full(len(centers), -1, np.int32), np.zeros((0, 7)), np.zeros((0, 3), np.float32)
    boxes, of_boxes, tints = read_objects(about, parts)
    return owners_of(centers, labels, boxes, of_boxes, PART_REACH if parts else BOX_REACH), boxes, tints


def has_box(owners, labels):
    """which voxels can be given the box of their object -> bool [N]: the ground has none"""
    return (owners >= 0) & ~np.isin(labels, GROUND)


LUMA = np.array([2126, 7152, 722])  # of Rec. 709, times 10,000


def paint_near(centers, colors, reach, rows=256):
    """centers [n, 3], colors u8 [n, 3] -> u8 [n, 3]: median, channel by channel, of the lighter two fifths of the
    colours within reach of each: the engine's tint_objects, of a part of the object"""
    out = np.empty_like(colors)
    light = colors @ LUMA
    by_light, orders = light.argsort(kind="stable"), colors.argsort(0, kind="stable")
    for first in range(0, len(centers), rows):
        apart = ((centers[first:first + rows, None] - centers[None]) ** 2).sum(-1)
        near = apart <= (reach + 1e-6) ** 2
        least = by_light[at_rank(near[:, by_light], near.sum(1) * 3 // 5 + 1)]
        near &= light >= light[least][:, None]
        for c in range(3):
            at = at_rank(near[:, orders[:, c]], (near.sum(1) + 1) // 2)
            out[first:first + rows, c] = colors[orders[at, c], c]
    return out


def at_rank(chosen, ranks):
    """chosen bool [R, n], ranks [R], from 1 -> [R]: where the one of that rank stands"""
    return (chosen.cumsum(1, dtype=np.int32) >= ranks[:, None]).argmax(1)


def local_tints(centers, owners, colors):
    """colors u8 [V, n, 3] of points -> u8 [V, 3]: for a voxel of an object the paint among the medians of the object's
    voxels within 3 m; 0 for others"""
    tints = np.zeros((len(centers), 3), np.uint8)
    order = np.argsort(owners, kind="stable")
    order = order[np.searchsorted(owners[order], 0):]
    for cells in np.split(order, np.flatnonzero(np.diff(owners[order])) + 1):
        if len(cells):
            middle = np.median(colors[cells], 1).astype(np.uint8)
            tints[cells] = paint_near(centers[cells].astype(np.float32), middle, TINT_REACH)
    return tints
