# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What conditions a transformer beside labels: boxes and colours of objects, from objects.json to a trained model."""
import contextlib
import io
import json
import math
import os
import tempfile
import unittest

import numpy as np
import torch

from recipe import run_recipe
from semtrain import held_out, safetensors_file, transformer, variance
from semtrain.condition import drawn_boxes, mirrored, object_part, given_boxes, given_tints, vector_of, width_of
from semtrain.grids import Grids, LocalSets, read_tokens
from semtrain.json_file import read_json
from semtrain.model_folder import write_component, write_scheduler
from semtrain.nets.transformer import VoxfieldTransformer
from semtrain.objects import local_tints, owners_of, paint_near, read_objects
from semtrain.regenerate import Objects as StreetObjects, load_transformer
from semtrain.repaint import repainted
from semtrain.usual_objects import usual_objects

NETWORK = {"num_layers": 2, "num_attention_heads": 2, "attention_head_dim": 16, "points_per_voxel": 4,
           "num_classes": 20, "voxel_size": 0.6, "attention_radius": 3.0, "pos_embed_dim": 8,
           "context_pos_embed": True}
BOTH = {**NETWORK, "condition": ["object", "tint"]}
GIVE_ALL = {"dropout": 0, "partial": 0, "local": 0, "noise": 0, "jitter": 0, "repaint": 0}
CAR = [2.4, 0.0, 0.6, 4.2, 1.8, 1.2, 0.0]  # centre, size, heading


def write_cars(folder):
    """two rows of cars on a road: a dark and a bright one, end to end, with their boxes"""
    cells = np.array(sorted((i, j, k) for i in range(14) for j in range(-2, 2) for k in range(-1, 2)), np.int32)
    labels = np.where(cells[:, 2] < 0, 0, 13).astype(np.uint8)
    bright = cells[:, 0] >= 7
    colors = np.where(labels == 0, 90, np.where(bright, 220, 30))[:, None, None] + np.zeros((len(cells), 4, 3))
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (len(cells), 4, 3)).astype(np.float16)
    safetensors_file.write(os.path.join(folder, "truth.sgrid"), {
        "cells": torch.from_numpy(cells), "labels": torch.from_numpy(labels), "points": torch.from_numpy(points),
        "colors": torch.from_numpy(colors.astype(np.uint8))}, {"voxel_size": "0.6", "points_per_voxel": "4"})
    objects = [{"id": i, "class": "car", "center": [x, 0, 0.6], "size": [4.1, 2.4, 1.2], "heading": 0, "tint": tint}
               for i, (x, tint) in enumerate([(2.1, "#1e1e1e"), (6.3, [0.86, 0.86, 0.86])])]
    with open(os.path.join(folder, "objects.json"), "w") as file:
        json.dump({"format": "semrover.objects", "version": 1, "objects": objects}, file)


def config_of(**more):
    return {"seed": 3, "set_size": [40, 40], "batch": 8, "label_dropout": 0, "class_balance": 0.5, "mirror": False,
            "ordered_points": True, "known_share": 0, "network": BOTH, "telling": GIVE_ALL, **more}


