# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The transformer's module against the golden cases, and its recipe from grids to a model that the engine generates
with."""
import json
import os
import subprocess
import tempfile
import unittest

import numpy as np
import torch
from scipy.spatial import cKDTree

import golden
from recipe import run_recipe
from semtrain import safetensors_file, settings
from semtrain.draws import Draws
from semtrain.grids import Grids, LocalSets, nearest, read_tokens
from semtrain.known_cells import draw_known
from semtrain.nets.transformer import CONFIG_FIELDS, VoxfieldTransformer
from semtrain.program import semrover_path
from semtrain.transformer import loss_of, mean_error, with_drift

TINY = ["--set", 'network={"num_layers": 2, "num_attention_heads": 2, "attention_head_dim": 16, "points_per_voxel": 4,'
        ' "num_classes": 20, "voxel_size": 0.6, "attention_radius": 3.0, "pos_embed_dim": 8, "context_pos_embed": true}',
        "--set", "batch=4", "--set", "set_size=[8,12]", "--set", "warmup=2", "--set", "precision=fp32"]


def from_config(config):
    return VoxfieldTransformer(**{name: value for name, value in config.items() if name in CONFIG_FIELDS})


def write_street(path, seed=0):
    """a floor of 6 x 6 voxels under a wall of 6 x 3, four points a voxel, one colour a class"""
    random = np.random.default_rng(seed)
    floor = [(i, j, 0) for i in range(6) for j in range(6)]
    wall = [(i, 6, k) for i in range(6) for k in range(3)]
    cells = np.array(sorted(floor + wall), np.int32)
    labels = np.where(cells[:, 1] == 6, 2, 0).astype(np.uint8)
    points = random.uniform(-0.3, 0.3, (len(cells), 4, 3)).astype(np.float16)
    colors = np.where(labels[:, None, None] == 2, 200, 60) + np.zeros((len(cells), 4, 3))
    safetensors_file.write(path, {"cells": torch.from_numpy(cells), "labels": torch.from_numpy(labels),
                                  "points": torch.from_numpy(points),
                                  "colors": torch.from_numpy(colors.astype(np.uint8)),
                                  "generated": torch.ones(len(cells), dtype=torch.uint8)},
                           {"voxel_size": "0.6", "points_per_voxel": "4"})


def train(grids, output, steps, *more):
    return run_recipe("transformer", output, "--grids", grids, *TINY, "--set", f"steps={steps}", *more)


class TheModule(unittest.TestCase):
    def test_gives_what_the_golden_cases_expect(self):
        for name in ("transformer_tiny", "transformer_wide", "transformer_objects", "transformer_voxels"):
            case, t = golden.read_case(name)
            model = golden.load_network(from_config, name)
            valid = t["input.valid"].bool()
            with torch.no_grad():
                got = model(t["input.tokens"], t["input.labels"].long(), t["input.centers"], valid, t["input.timestep"],
                            t.get("input.condition"))
            apart = golden.apart(got[valid], t["expect.sample"][valid])
            self.assertLess(apart, case["tolerance"]["fp32"], name)


class Errors(unittest.TestCase):
    def test_of_a_hue_count_more_than_those_of_a_grey(self):
        true, target = torch.zeros(1, 2, 6), torch.tensor([[True, False]])
        grey, red = true.clone(), true.clone()
        grey[0, :, 3:] = 0.3
        red[0, :, 3:] = torch.tensor([0.6, -0.3, -0.3])
        for made, plain, weighted in ((grey, 0.09, 0.09), (red, 0.18, 4 * 0.18)):
            for of_hue, expected in ((1, plain), (4, weighted)):
                places, colors = mean_error(made, true, target, of_hue)
                self.assertAlmostEqual(float(colors), expected, 6)
                self.assertEqual(float(places), 0)


class Drift(unittest.TestCase):
    def test_moves_the_colours_of_the_cells_alone_by_the_same_in_half_of_the_sets(self):
        x0 = torch.randn((64, 5, 18))
        cells = torch.zeros((64, 5), dtype=torch.bool)
        cells[:, 1:3] = True
        off = (with_drift(x0, cells, 0.15, Draws(torch.Generator().manual_seed(2), 64)) - x0).unflatten(2, (-1, 6))
        self.assertEqual(float(off[..., :3].abs().max()), 0)
        self.assertEqual(float(off[:, [0, 3, 4]].abs().max()), 0)
        moved = off[:, 1:3, :, 3:]
        torch.testing.assert_close(moved, moved[:, :1, :1].expand_as(moved), atol=1e-6, rtol=0)
        some = moved[:, 0, 0].abs().amax(1) > 0
        self.assertTrue(20 < int(some.sum()) < 44)
        self.assertAlmostEqual(float(moved[some, 0, 0].std()), 0.15, delta=0.04)


class TheRecipe(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.grid = os.path.join(self.folder.name, "a.sgrid")
        write_street(self.grid)

    def tearDown(self):
        self.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def test_orders_the_points_of_a_token_by_their_distance(self):
        _, labels, tokens = read_tokens(self.grid)
        points = tokens.astype(np.float32).reshape(len(labels), 4, 6)
        apart = (points[..., :3] ** 2).sum(-1)
        self.assertTrue((np.diff(apart, axis=1) >= -1e-3).all())
        self.assertLess(np.abs(points[labels == 2][..., 3:] - (200 / 127.5 - 1)).max(), 1e-3)

    def test_keeps_the_order_of_points_where_a_set_is_mirrored(self):
        write_street(self.grid)
        t = safetensors_file.read(self.grid)
        lattice = torch.tensor([[-0.2, -0.1, 0], [-0.2, 0.1, 0], [0.2, -0.1, 0], [0.2, 0.1, 0]], dtype=torch.float16)
        t["points"] = lattice.expand(len(t["cells"]), 4, 3).contiguous()  # all equally far from the centre
        t["colors"] = torch.arange(4, dtype=torch.uint8)[None, :, None].expand(len(t["cells"]), 4, 3).contiguous()
        safetensors_file.write(self.grid, t, safetensors_file.read_header(self.grid)[1])
        sets = LocalSets(Grids([self.grid], self.path("cache")),
                         {"seed": 1, "set_size": [8, 8], "batch": 64, "label_dropout": 0, "class_balance": 0,
                          "mirror": True, "ordered_points": True, "known_share": 0, "network": {
                              "voxel_size": 0.6, "num_classes": 20}})
        tokens = sets.batch(0)[2].reshape(-1, 4, 6)
        expected = np.broadcast_to(lattice.float() / 0.3, tokens[..., :3].shape)
        np.testing.assert_allclose(tokens[..., :3], expected, atol=1e-3)
        self.assertEqual(len(np.unique(tokens[..., 3], axis=0)), 4)  # the colours are where the mirrors brought them

    def test_neighbours_are_those_of_a_search_over_all_voxels(self):
        random = np.random.default_rng(1)
        cells = np.unique(random.integers(-9, 9, (1500, 3)), axis=0)
        cells = random.permutation(cells)  # so that numbers say nothing of places
        tree = cKDTree(cells)
        for middle, size in zip(random.integers(0, len(cells), 40), [1, 2, len(cells), *random.integers(3, 300, 37)]):
            apart = ((cells - cells[middle]) ** 2).sum(1)
            expected = np.lexsort((np.arange(len(cells)), apart))[:size]
            self.assertEqual(nearest(tree, middle, size).tolist(), expected.tolist())

    def test_draws_sets_of_neighbours_and_drops_the_labels_of_some(self):
        config = {"seed": 3, "set_size": [8, 12], "batch": 64, "label_dropout": 0.25, "class_balance": 0.5,
                  "mirror": False, "ordered_points": True, "known_share": 0,
                  "network": {"num_classes": 20, "voxel_size": 0.6}}
        sets = LocalSets(Grids([self.grid], self.path("cache")), config)
        centers, labels, tokens, known, conditions = sets.batch(5)
        self.assertEqual(conditions.shape, labels.shape + (0,))
        self.assertFalse(known.any())
        self.assertEqual(tokens.shape, labels.shape + (24,))
        dropped = (labels == 20).all(1)
        self.assertTrue(5 < dropped.sum() < 30, dropped.sum())
        self.assertFalse((labels[~dropped] == 20).any())
        self.assertLess(np.linalg.norm(centers - centers.mean(1, keepdims=True), axis=-1).max(), 3)
        again = sets.batch(5)
        self.assertTrue((again[2] == tokens).all())

    def test_has_as_many_sets_as_its_config_says(self):
        def first_tokens(**more):
            config = {"seed": 3, "set_size": [8, 8], "batch": 16, "label_dropout": 0, "class_balance": 0, "mirror": True,
                      "ordered_points": False, "known_share": 0, "network": {"num_classes": 20, "voxel_size": 0.6}, **more}
            sets = LocalSets(Grids([self.grid], self.path("cache")), config)
            return {sets.batch(step)[2][i].tobytes() for step in range(8) for i in range(16)}
        self.assertEqual(len(first_tokens(examples=5)), 5)
        self.assertGreater(len(first_tokens()), 100)

    def test_gives_a_part_of_some_sets_and_leaves_it_out_of_the_loss(self):
        words = ["-o", self.path("unused"), "--config", "small", *TINY, "--set", "set_size=[20,20]", "--set", "batch=64",
                 "--set", "known_share=0.5", "--set", "snr_gamma=0"]
        config = settings.resolve("transformer", settings.parser("transformer", "").parse_args(words))
        sets = LocalSets(Grids([self.grid], self.path("cache")), config)
        known = sets.batch(1)[3]
        shares = known.mean(1)
        self.assertTrue(20 < (shares > 0).sum() < 44, shares)
        self.assertTrue((shares < 1).all())
        seen = []

        def blank(noisy, labels, centers, valid, t):
            seen.append((noisy, t))
            return torch.zeros_like(noisy)

        tokens = torch.from_numpy(sets.batch(1)[2])
        loss, about = loss_of(sets, config)(blank, 1)
        squares = torch.stack([row[~given].square().unflatten(1, (-1, 6)).mean((0, 1)) for row, given in
                               zip(tokens, torch.from_numpy(known))]).mean(0)
        self.assertAlmostEqual(about["places"], float(squares[:3].mean()), 5)
        self.assertAlmostEqual(about["colors"], float(squares[3:].mean()), 5)
        noisy, t = seen[0]
        late = (t > 500)[:, None] & torch.from_numpy(known)  # by then others are mostly noise
        self.assertTrue(late.any())
        self.assertLess(float((noisy - tokens)[late].square().mean()), 0.03)
        self.assertGreater(float((noisy - tokens)[(t > 500)[:, None] & ~torch.from_numpy(known)].square().mean()), 0.5)

    def test_gives_one_side_of_a_plane_or_what_is_outside_of_a_ball(self):
        cells = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), -1).reshape(-1, 3)
        random, touching = np.random.default_rng(1), []
        for _ in range(50):
            known = draw_known(random, cells, 1)
            self.assertTrue(0.05 < known.mean() < 0.95)
            near = np.abs(cells[:, None] - cells[None]).sum(-1) == 1
            touching.append((near & (known[:, None] == known)).sum() / near.sum())
        self.assertGreater(np.mean(touching), 0.7)  # half of them, if voxels were drawn one by one
        self.assertFalse(draw_known(random, cells, 0).any())

    def test_learns_and_goes_on_where_it_stopped(self):
        train(self.grid, self.path("whole"), 30)
        whole = safetensors_file.read(self.path("whole/checkpoint.safetensors"))
        # the decay of the learning rate looks at the last step: the first part is given the same one
        train(self.grid, self.path("parts"), 30, "--set", "minutes=0.000001")
        self.assertEqual(safetensors_file.read_header(self.path("parts/checkpoint.safetensors"))[1]["step"], "1")
        parts = train(self.grid, self.path("parts"), 30)
        for name, tensor in whole.items():
            self.assertTrue(torch.equal(tensor, parts[name]), name)

    def test_leaves_all_but_a_part_as_it_was(self):
        whole = train(self.grid, self.path("whole"), 2)
        folder = self.path("whole/model/voxfield_transformer")
        part = train(self.grid, self.path("part"), 3, "--init", folder,
                     "--set", 'train_only=["proj_*", "time_embed.*.bias"]')
        before = safetensors_file.read(os.path.join(folder, "diffusion_pytorch_model.safetensors"))
        after = safetensors_file.read(self.path("part/model/voxfield_transformer/diffusion_pytorch_model.safetensors"))
        self.assertEqual(sorted(before), sorted(after))
        for name, tensor in before.items():
            trained = name.startswith("proj_") or (name.startswith("time_embed.") and name.endswith(".bias"))
            self.assertEqual(torch.equal(tensor, after[name]), not trained, name)
        self.assertLess(len(part), len(whole))  # no moments of what stands still
        with self.assertRaisesRegex(AssertionError, "train_only: no parameter is called proj;"):
            train(self.grid, self.path("none"), 1, "--set", 'train_only=["proj"]')

    def test_says_in_the_model_how_the_points_of_the_data_lay(self):
        def exported(folder, *grids):
            train(self.path(grids[0]), self.path(folder), 1, "--grids", *(self.path(g) for g in grids))
            with open(self.path(f"{folder}/model/voxfield_transformer/config.json")) as file:
                return json.load(file).get("placement")
        tensors, (_, metadata, _) = safetensors_file.read(self.grid), safetensors_file.read_header(self.grid)
        safetensors_file.write(self.path("c.sgrid"), tensors, {**metadata, "placement": "canonical"})
        self.assertIsNone(exported("plain", "a.sgrid"))
        self.assertEqual(exported("canonical", "c.sgrid"), "canonical")
        self.assertEqual(exported("both", "a.sgrid", "c.sgrid"), "mixed")

    def test_writes_a_model_that_the_engine_generates_with(self):
        train(self.grid, self.path("run"), 300, "--set", "learning_rate=0.003", "--set", "ema=0.9")
        semantic = {name: t for name, t in safetensors_file.read(self.grid).items() if name in ("cells", "labels")}
        safetensors_file.write(self.path("semantic.sgrid"), semantic, {"voxel_size": "0.6", "points_per_voxel": "4"})
        subprocess.run([semrover_path(), "generate", self.path("semantic.sgrid"), "-m", self.path("run/model"), "-o",
                        self.path("made.sgrid"), "--steps", "10", "--quiet"], check=True)
        made = safetensors_file.read(self.path("made.sgrid"))
        colors = made["colors"].float().mean((1, 2))
        floor, wall = colors[made["labels"] == 0].mean(), colors[made["labels"] == 2].mean()
        self.assertGreater(float(wall - floor), 40)  # it has learnt that walls are bright


if __name__ == "__main__":
    unittest.main()
