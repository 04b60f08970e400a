# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""PointNet++: its geometry, its recipe, and that the engine computes the features that PyTorch does."""
import json
import os
import subprocess
import tempfile
import unittest

import numpy as np
import torch

from recipe import run_recipe
from semtrain import safetensors_file
from semtrain.nets.norms import batch_norms, measure_norms
from semtrain.nets.pointnet import Pointnet, ball_query, farthest_points
from semtrain.point_chunks import ChunkBatches, cut_chunks, read_points
from semtrain.pointnet import confusion, judge, read_network, write_network
from semtrain.program import engine_path

SEMROVER = engine_path()
TINY = {"inputs": ["xyz", "rgb", "normalized"], "chunk": 2.4, "points": 100, "min_points": 20, "pool": "max",
        "num_classes": 20, "layers": [{"npoint": 48, "radius": 0.4, "nsample": 8, "mlp": [16, 16]},
                                      {"npoint": 12, "radius": 0.9, "nsample": 8, "mlp": [16, 24]}],
        "decoder": [[16], [24, 16]], "head": 16}


def write_street(path, seed=0):
    """a floor of 16 x 12 voxels before a wall of 16 x 3, and poles in front of it; six points a voxel, a colour a class
    with noise"""
    random = np.random.default_rng(seed)
    floor = [(i, j, 0, 0) for i in range(-4, 12) for j in range(12)]
    wall = [(i, 12, k, 2) for i in range(-4, 12) for k in range(3)]
    poles = [(i, 4 * j + 2, 1, 5) for i in range(-4, 12, 4) for j in range(3)]
    poles += [(i, 2, 2, 5) for i in range(-4, 12, 4)]
    cells = np.array(floor + wall + poles, np.int32)
    cells = cells[random.permutation(len(cells))]  # in any order: who reads them sorts them
    points = random.uniform(-0.25, 0.25, (len(cells), 6, 3))
    points[cells[:, 3] == 0, :, 2] = 0
    points[cells[:, 3] == 2, :, 1] = 0
    points[cells[:, 3] == 5, :, :2] /= 4
    base = np.array([[90, 90, 90], [0, 0, 0], [180, 90, 60], [0, 0, 0], [0, 0, 0], [60, 60, 200]])[cells[:, 3]]
    colors = (base[:, None] + random.normal(0, 12, points.shape)).clip(0, 255)
    safetensors_file.write(path, {
        "cells": torch.from_numpy(cells[:, :3].copy()), "labels": torch.from_numpy(cells[:, 3].astype(np.uint8)),
        "points": torch.from_numpy(points.astype(np.float16)), "colors": torch.from_numpy(colors.astype(np.uint8)),
        "generated": torch.from_numpy((random.random(len(cells)) < 0.95).astype(np.uint8))},
        {"voxel_size": "0.6", "points_per_voxel": "6"})


def train(grid, output, steps, *more):
    return run_recipe("pointnet", output, "--grids", grid, "--set", "network=" + json.dumps(TINY), "--set", "batch=4",
                      "--set", "loss_points=100", "--set", "warmup=2", "--set", "precision=fp32", "--set",
                      "norm_batches=4", "--set", f"steps={steps}", *more)


def log_of(output):
    with open(os.path.join(output, "log.jsonl")) as file:
        return [json.loads(line) for line in file]


class TheGeometry(unittest.TestCase):
    def test_chooses_points_far_from_one_another_and_the_lower_index_of_equals(self):
        line = torch.tensor([[[x, 0, 0] for x in (1.0, 0, 2, 0, 1.5)], [[0, x, 0] for x in (0.0, 1, 2, 3, 8)]])
        self.assertEqual(farthest_points(line, 4).tolist(), [[0, 1, 2, 4], [0, 4, 3, 1]])

    def test_groups_the_first_points_in_their_order_and_repeats_the_first(self):
        points = torch.tensor([[[0.0, 0, 0], [3, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1], [3, 0, 2]]])
        groups = ball_query(points, torch.tensor([[[0.0, 0, 0], [3, 0, 0], [9, 9, 9]]]), 1.0, 3)
        self.assertEqual(groups.tolist(), [[[0, 2, 3], [1, 1, 1], [0, 0, 0]]])  # a distance of the radius is within it


class TheNetwork(unittest.TestCase):
    def test_has_the_names_and_shapes_that_the_engine_reads(self):
        state = Pointnet(TINY).state_dict()
        self.assertEqual(list(state["sa2.mlp_convs.1.weight"].shape), [24, 16, 1, 1])
        self.assertEqual(list(state["sa1.mlp_convs.0.weight"].shape), [16, 12, 1, 1])
        self.assertEqual(list(state["fp2.mlp_convs.0.weight"].shape), [24, 24 + 16, 1])
        for name in ("sa1.mlp_bns.0.running_var", "sa2.mlp_convs.0.bias", "fp1.mlp_bns.0.bias", "conv2.weight"):
            self.assertIn(name, state)

    def test_measures_the_statistics_that_its_norms_are_trained_with(self):
        torch.manual_seed(0)
        model = Pointnet(TINY)
        random = torch.Generator().manual_seed(1)
        positions = torch.rand(32, 100, 3, generator=random) * 2
        inputs = torch.rand(32, 100, 9, generator=random)
        model.train()
        trained = model(positions, inputs)
        measure_norms(model, [(positions, inputs)] * 3)
        self.assertFalse(any(norm.training for norm in batch_norms(model)))
        # the mean of equal batches is the batch; the variance is the unbiased one
        self.assertLess(float((model(positions, inputs) - trained).abs().max()), 0.02)
        self.assertEqual(int(model.bn1.num_batches_tracked), 3)


