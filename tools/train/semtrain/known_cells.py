# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Voxels of a training set that are given, as where a region borders on what has been generated before."""
import numpy as np


def draw_known(random, cells, share):
    """cells [N, 3] -> bool [N]: in `share` of the sets those on one side of a plane or, in every third of these, those
    outside of a ball; a tenth of the set at least and nine tenths at most. In the others none."""
    known = np.zeros(len(cells), bool)
    if random.random() >= share:
        return known
    if random.random() < 1 / 3:
        distance = np.linalg.norm(cells - cells[random.integers(len(cells))], axis=1)
    else:
        direction = random.normal(size=3) * (1, 1, 0.5)  # a front moves along a street more often than up a wall
        distance = cells @ direction
    count = int(random.uniform(0.1, 0.9) * len(cells))
    known[np.argsort(distance)[len(cells) - count:]] = True
    return known