class Objects(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        write_cars(self.folder.name)

    def tearDown(self):
        self.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def sets(self, **more):
        return LocalSets(Grids([self.path("truth.sgrid")], self.path("cache")), config_of(**more))

    def test_are_read_with_colours_of_either_form(self):
        boxes, labels, tints = read_objects(self.path("objects.json"))
        self.assertEqual(labels.tolist(), [13, 13])
        self.assertTrue(np.allclose(boxes[1], [6.3, 0, 0.6, 4.1, 2.4, 1.2, 0]))
        self.assertTrue(np.allclose(tints * 255, [[30] * 3, [219.3] * 3]))

    def test_own_the_cells_of_their_class_that_lie_deepest_in_them(self):
        sets = self.sets()
        g = sets.grids
        self.assertTrue((g.owners[g.labels == 0] == -1).all())
        cars = g.cells[g.labels == 13]
        self.assertTrue((g.owners[g.labels == 13] == (cars[:, 0] >= 7)).all())
        turned = np.array([[*CAR[:6], math.pi / 2]])  # across: only the voxels within 0.9 m of x = 2.4, and 1.5 beyond
        centers = np.array([[x, 0.0, 0.6] for x in np.arange(-1.2, 6, 0.7)])
        owners = owners_of(centers, np.full(len(centers), 13), turned, np.array([13]))
        self.assertEqual(owners.tolist(), [0 if abs(x - 2.4) < 2.4 else -1 for x in centers[:, 0]])
        self.assertTrue({0, -1} == set(owners.tolist()))

    def test_have_the_colour_of_the_lighter_part_of_what_is_near(self):
        centers = np.array([[float(x), 0, 0] for x in range(10)], np.float32)
        colors = np.repeat(np.array([[1], [2], [3], [4], [200], [201], [202], [203], [204], [205]], np.uint8), 3, 1)
        self.assertEqual(paint_near(centers, colors, 2.0, rows=4)[:, 0].tolist(),
                         [2, 3, 4, 200, 201, 202, 203, 204, 204, 204])
        points = np.repeat(colors[:, None], 4, 1)
        owners = np.array([0] * 4 + [1] * 5 + [-1])
        tints = local_tints(centers * 10, owners, points)
        self.assertEqual(tints[:, 0].tolist(), [1, 2, 3, 4, 200, 201, 202, 203, 204, 0])

    def test_say_how_far_a_voxel_lies_from_each_face(self):
        part = object_part(np.array([[3.4, 0.5, 0.6], [-20, 0, 0.6]]), np.array([CAR] * 2), np.array([True, True]))
        self.assertEqual(part.shape, (2, 60))
        self.assertTrue(np.allclose(part[0, 1:7] * 4, [1.1, 3.1, 0.4, 1.4, 0.6, 0.6], atol=1e-5))
        self.assertTrue(np.allclose(part[1, 1:3] * 4, [8, -2]))
        self.assertTrue(np.allclose(part[0, 7:11], np.sin(2 * math.pi * 1.1 / np.array([1, 2, 4, 8])), atol=1e-5))
        self.assertTrue(np.allclose(part[0, 31:35], np.cos(2 * math.pi * 1.1 / np.array([1, 2, 4, 8])), atol=1e-5))
        self.assertTrue(np.allclose(part[0, 55:58] * 4, np.log2([4.2, 1.8, 1.2]), atol=1e-5))
        self.assertTrue(np.allclose(part[0, 58:], [0, 1]))

    def test_turned_over_swap_left_and_right_and_nothing_else(self):
        box, at = np.array([[2.4, 1.0, 0.6, 4.2, 1.8, 1.2, 0.4]]), np.array([[3.0, 1.3, 0.4]])
        plain = object_part(at, box, np.array([True]))[0, 1:7]
        for axis in range(2):
            there = at.copy()
            there[:, axis] *= -1
            over = object_part(there, mirrored(box, axis), np.array([True]))[0, 1:7]
            self.assertTrue(np.allclose(over, plain[[0, 1, 3, 2, 4, 5]], atol=1e-6), axis)
            ahead = mirrored(box, axis)[0, 6]
            self.assertTrue(np.allclose([math.cos(ahead), math.sin(ahead)],
                                        np.array([math.cos(0.4), math.sin(0.4)]) * np.eye(2)[1 - axis] * 2 -
                                        np.array([math.cos(0.4), math.sin(0.4)])), axis)

    def test_condition_a_set_with_tints_in_the_order_of_the_config(self):
        sets = self.sets()
        centers, labels, tokens, _, conditions = sets.batch(2)
        self.assertEqual(conditions.shape, (8, 40, 64))
        is_car = labels == 13
        self.assertTrue((conditions[..., 0] == is_car).all())
        self.assertTrue((conditions[..., 60] == is_car).all())
        self.assertTrue((conditions[~is_car] == 0).all())
        given = (conditions[..., 61:][is_car] + 1) / 2 * 255
        true = (tokens.reshape(8, 40, 4, 6)[..., 3:].mean(2)[is_car] + 1) / 2 * 255
        self.assertLess(np.abs(given - true).max(), 1)
        swapped = LocalSets(sets.grids, config_of(network={**NETWORK, "condition": ["tint", "object"]})).batch(2)[4]
        self.assertTrue((swapped[..., 4:] == conditions[..., :60]).all())
        self.assertTrue((swapped[..., :4] == conditions[..., 60:]).all())
        self.assertEqual(vector_of([], centers[0], None, None, None, None).shape, (40, 0))

    def add_parts(self):
        """a part at either end of the second car, one of them with a colour"""
        about = read_json(self.path("objects.json"))
        for x, tint in ((4.6, {}), (8.1, {"tint": "#ff0000"})):
            about["objects"].append({"id": len(about["objects"]), "class": "car", "center": [x, 0, 0.6],
                                     "size": [0.5, 2, 1], "heading": 0, "part": True, **tint})
        with open(self.path("objects.json"), "w") as file:
            json.dump(about, file)

    def test_have_parts_that_own_no_voxels_and_condition_those_up_to_60_cm_from_them(self):
        config = {**NETWORK, "condition": ["object", "tint", "part"]}
        before = self.sets().batch(2)
        self.add_parts()
        sets = LocalSets(Grids([self.path("truth.sgrid")], self.path("parts")), config_of(network=config))
        centers, labels, tokens, _, given = sets.batch(2)
        self.assertTrue((tokens == before[2]).all())
        self.assertTrue((given[..., :64] == before[4]).all())
        flags = np.zeros(labels.shape, int)
        for number, x in ((1, 4.6), (2, 8.1)):
            depth = np.array([0.25, 1, 0.5]) - np.abs(centers - [x, 0, 0.6])
            flags[(depth.min(-1) > -0.6 + 1e-6) & (labels == 13)] = number
        self.assertGreater(min((flags == number).sum() for number in (1, 2)), 10)
        self.assertTrue(((given[..., 64] == 1) == (flags > 0)).all())
        self.assertTrue(((given[..., 124] == 1) == (flags == 2)).all())
        self.assertTrue((given[flags == 2][:, 125:] == [1, -1, -1]).all())
        self.assertTrue((given[flags == 0][:, 64:] == 0).all())
        box = np.array([[8.1, 0, 0.6, 0.5, 2, 1, 0]])
        cell = centers[flags == 2][:1]
        np.testing.assert_allclose(given[flags == 2][:1, 64:124], object_part(cell, box, np.array([True])), atol=1e-5)
        street = StreetObjects(self.path("truth.sgrid"), *self.cells())
        self.assertEqual(street.conditions(config["condition"])[:, 64].sum(), len(np.flatnonzero(street.parts >= 0)))

    def cells(self):
        t = {name: tensor.numpy() for name, tensor in safetensors_file.read(self.path("truth.sgrid")).items()}
        return (t["cells"] + 0.5) * 0.6, t["labels"]

    def test_have_usual_parts(self):
        boxes = [[x, 5, z, 0.9, 1.2, 1.6, -np.pi / 2] for z in (2.3, 5.4, 8.5) for x in (-3, 0, 3)]
        objects = [{"id": 9 + i, "class": "building", "center": b[:3], "size": b[3:6], "heading": b[6], "part": True,
                    "tint": "#101010"} for i, b in enumerate([*boxes, [0, 5, 1, 0.9, 1, 2, -np.pi / 2]])]
        objects += [{"id": i, "class": "building", "center": [20 * i, 10, 6], "size": [10, 10, 12],
                     "heading": -np.pi / 2, "tint": "#ffffff"} for i in range(4)]
        with open(self.path("objects.json"), "w") as file:
            json.dump({"format": "semrover.objects", "version": 1, "objects": objects}, file)
        usual = usual_objects([self.path("truth.sgrid")])["building"]
        self.assertEqual(usual["size"], [10, 10, 12])
        self.assertEqual(usual["tints"], ["#ffffff"] * 4)
        self.assertEqual(usual["parts"], {"size": [0.9, 1.2, 1.6], "pitch": [3, 3.1], "low": 1.5,
                                          "tints": ["#101010"] * 10})

    def test_more_conditions_come_with_a_model_that_went_on_from_one_with_fewer(self):
        torch.manual_seed(1)
        less, more = VoxfieldTransformer(**BOTH), VoxfieldTransformer(**{**BOTH, "condition": ["object", "tint", "part"]})
        more.load_state_dict(transformer.with_new_parts(less.state_dict(), more))
        given = (torch.randn(1, 5, 24), torch.tensor([[13, 13, 0, 0, 2]]), torch.randn(1, 5, 3),
                 torch.ones(1, 5, dtype=torch.bool), torch.tensor([300]))
        condition = torch.randn(1, 5, 128)
        less.proj_out.weight.data.normal_()
        more.load_state_dict(transformer.with_new_parts(less.state_dict(), more))
        with torch.no_grad():
            torch.testing.assert_close(more(*given, condition), less(*given, condition[..., :64]))

    def test_condition_a_street_that_is_placed_anew(self):
        """all of them, with their whole colours, as a set of one batch is given in training"""
        path = os.path.join(self.folder.name, "truth.sgrid")
        t = {name: tensor.numpy() for name, tensor in safetensors_file.read(path).items()}
        centers, chosen = (t["cells"] + 0.5) * 0.6, np.arange(len(t["cells"]))
        objects = StreetObjects(path, centers, t["labels"])
        given = objects.conditions(BOTH["condition"])
        grids = Grids([path], os.path.join(self.folder.name, "cache"))
        sets = LocalSets(grids, config_of())
        boxes = grids.boxes[grids.owners]
        again = sets._condition(np.random.default_rng(1), centers, chosen, boxes, boxes, np.array(grids.tokens), False)
        np.testing.assert_array_equal(given, again)
        self.assertGreater(given[t["labels"] == 13, -3:].max(), 0.6)
        self.assertEqual(objects.conditions(()).shape, (len(t["cells"]), 0))

    def test_keep_their_mean_colour_where_a_street_is_placed_anew(self):
        path = os.path.join(self.folder.name, "truth.sgrid")
        cells, labels, tokens = read_tokens(path)
        objects = StreetObjects(path, (cells + 0.5) * 0.6, labels)
        true = tokens.astype(np.float32).reshape(len(cells), 4, 6)
        made = np.random.default_rng(2).uniform(-1, 1, true.shape).astype(np.float32)
        before = made.copy()
        objects.keep_colors(made, true)
        for owner in (0, 1):
            of_car = objects.owners == owner
            self.assertGreater(of_car.sum(), 20)
            np.testing.assert_allclose(made[of_car, :, 3:].mean((0, 1)), true[of_car, :, 3:].mean((0, 1)), atol=1e-5)
        np.testing.assert_array_equal(made[..., :3], before[..., :3])
        np.testing.assert_array_equal(made[objects.owners < 0], before[objects.owners < 0])

    def test_of_the_ground_have_a_colour_and_no_box(self):
        about = read_json(self.path("objects.json"))
        about["objects"].append({"id": 7, "class": "road", "center": [4.2, 0, -0.3], "size": [10, 4, 3], "heading": 0,
                                 "tint": "#a03020"})
        with open(self.path("objects.json"), "w") as file:
            json.dump(about, file)
        grids = Grids([self.path("truth.sgrid")], self.path("cache"))
        _, labels, _, _, conditions = LocalSets(grids, config_of()).batch(2)
        road = labels == 0
        self.assertTrue(road.any() and (labels == 13).any())
        self.assertTrue((conditions[..., 0] == ~road).all())
        self.assertTrue((conditions[road][:, :60] == 0).all())
        self.assertTrue(np.allclose(conditions[road][:, 60:], [1, *(2 * np.array([160, 48, 32]) / 255 - 1)], atol=1e-6))
        cells = np.array(grids.cells)
        given = StreetObjects(self.path("truth.sgrid"), (cells + 0.5) * 0.6, grids.labels).conditions(BOTH["condition"])
        self.assertTrue((given[grids.labels == 0] == conditions[road][0]).all())

    def test_of_the_ground_are_usual_as_the_largest_of_a_street_is(self):
        paths = []
        for street in range(4):
            os.makedirs(self.path(str(street)))
            paths.append(self.path(f"{street}/truth.sgrid"))
            parts = [("road", 2, "#903020"), ("road", 6, f"#60606{street}"), ("road", 7, None), ("car", 2, "#ffffff")]
            objects = [{"id": i, "class": name, "center": [0, 0, 0], "size": [10, width, 3], "heading": 0,
                        **({"tint": tint} if tint else {})} for i, (name, width, tint) in enumerate(parts)]
            with open(self.path(f"{street}/objects.json"), "w") as file:
                json.dump({"format": "semrover.objects", "version": 1, "objects": objects}, file)
        usual = usual_objects(paths)
        self.assertEqual(sorted(usual["road"]["tints"]), [f"#60606{street}" for street in range(4)])
        self.assertEqual(usual["car"]["tints"], ["#ffffff"] * 4)

    def test_are_left_out_each_for_itself_and_with_the_labels(self):
        counts = np.zeros((2, 2), int)
        sets = self.sets(telling={**GIVE_ALL, "dropout": 0.5}, label_dropout=0.2, batch=64)
        _, labels, _, _, conditions = sets.batch(0)
        for of_set, set_labels in zip(conditions, labels):
            if (set_labels == 20).all():
                self.assertTrue((of_set == 0).all())
            elif (set_labels == 13).any():
                counts[int(of_set[:, 0].any()), int(of_set[:, 60].any())] += 1
        self.assertTrue((counts > 4).all(), counts)

    def test_may_be_given_in_part(self):
        owners, shares = np.repeat(np.arange(-1, 9), 30), {given_boxes: [], given_tints: []}
        for seed in range(200):
            for draw, seen in shares.items():
                labels = (np.full(len(owners), 13),) if draw is given_boxes else ()
                given = draw(np.random.default_rng(seed), owners, *labels, {"dropout": 0.25, "partial": 0.5})
                self.assertFalse(given[owners < 0].any())
                seen.append(given[owners >= 0].mean())
                if draw is given_boxes:
                    self.assertTrue(all(len(set(given[owners == o])) == 1 for o in range(9)))
        for seen in shares.values():
            none, every = np.mean(np.array(seen) == 0), np.mean(np.array(seen) == 1)
            self.assertTrue(0.15 < none < 0.4 and 0.25 < every < 0.5, (none, every))

    def test_may_be_off_each_as_a_whole_in_every_other_set(self):
        owners, boxes = np.repeat([0, 1], 20), np.repeat(np.array([CAR, CAR[::-1]]), 20, 0)
        moved = [drawn_boxes(np.random.default_rng(seed), owners, boxes, {"jitter": 0.2}) for seed in range(100)]
        exact = np.mean([(m == boxes).all() for m in moved])
        self.assertTrue(0.35 < exact < 0.65, exact)
        for m in moved:
            self.assertTrue((m[:20] == m[0]).all() and (m[20:] == m[20]).all())
        off = np.array([m[0] - boxes[0] for m in moved if not (m == boxes).all()])
        self.assertTrue(0.15 < off[:, :6].std() < 0.25 and off[:, 6].std() < 0.06, off.std(0))
        self.assertTrue((drawn_boxes(np.random.default_rng(1), owners, boxes, {"jitter": 0}) == boxes).all())

    def test_say_nothing_to_a_network_before_it_learns_and_nothing_where_none_are_given(self):
        torch.manual_seed(1)
        model, plain = VoxfieldTransformer(**BOTH), VoxfieldTransformer(**NETWORK)
        model.condition_embed.linear_2.weight.data.normal_()
        plain.load_state_dict({n: t for n, t in model.state_dict().items() if not n.startswith("condition_embed.")})
        given = (torch.randn(1, 5, 24), torch.tensor([[13, 13, 0, 0, 2]]), torch.randn(1, 5, 3),
                 torch.ones(1, 5, dtype=torch.bool), torch.tensor([300]))
        condition = torch.randn(1, 5, width_of(BOTH["condition"]))
        with torch.no_grad():
            expected = plain(*given)
            self.assertTrue(torch.equal(model(*given, torch.zeros_like(condition)), expected))
            self.assertFalse(torch.equal(model(*given, condition), expected))
            state = transformer.with_new_parts(plain.state_dict(), model)
            self.assertEqual(sorted(state), sorted(model.state_dict()))
            model.condition_embed.linear_2.weight.data.zero_()
            self.assertTrue(torch.equal(model(*given, condition), expected))

    def test_reach_voxel_tokens_where_the_config_says_so_and_begin_there_with_nothing(self):
        torch.manual_seed(1)
        model, semantic = VoxfieldTransformer(**BOTH, condition_voxels=True), VoxfieldTransformer(**BOTH)
        state = transformer.with_new_parts(semantic.state_dict(), model)
        self.assertEqual(sorted(state), sorted(model.state_dict()))
        model.load_state_dict(state)
        given = (torch.randn(1, 5, 24), torch.tensor([[13, 13, 0, 0, 2]]), torch.randn(1, 5, 3),
                 torch.ones(1, 5, dtype=torch.bool), torch.tensor([300]))
        condition = torch.randn(1, 5, width_of(BOTH["condition"]))
        with torch.no_grad():
            model.condition_embed.start_at_zero()
            silent = model(*given, condition)
            model.condition_embed.linear_voxels.weight.data.normal_()
            self.assertFalse(torch.equal(model(*given, condition), silent))
            self.assertTrue(torch.equal(model(*given, torch.zeros_like(condition)), silent))

    def test_condition_with_the_colours_of_what_was_repainted(self):
        plain = self.sets(batch=16).batch(2)
        painted = self.sets(batch=16, telling={**GIVE_ALL, "repaint": 0.5}).batch(2)
        is_car = plain[1] == 13
        before, after = (((b[2].reshape(16, 40, 4, 6)[..., 3:].mean(2) + 1) / 2)[is_car] for b in (plain, painted))
        given = ((painted[4][..., 61:] + 1) / 2)[is_car]
        changed = np.abs(after - before).max(1) > 0.02
        self.assertTrue(0.2 < changed.mean() < 0.7, changed.mean())
        self.assertLess(np.abs(given - after).max(), 0.01)
        self.assertTrue((painted[2][~is_car] == plain[2][~is_car]).all())
        self.assertTrue((painted[2].reshape(16, 40, 4, 6)[..., :3] == plain[2].reshape(16, 40, 4, 6)[..., :3]).all())
        some = self.sets(telling={**GIVE_ALL, "partial": 1, "repaint": 1}).batch(2)[2]
        self.assertTrue((some == self.sets(telling={**GIVE_ALL, "partial": 1}).batch(2)[2]).all())

    def test_keep_dark_parts_when_repainted(self):
        paint, red = np.array([0.6, 0.6, 0.6]), np.array([0.6, 0.2, 0.2])
        colors = np.array([[0.6, 0.6, 0.6], [0.7, 0.7, 0.7], [0.2, 0.22, 0.25], [0.9, 0.9, 0.9]])
        made = repainted(colors, paint, red)
        self.assertTrue(np.allclose(made[:2], [[0.6, 0.2, 0.2], [0.7, 0.7 / 3, 0.7 / 3]]))
        self.assertTrue((made[2] == colors[2]).all())
        self.assertTrue(np.allclose(made[3], [0.9, 0.3, 0.3]))

    def test_teach_a_model_which_car_is_bright(self):
        config = {**BOTH, "condition": ["tint"]}
        settings = ["--config", "objects", "--set", f"network={json.dumps(config)}", "--set", "batch=4", "--set", "set_size=[24,30]",
                    "--set", "warmup=2", "--set", "precision=fp32", "--set", "known_share=0", "--set", "ema=0.9",
                    "--set", f"telling={json.dumps(GIVE_ALL)}", "--set", "learning_rate=0.01", "--set", "steps=150",
                    "--set", "mirror=false", "--set", "label_dropout=0"]
        run_recipe("transformer", self.path("run"), "--grids", self.path("truth.sgrid"), *settings)
        with open(self.path("run/model/voxfield_transformer/config.json")) as file:
            about = json.load(file)
        self.assertEqual(about["condition"], ["tint"])
        model = load_transformer(self.path("run/model/voxfield_transformer"))
        sets = LocalSets(Grids([self.path("truth.sgrid")], self.path("cache")), config_of(network=config, batch=1))
        centers, labels, tokens, known, conditions = (torch.from_numpy(a) for a in sets.batch(4))
        noise, cars = torch.randn(tokens.shape), labels[0] == 13

        def brightness(given):
            condition = torch.zeros_like(conditions)
            condition[0, cars] = torch.tensor([1.0, given, given, given])
            with torch.no_grad():
                made = model(noise, labels, centers, ~known, torch.tensor([999]), condition)
            return float(made.unflatten(2, (-1, 6))[0, cars][..., 3:].mean())
        self.assertGreater(brightness(0.7) - brightness(-0.75), 0.8)


class TheTable(unittest.TestCase):
    def test_has_a_row_for_each_choice_and_the_same_errors_where_nothing_is_given(self):
        with tempfile.TemporaryDirectory() as folder:
            write_cars(folder)
            torch.manual_seed(1)
            state = {n: torch.randn(t.shape) * 0.1 for n, t in VoxfieldTransformer(**BOTH).state_dict().items()}
            given, plain = os.path.join(folder, "given"), os.path.join(folder, "plain")
            write_component(given, BOTH, state)
            write_component(plain, NETWORK, {n: t for n, t in state.items() if not n.startswith("condition_embed.")})
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                held_out.main(["--grids", os.path.join(folder, "truth.sgrid"), "--model", f"plain={plain}", "--model",
                               f"given={given}", "--batches", "1", "--cells", "30", "--threads", "1"])
            rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in out.getvalue().splitlines()[2:]]
            self.assertEqual([r[:2] for r in rows], [["plain", "labels"], ["given", "labels"], ["given", "object"],
                                                     ["given", "tint"], ["given", "object and tint"]])
            self.assertEqual(rows[0][2:], rows[1][2:])
            self.assertEqual(len({tuple(r[2:]) for r in rows}), 4)


