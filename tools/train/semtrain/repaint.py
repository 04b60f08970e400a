# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Things of a training set in other colours: a network that saw few blue houses learns what a condition of blue means.
Only the paint changes: windows, tyres and shadows are darker than it and stay."""
import colorsys

import numpy as np

from .objects import CLASSES, LUMA

PAINTED = [CLASSES.index(name) for name in
           ("road", "sidewalk", "building", "wall", "fence", "car", "truck", "bus", "train", "motorcycle")]
DARK, LIGHT = 0.45, 0.7  # of the paint's luma: below the one nothing changes, above the other everything


def luma(colors):
    return colors @ (LUMA / LUMA.sum())


def another_paint(random, paint):
    """[3], 0..1 -> a colour of any hue, about as light"""
    color = np.array(colorsys.hsv_to_rgb(random.random(), 0.8 * random.random(), 1.0))
    light = luma(paint) * random.uniform(0.7, 1.2)
    return (color * light / luma(color)).clip(0.02, 0.95)


def repainted(colors, paint, other):
    """colors [..., 3], 0..1, of an object with this paint -> with another"""
    share = ((luma(colors) / max(luma(paint), 0.02) - DARK) / (LIGHT - DARK)).clip(0, 1)[..., None]
    return (colors * (1 + share * (other / paint.clip(0.02) - 1))).clip(0, 1)


def repaint(random, chance, owners, labels, paints, *colors):
    """each painted object with this chance; owners, labels [N] of voxels, paints [N, 3], NaN where there is none -> the
    `colors`, each [N, ..., 3], as then"""
    colors = [c.copy() for c in colors]
    for owner in np.unique(owners[(owners >= 0) & np.isin(labels, PAINTED) & ~np.isnan(paints).any(1)]):
        if random.random() < chance:
            cells = np.flatnonzero(owners == owner)
            paint = paints[cells[0]]
            other = another_paint(random, paint)
            for c in colors:
                c[cells] = repainted(c[cells], paint, other)
    return colors
