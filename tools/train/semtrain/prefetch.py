# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Batches made ahead of time by other processes, for a device that trains faster than one process draws sets."""
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

_sets = None  # of a worker


def _keep(sets):
    global _sets
    _sets = sets


def _batch(step, part):
    return _sets.batch(step, part)


class Prefetched:
    """`sets`, anything that has batch(step, part) and gives NumPy arrays, with the batches of the steps to come under
    way"""

    def __init__(self, sets, workers):
        self.sets, self.ahead, self.coming = sets, 2 * workers, {}
        self.pool = ProcessPoolExecutor(workers, multiprocessing.get_context("fork"), _keep, (sets,)) if workers else None

    def batch(self, step, part=None):
        if not self.pool:
            return self.sets.batch(step, part)
        for later in range(step, step + self.ahead):
            if (later, part) not in self.coming:
                self.coming[later, part] = self.pool.submit(_batch, later, part)
        return self.coming.pop((step, part)).result()
