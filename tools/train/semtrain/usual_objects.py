# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""How objects of a class usually are, for `objects` of a model's defaults (docs/models.md §8)."""
import os

import numpy as np

from .objects import CLASSES, GROUND, owners_of, place_in, read_objects

SAME = 0.3       # metres by which parts of one row, one column or one wall are off at most
HANGING = 0.3    # metres above the ground from which a part is a window, not a door


def largest_ground(boxes, labels, tints):
    """of each class of ground only the largest object that has a colour: the ground of a street that is not described
    has one colour, its lanes' rather than that of a cycle lane"""
    chosen, areas = ~np.isin(labels, GROUND), np.where(np.isnan(tints).any(1), 0, boxes[:, 3] * boxes[:, 4])
    for label in np.intersect1d(labels, GROUND):
        of_class = np.flatnonzero(labels == label)
        chosen[of_class[areas[of_class].argmax()]] = True
    return boxes[chosen], labels[chosen], tints[chosen]


def part_distances(boxes, bottoms):
    """boxes [P, 7] of the parts of one object, whose ground is at `bottoms` -> distances to the next beside, to the next
    above, and from the ground to the lowest that hang: three lists, metres"""
    beside, above, low = [], [], []
    for box, bottom in zip(boxes, bottoms):
        apart = place_in(box, boxes[:, :3])
        wall = (abs(apart[:, 0]) < SAME) & (abs(np.cos(boxes[:, 6] - box[6]) - 1) < 1e-3)
        row, column = wall & (abs(apart[:, 2]) < SAME), wall & (abs(apart[:, 1]) < SAME)
        beside += [d[d > SAME].min() for d in [abs(apart[row, 1])] if (d > SAME).any()]
        above += [d[d > SAME].min() for d in [apart[column, 2]] if (d > SAME).any()]
        hangs = box[2] - box[5] / 2 - bottom
        low += [hangs] if hangs > HANGING and not (apart[column, 2] < -SAME).any() else []
    return beside, above, low


def usual_parts(files):
    """{class: {size: median, pitch: medians of the distances to the next beside and above, low: median height of the
    lowest above the ground; metres}} and {class: colours [P, 3]} of the parts in some objects.json"""
    found = {}
    for path in files:
        boxes, labels, tints = read_objects(path, parts=True)
        wholes, whole_labels, _ = read_objects(path)
        owners = owners_of(boxes[:, :3], labels, wholes, whole_labels)
        for owner in np.unique(owners[owners >= 0]):
            own = owners == owner
            ground = wholes[owner, 2] - wholes[owner, 5] / 2
            to = found.setdefault(int(whole_labels[owner]), ([], [], [], [], []))
            for values, new in zip(to, (*part_distances(boxes[own], np.full(own.sum(), ground)), boxes[own, 3:6],
                                        tints[own])):
                values.extend(new)
    usual, colors = {}, {}
    for label, (beside, above, low, sizes, tints) in found.items():
        if beside and above and low:
            usual[label] = {"size": np.median(sizes, 0).round(2).tolist(),
                            "pitch": [round(float(np.median(d)), 2) for d in (beside, above)],
                            "low": round(float(np.median(low)), 2)}
            colors[label] = np.array(tints)[~np.isnan(tints).any(1)]
    return usual, colors


def drawn(tints, random, most):
    """colours [T, 3], 0..1 -> at most `most` of them as texts, #rrggbb"""
    levels = np.round(tints[random.permutation(len(tints))[:most]] * 255).astype(int)
    return ["#%02x%02x%02x" % tuple(level) for level in levels]


def usual_objects(grids, most=32, fewest=4):
    """Of the objects.json beside each of some .sgrid files: {class: {size: median in metres, tints: at most `most`
    colours, drawn from all, and what is usual of its parts}}, for `objects` of a model's defaults (docs/models.md §8).
    Classes with fewer than `fewest` objects are left out."""
    files = sorted({os.path.join(os.path.dirname(g), "objects.json") for g in grids})
    parts = [largest_ground(*read_objects(f)) for f in files if os.path.exists(f)]
    if not parts:
        return {}
    boxes, labels, tints = (np.concatenate(p) for p in zip(*parts))
    random, usual = np.random.default_rng(1), {}
    parts, part_tints = usual_parts([f for f in files if os.path.exists(f)])
    # the ground last: what is drawn for the others does not depend on whether a street has any
    for label in sorted(np.unique(labels), key=lambda label: (label in GROUND, label)):
        of_class = tints[(labels == label) & ~np.isnan(tints).any(1)]
        if (labels == label).sum() < fewest:
            continue
        usual[CLASSES[label]] = {"size": np.median(boxes[labels == label, 3:6], 0).round(2).tolist(),
                                 "tints": drawn(of_class, random, most)}
    for label in parts:
        if CLASSES[label] in usual:
            usual[CLASSES[label]]["parts"] = {**parts[label], "tints": drawn(part_tints[label], random, most)}
    return usual