class TheRecipe(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.grid = os.path.join(self.folder.name, "a.sgrid")
        write_street(self.grid)

    def tearDown(self):
        self.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def test_draws_points_of_one_column_and_mirrors_and_turns_them(self):
        config = {"seed": 3, "batch": 16, "mirror": False, "turn": False, "network": TINY}
        plain = ChunkBatches([self.grid], self.path("cache"), config)
        everything, _, all_labels = read_points(self.grid)
        self.assertEqual(len(plain), len({tuple(c) for c in np.floor(everything[:, :2].astype(np.float64) / 2.4)}))
        positions, inputs, labels = plain.batch(0)
        self.assertTrue((positions == inputs[..., :3]).all())
        self.assertLessEqual(np.abs(positions[..., :2]).max(), 1.2001)
        self.assertTrue(((inputs[..., 6:] >= 0) & (inputs[..., 6:] <= 1)).all())
        self.assertTrue((plain.batch(0)[0] == positions).all())
        self.assertFalse((plain.batch(1)[0] == positions).all())
        weights = plain.class_weights(0.5)
        self.assertAlmostEqual(float(weights[all_labels].mean()), 1, places=4)
        self.assertAlmostEqual(weights[5] / weights[0], ((all_labels == 0).sum() / (all_labels == 5).sum()) ** 0.5, 3)
        other = ChunkBatches([self.grid], self.path("cache"), {**config, "mirror": True, "turn": True})
        shapes = set()
        for step in range(8):
            positions, inputs, labels = other.batch(step)
            self.assertTrue((positions == inputs[..., :3]).all())
            for own, label in zip(positions, labels):
                if (label == 2).any():  # of a wall one coordinate is the same everywhere
                    x, y, _ = own[label == 2].T
                    shapes.add(("x", x[0] > 0) if np.ptp(x) < 1e-5 else ("y", y[0] > 0))
        self.assertEqual(shapes, {("x", True), ("x", False), ("y", True), ("y", False)})

    def test_learns_a_street_by_heart_and_says_how_well(self):
        train(self.grid, self.path("run"), 60, "--heldout", self.grid, "--set", "learning_rate=0.01",
              "--set", "ema=0.8")
        self.assertLess(log_of(self.path("run"))[-1]["loss"], 1.5)  # the mean of all steps; the first are at ln 20
        with open(self.path("run/heldout.json")) as file:
            report = json.load(file)
        self.assertGreater(report["mean_iou"], 0.85)
        self.assertEqual(set(report["iou"]), {"0", "2", "5"})
        model = read_network(self.path("run/pointnet.safetensors"), TINY)
        self.assertEqual(judge(confusion(model, [self.grid], TINY, batch=3)), report)

    def test_goes_on_where_it_stopped(self):
        whole = train(self.grid, self.path("whole"), 6)
        # the decay of the learning rate looks at the last step: the first part is given the same one
        train(self.grid, self.path("parts"), 6, "--set", "minutes=0.000001")
        self.assertEqual(safetensors_file.read_header(self.path("parts/checkpoint.safetensors"))[1]["step"], "1")
        parts = train(self.grid, self.path("parts"), 6)
        self.assertEqual(set(whole), set(parts))
        for name, tensor in whole.items():
            self.assertTrue(torch.equal(tensor, parts[name]), name)
        exports = [safetensors_file.read(self.path(f"{run}/pointnet.safetensors")) for run in ("whole", "parts")]
        for name, tensor in exports[0].items():
            self.assertTrue(torch.equal(tensor, exports[1][name]), name)

    @unittest.skipUnless(os.access(SEMROVER, os.X_OK), f"{SEMROVER} is not built; $SEMROVER names another")
    def test_gives_features_that_are_those_of_the_engine(self):
        write_street(self.path("b.sgrid"), seed=1)
        for pool, seed in (("max", 0), ("mean", 5)):
            network = {**TINY, "pool": pool}
            torch.manual_seed(2)
            model = Pointnet(network)
            cuts = [cut_chunks(path, network, seed) for path in (self.grid, self.path("b.sgrid"))]
            sets = [(torch.from_numpy(positions), torch.from_numpy(inputs)) for positions, inputs, _, _ in cuts]
            self.assertLess(int(cuts[0][3].min()), network["points"])  # some columns have fewer points, some more
            self.assertEqual(int(cuts[0][3].max()), network["points"])
            measure_norms(model, sets)
            write_network(self.path("net"), network, model.state_dict())
            subprocess.run([SEMROVER, "eval", "f3d", self.grid, self.path("b.sgrid"), "--features",
                            self.path("net.safetensors"), "--save-features", self.path(f"kept-{pool}"), "--seed",
                            str(seed)], check=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            for name, (positions, inputs) in zip("ab", sets):
                engine = safetensors_file.read(self.path(f"kept-{pool}/{name}.safetensors"))["features"]
                with torch.no_grad():
                    own = model.describe(positions, inputs)
                self.assertEqual(engine.shape, own.shape)
                self.assertGreater(float(own.std(0).max()), 0.1)  # chunks differ
                self.assertLess(float((engine - own).abs().max() / own.abs().max()), 1e-4, (pool, name))


if __name__ == "__main__":
    unittest.main()