class Variance(unittest.TestCase):
    def test_of_a_model_that_says_nothing_is_the_tokens_own_second_moment(self):
        with tempfile.TemporaryDirectory() as folder:
            write_cars(folder)
            state = {n: torch.zeros(t.shape) for n, t in VoxfieldTransformer(**BOTH).state_dict().items()}
            write_component(os.path.join(folder, "voxfield_transformer"), BOTH, state)
            write_scheduler(os.path.join(folder, "voxfield_scheduler"), {"variance_type": "fixed_small", "beta_end": 0.02})
            truth = os.path.join(folder, "truth.sgrid")
            variance.main([folder, "--grids", truth, "--batches", "1", "--cells", "1000", "--threads", "1", "--colors", "2"])
            scheduler = read_json(os.path.join(folder, "voxfield_scheduler", "scheduler_config.json"))
            self.assertEqual((scheduler["variance_type"], scheduler["beta_end"]), ("analytic", 0.02))
            tokens = read_tokens(truth)[2].astype(np.float64).reshape(-1, 6)
            times = [row[0] for row in scheduler["prediction_errors"]]
            self.assertEqual((times[0], times[-1]), (2, 999))
            self.assertEqual(times, sorted(set(times)))
            for _, places, colors in scheduler["prediction_errors"]:
                self.assertAlmostEqual(places, (tokens[:, :3] ** 2).mean(), delta=1e-3)
                self.assertAlmostEqual(colors, 2 * (tokens[:, 3:] ** 2).mean(), delta=1e-3)


if __name__ == "__main__":
    unittest.main()
