# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import pathlib
import tempfile
import unittest

import numpy as np
import torch

from semtrain import safetensors_file
from semtrain.roughen import roughened, write_rough

HALF = 0.3


def street():
    random = torch.Generator().manual_seed(1)
    return {"cells": torch.zeros(40, 3, dtype=torch.int32),
            "points": ((torch.rand(40, 20, 3, generator=random) * 2 - 1) * HALF).half(),
            "colors": (torch.rand(40, 20, 3, generator=random) * 255).to(torch.uint8)}


class Roughening(unittest.TestCase):
    def test_points_move_a_little_and_stay_in_their_cells(self):
        before = street()
        for seed in range(5):
            after = roughened(before, HALF, np.random.default_rng(seed))
            self.assertLessEqual(float(after["points"].abs().max()), HALF + 1e-3)
            moved = (after["points"].float() - before["points"].float()).abs()
            self.assertLess(float(moved.max()), 0.025 * 6)
            self.assertGreater(float(moved.mean()), 0)
            self.assertTrue(torch.equal(after["cells"], before["cells"]))

    def test_colours_are_drawn_towards_the_mean_of_their_cell(self):
        before = street()
        spread = [float(roughened(before, HALF, np.random.default_rng(seed))["colors"].float().std(1).mean())
                  for seed in range(20)]
        own = float(before["colors"].float().std(1).mean())
        self.assertLess(np.mean(spread), 0.9 * own)
        self.assertGreater(min(spread), 0.2 * own)

    def test_the_same_seed_writes_the_same_file(self):
        with tempfile.TemporaryDirectory() as folder:
            path, a, b, c = (pathlib.Path(folder, name) for name in ("grid", "a", "b", "c"))
            safetensors_file.write(path, street(), {"voxel_size": "0.6"})
            write_rough(path, a, 7)
            write_rough(path, b, 7)
            write_rough(path, c, 8)
            contents = [file.read_bytes() for file in (a, b, c)]
            self.assertEqual(contents[0], contents[1])
            self.assertNotEqual(contents[0], contents[2])


if __name__ == "__main__":
    unittest.main()
