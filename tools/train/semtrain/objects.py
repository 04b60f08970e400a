# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Objects of a scene (docs/formats.md §2.8): which cells are theirs, and which colours these have."""
import os

import numpy as np

from .json_file import read_json

CLASSES = ("road", "sidewalk", "building", "wall", "fence", "pole", "traffic light", "traffic sign", "vegetation",
           "terrain", "sky", "person", "rider", "car", "truck", "bus", "train", "motorcycle", "bicycle", "road-lane")
GROUND = tuple(CLASSES.index(name) for name in ("road", "sidewalk", "terrain", "road-lane"))  # told colours, no boxes
BOX_REACH = 1.5   # metres by which boxes are widened: balconies and mirrors stand out of them
TINT_REACH = 3.0  # metres within which the points of an object make a local tint


def read_objects(path):
    """-> boxes f64 [O, 7] (centre, size, heading), labels i64 [O], tints f32 [O, 3], 0..1, NaN where there is none"""
    about = read_json(path)
    if about.get("format") != "semrover.objects" or about.get("version") != 1:
        raise SystemExit(f"{path}: not a file of objects, version 1")
    boxes = [[*o["center"], *o["size"], o["heading"]] for o in about["objects"]]
    tints = [tint_of(o.get("tint")) for o in about["objects"]]
    return (np.array(boxes, np.float64).reshape(-1, 7),
            np.array([CLASSES.index(o["class"]) for o in about["objects"]], np.int64),
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


def owners_of(centers, labels, boxes, box_labels):
    """centers [V, 3] metres -> i32 [V]: the object of its class in which each cell lies deepest, among those whose
    widened box holds its centre; -1 for none"""
    owners, depths = np.full(len(centers), -1, np.int32), np.full(len(centers), -BOX_REACH)
    of_class = {label: np.flatnonzero(labels == label) for label in np.unique(box_labels)}
    for o, (box, label) in enumerate(zip(boxes, box_labels)):
        cells = of_class[label]
        depth = (box[3:6] / 2 - np.abs(place_in(box, centers[cells]))).min(1)
        deeper = depth > depths[cells]
        owners[cells[deeper]], depths[cells[deeper]] = o, depth[deeper]
    return owners


def has_box(owners, labels):
    """which cells can be told the box of their object -> bool [N]: the ground has none"""
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
    """colors u8 [V, n, 3] of points -> u8 [V, 3]: for a cell of an object the paint among the medians of the object's
    cells within 3 m; 0 for others"""
    tints = np.zeros((len(centers), 3), np.uint8)
    order = np.argsort(owners, kind="stable")
    order = order[np.searchsorted(owners[order], 0):]
    for cells in np.split(order, np.flatnonzero(np.diff(owners[order])) + 1):
        if len(cells):
            middle = np.median(colors[cells], 1).astype(np.uint8)
            tints[cells] = paint_near(centers[cells].astype(np.float32), middle, TINT_REACH)
    return tints


def largest_ground(boxes, labels, tints):
    """of each class of ground only the largest object that has a colour: the ground of a street that is not described
    has one colour, its lanes' rather than that of a cycle lane"""
    chosen, areas = ~np.isin(labels, GROUND), np.where(np.isnan(tints).any(1), 0, boxes[:, 3] * boxes[:, 4])
    for label in np.intersect1d(labels, GROUND):
        of_class = np.flatnonzero(labels == label)
        chosen[of_class[areas[of_class].argmax()]] = True
    return boxes[chosen], labels[chosen], tints[chosen]


def usual_objects(grids, most=32, fewest=4):
    """Of the objects.json beside each of some .sgrid files: {class: {size: median in metres, tints: at most `most`
    colours, drawn from all}}, for `objects` of a model's defaults (docs/models.md §8). Classes with fewer than `fewest`
    objects are left out."""
    files = sorted({os.path.join(os.path.dirname(g), "objects.json") for g in grids})
    parts = [largest_ground(*read_objects(f)) for f in files if os.path.exists(f)]
    if not parts:
        return {}
    boxes, labels, tints = (np.concatenate(p) for p in zip(*parts))
    random, usual = np.random.default_rng(1), {}
    # the ground last: what is drawn for the others does not depend on whether a street has any
    for label in sorted(np.unique(labels), key=lambda label: (label in GROUND, label)):
        of_class = tints[(labels == label) & ~np.isnan(tints).any(1)]
        if (labels == label).sum() < fewest:
            continue
        chosen = random.permutation(len(of_class))[:most]
        levels = np.round(of_class[chosen] * 255).astype(int)
        usual[CLASSES[label]] = {"size": np.median(boxes[labels == label, 3:6], 0).round(2).tolist(),
                                 "tints": ["#%02x%02x%02x" % tuple(level) for level in levels]}
    return usual
