# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
import pathlib
import tempfile
import unittest

import numpy as np
import torch

from semtrain import safetensors_file
from semtrain.nets.transformer import VoxfieldTransformer
from semtrain.regenerate import ancestral_step, bisected, levels_between, regenerate
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


class Regenerating(unittest.TestCase):
    def test_sets_are_neighbours_and_hold_every_cell_once(self):
        cells = np.stack(np.meshgrid(np.arange(40), np.arange(6), np.arange(3)), -1).reshape(-1, 3)
        sets = bisected(cells, 100)
        self.assertEqual(sorted(np.concatenate(sets).tolist()), list(range(len(cells))))
        for chosen in sets:
            self.assertLessEqual(len(chosen), 100)
            self.assertLessEqual(float((cells[chosen].max(0) - cells[chosen].min(0)).max()), 10)

    def test_levels_fall_to_no_noise(self):
        self.assertEqual(levels_between(600, 3), [600, 400, 200, -1])

    def test_a_step_keeps_the_statistics_of_its_level(self):
        """with the true x0 at hand, x at level a becomes x at level b: mean sqrt(b) x0, variance 1 - b"""
        random = torch.Generator().manual_seed(1)
        a, b, x0 = torch.tensor(0.2), torch.tensor(0.7), torch.full((200000,), 0.5)
        x = a.sqrt() * x0 + (1 - a).sqrt() * torch.randn(x0.shape, generator=random)
        after = ancestral_step(x, x0, a, b, random)
        self.assertAlmostEqual(float(after.mean()), float(b.sqrt() * 0.5), delta=5e-3)
        self.assertAlmostEqual(float(after.var()), 0.3, delta=5e-3)

    def test_a_network_decides_what_comes_out(self):
        """one that says 0 always puts every point in the middle of its voxel, in grey; what is known of a street stays"""
        model = VoxfieldTransformer(1, 1, 8, 20, 20, 0.6, 3.0, 8).eval()
        model.start_at_zero()
        before = street()
        before["cells"] = torch.stack([torch.arange(40), torch.zeros(40), torch.zeros(40)], 1).int()
        before["labels"] = (torch.arange(40) % 20).to(torch.uint8)
        with tempfile.TemporaryDirectory() as folder:
            path, out = pathlib.Path(folder, "grid"), pathlib.Path(folder, "out")
            safetensors_file.write(path, before, {"voxel_size": "0.6"})
            after = regenerate(model, path, 3)
            write_rough(path, out, 3, model)
            written = safetensors_file.read(out)
        for name in ("cells", "labels"):
            self.assertTrue(torch.equal(after[name], before[name]), name)
        self.assertEqual(float(after["points"].abs().max()), 0)
        self.assertLessEqual(int((after["colors"].int() - 127).abs().max()), 1)
        for name, values in after.items():
            self.assertTrue(torch.equal(values, written[name]), name)


if __name__ == "__main__":
    unittest.main()
