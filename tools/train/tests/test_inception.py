# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""Inception v3: ways to spoil pictures, the recipe, and that the engine computes the features that PyTorch does."""
import json
import os
import subprocess
import tempfile
import unittest

import numpy as np
import torch
from PIL import Image

from recipe import run_recipe
from semtrain import safetensors_file
from semtrain.damage import KINDS, gaussian_blur, spoil
from semtrain.draws import generator
from semtrain.frames import read_rgb
from semtrain.pictures import Picture
from semtrain.inception import Frames, draw_strengths, judge, loss_of, read_network, write_network
from semtrain.nets.inception import Inception, pool_of, resized
from semtrain.program import engine_path

SEMROVER = engine_path()
TINY = {"seed": 1, "device": "cpu", "width": 1 / 32, "least": 4, "crop": 0.6, "clean": 0.25, "twice": 0.25, "batch": 4,
        "norm_batches": 4, "judged_batches": 2}


def write_drive(folder, count=2, size=(72, 100), seed=0):
    """odd frames show class 2, reddish, even ones class 7, bluish, both below a sky; the buffer has holes"""
    random = np.random.default_rng(seed)
    for part in ("color", "label", "buffer/color", "buffer/visible"):
        os.makedirs(os.path.join(folder, part), exist_ok=True)
    for n in range(count):
        color = np.array([[40, 90, 200], [180, 90, 40]][n % 2]) + random.normal(0, 20, (*size, 3))
        labels = np.full(size, [7, 2][n % 2])
        color[:size[0] // 3], labels[:size[0] // 3] = 230, 255
        visible = random.random(size) < 0.5
        for part, picture in (("color", color), ("label", labels), ("buffer/color", color * visible[..., None]),
                              ("buffer/visible", 255 * visible)):
            Image.fromarray(picture.clip(0, 255).astype(np.uint8)).save(os.path.join(folder, part, f"{n:06d}.png"))


def train(frames, output, steps, *more):
    settings = [word for name in ("width", "least", "batch", "norm_batches", "judged_batches")
                for word in ("--set", f"{name}={TINY[name]}")]
    return run_recipe("inception", output, "--frames", frames, *settings, "--set", "warmup=2", "--set",
                      f"steps={steps}", *more)


def random_network():
    """every tensor of every norm matters, and what passes through keeps its size"""
    draw = torch.Generator().manual_seed(2)
    network = Inception(TINY["width"], TINY["least"])
    for module in network.modules():
        if isinstance(module, torch.nn.Conv2d):
            module.weight.data.normal_(0, (2 / module.weight[0].numel()) ** 0.5, generator=draw)
        if isinstance(module, torch.nn.BatchNorm2d):
            for tensor, low, high in ((module.weight.data, 0.7, 1.3), (module.running_var, 0.7, 1.3),
                                      (module.bias.data, -0.2, 0.2), (module.running_mean, -0.2, 0.2)):
                tensor.uniform_(low, high, generator=draw)
    return network


class TheDamages(unittest.TestCase):
    def setUp(self):
        draw = torch.Generator().manual_seed(1)
        self.picture = torch.rand(3, 60, 80, generator=draw) * 40
        self.picture[:, 17:43] += torch.tensor([150., 100, 60])[:, None, None]
        self.picture = self.picture.round()
        self.buffer = torch.zeros_like(self.picture)

    def one(self, kind, strength):
        strengths = [strength if name == kind else 0 for name in KINDS]
        return spoil(self.picture, self.buffer, strengths, torch.Generator().manual_seed(2))

    def test_leave_the_picture_alone_or_change_it_the_more_the_stronger(self):
        before = self.picture.clone()
        self.assertTrue(torch.equal(self.one("none", 1), self.picture))
        for kind in KINDS:
            apart = [float((self.one(kind, s) - self.picture).abs().mean()) for s in (0.2, 0.5, 0.8)]
            self.assertLess(0.1, apart[0], kind)
            self.assertEqual(apart, sorted(apart), kind)
            self.assertTrue(torch.equal(self.one(kind, 0.5), self.one(kind, 0.5)), kind)
            levels = self.one(kind, 0.8)
            self.assertTrue(((levels >= 0) & (levels <= 255) & (levels == levels.round())).all(), kind)
        self.assertTrue(torch.equal(self.picture, before))

    def test_splats_cover_the_share_that_their_strength_says(self):
        self.picture += 1
        for strength in (0.2, 0.6, 1):
            covered = (self.one("splats", strength) == 0).all(0).float().mean()
            self.assertAlmostEqual(float(covered), strength, delta=1e-3)

    def test_a_blur_has_the_deviation_asked_for_and_keeps_flat_pictures(self):
        dot = torch.zeros(1, 61, 41)
        dot[0, 30, 20] = 1
        blurred = gaussian_blur(dot, 2.0)
        self.assertAlmostEqual(float(blurred.sum()), 1, places=5)
        for axis, size in ((0, 41), (1, 61)):
            along = blurred[0].sum(axis)
            places = torch.arange(size) - size // 2
            self.assertAlmostEqual(float((along * places ** 2).sum()), 4, delta=0.1)  # cut off at three deviations
        self.assertLess(float((gaussian_blur(torch.full((3, 9, 7), 200.0), 4.0) - 200).abs().max()), 1e-3)


class TheNetwork(unittest.TestCase):
    def test_has_the_names_and_shapes_that_the_engine_reads(self):
        state = Inception(1 / 8, 8).state_dict()
        for name, shape in {"Conv2d_1a_3x3.conv.weight": [8, 3, 3, 3], "Conv2d_4a_3x3.conv.weight": [24, 10, 3, 3],
                            "Mixed_6c.branch7x7dbl_5.conv.weight": [24, 20, 1, 7],
                            "Mixed_7b.branch1x1.conv.weight": [40, 160, 1, 1],
                            "Mixed_7c.branch_pool.bn.running_var": [24]}.items():
            self.assertEqual(list(state[name].shape), shape, name)
        self.assertEqual(sum(name.endswith(".conv.weight") for name in state), 94)
        self.assertEqual(Inception(1 / 8, 8).features, 256)

    def test_has_the_sizes_of_the_usual_network_at_full_width(self):
        full = Inception()
        self.assertEqual((full.features, sum(p.numel() for p in full.parameters())), (2048, 21785568))

    def test_leaves_the_padding_out_of_mean_pools(self):
        ones = torch.ones(1, 1, 4, 5)
        self.assertTrue(torch.equal(pool_of(ones, ("mean", 1)), ones))
        self.assertEqual(list(pool_of(ones, ("max", 2)).shape), [1, 1, 1, 2])


class TheRecipe(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        write_drive(self.path("drives/a"))
        write_drive(self.path("drives/b"), seed=1)

    def tearDown(self):
        self.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def test_draws_crops_with_the_shares_of_what_they_show(self):
        frames = Frames(self.path("drives"))
        self.assertEqual(len(frames.frames), 4)
        images, shares, strengths = frames.batch(TINY, 0)
        self.assertEqual(list(images.shape), [4, 3, 299, 299])
        self.assertEqual((list(shares.shape), list(strengths.shape)), ([4, 21], [4, len(KINDS)]))
        self.assertTrue(torch.allclose(shares.sum(1), torch.ones(4)))
        self.assertTrue(torch.equal(shares[:, [2, 7, 20]].sum(1), shares.sum(1)))
        self.assertTrue(((shares[:, 2] > 0) != (shares[:, 7] > 0)).all())
        for again, step, stream in ((True, 0, 0), (False, 1, 0), (False, 0, 1)):
            self.assertEqual(torch.equal(frames.batch(TINY, step, stream)[0], images), again)

    def test_mirrors_truth_buffer_and_labels_together(self):
        frames = Frames(self.path("drives"))
        truth, buffer, labels = frames.frames[0]
        frames.frames = [(truth, buffer, torch.arange(7200).view(72, 100))]
        whole, first = {**TINY, "crop": 1.0}, set()
        for step in range(8):
            seen, splats, place = frames.crop(whole, generator(whole, step))
            first.add(int(place[0, 0]))
            self.assertTrue(torch.equal(seen, truth.flatten(1)[:, place.flatten()].view(seen.shape).float()))
            self.assertTrue(torch.equal(splats, buffer.flatten(1)[:, place.flatten()].view(seen.shape).float()))
        self.assertEqual(first, {0, 99})

    def test_spoils_as_many_pictures_as_asked(self):
        drawn = torch.stack([draw_strengths(TINY, generator(TINY, i)) for i in range(400)])
        counts = (drawn > 0).sum(1)
        for count, share in ((0, 0.25), (1, 0.5), (2, 0.25)):
            self.assertAlmostEqual(float((counts == count).float().mean()), share, delta=0.06)
        self.assertTrue((drawn[drawn > 0] >= 0.2).all())

    def test_punishes_wrong_shares_and_wrong_strengths(self):
        frames = Frames(self.path("drives"))
        _, shares, strengths = frames.batch(TINY, 0)

        class Fixed(torch.nn.Module):
            def forward(self, _):
                return (answer[0] + 1e-6).log(), answer[1].clamp(1e-6, 1 - 1e-6).logit()
        losses = {}
        for name, answer in {"right": (shares, strengths), "classes": (shares.roll(1, 1), strengths),
                             "damage": (shares, strengths.roll(1, 1))}.items():
            losses[name] = loss_of(frames, {**TINY, "damage_weight": 2})(Fixed(), 0)
        self.assertLess(max(losses["right"][1].values()), 1e-4)
        for name in ("classes", "damage"):
            self.assertGreater(float(losses[name][0]), float(losses["right"][0]) + 0.1)
            self.assertGreater(losses[name][1][name], 0.02)

    def test_refuses_frames_without_labels(self):
        for drive in "ab":
            os.rename(self.path(f"drives/{drive}/label"), self.path(f"drives/{drive}/unused"))
        with self.assertRaises(SystemExit) as refused:
            Frames(self.path("drives"))
        self.assertIn("no frame has label/000000.png", str(refused.exception))

    def test_judges_perfect_answers_as_right_and_idle_ones_as_not(self):
        strengths = torch.tensor([[0.5] + [0] * 6, [0.0] * 7, [0, 0, 0.3, 0, 0, 0, 0]])
        shares = torch.eye(21)[[2, 7, 20]]
        right = judge(shares, shares, strengths, strengths)
        self.assertEqual((right["classes"]["overlap"], right["damage"]["all_right"]), (1, 1))
        self.assertEqual(right["damage"]["kinds"],
                         {kind: {"found": 1, "invented": 0, "error": 0} for kind in ("splats", "color")})
        self.assertAlmostEqual(right["classes"]["overlap_of_mean"], 1 / 3, places=3)
        idle = judge(shares, torch.full_like(shares, 1 / 21), strengths, torch.zeros_like(strengths))
        self.assertAlmostEqual(idle["classes"]["overlap"], 1 / 21, places=3)
        self.assertAlmostEqual(idle["damage"]["all_right"], 1 / 3, places=3)
        self.assertEqual(idle["damage"]["kinds"]["splats"], {"found": 0, "invented": 0, "error": 0.5})

    def test_learns_what_two_streets_differ_by_and_reports_it(self):
        train(self.path("drives"), self.path("run"), 60, "--heldout", self.path("drives"), "--set", "ema=0.8",
              "--set", "learning_rate=0.01", "--set", "clean=1", "--set", "twice=0")
        with open(self.path("run/held_out.json")) as file:
            report = json.load(file)
        self.assertEqual(report["crops"], 8)
        self.assertGreater(report["classes"]["overlap"], 0.8)  # measured 0.89 to 0.91; the same answer to all has 0.67 at most
        self.assertGreater(report["damage"]["each_right"], 0.9)  # nothing is spoilt
        self.assertEqual(report["damage"]["kinds"], {})

    def test_goes_on_where_it_stopped_and_exports_no_heads(self):
        whole = train(self.path("drives"), self.path("whole"), 4)
        train(self.path("drives"), self.path("parts"), 4, "--set", "minutes=0.000001")
        self.assertEqual(safetensors_file.read_header(self.path("parts/checkpoint.safetensors"))[1]["step"], "1")
        parts = train(self.path("drives"), self.path("parts"), 4)
        self.assertEqual(set(whole), set(parts))
        self.assertIn("average.shows.weight", whole)
        for name, tensor in whole.items():
            self.assertTrue(torch.equal(tensor, parts[name]), name)
        exports = [safetensors_file.read(self.path(f"{run}/inception.safetensors")) for run in ("whole", "parts")]
        self.assertEqual(set(exports[0]), set(Inception(TINY["width"], TINY["least"]).state_dict()))
        for name, tensor in exports[0].items():
            self.assertTrue(torch.equal(tensor, exports[1][name]), name)

    @unittest.skipUnless(os.access(SEMROVER, os.X_OK), f"{SEMROVER} is not built; $SEMROVER names another")
    def test_gives_features_that_are_those_of_the_engine(self):
        network = random_network()
        write_drive(self.path("large"), size=(310, 460), seed=3)  # one set is enlarged, the other made smaller
        sets = [[self.path(f"{drive}/color/{n:06d}.png") for n in range(2)] for drive in ("drives/a", "large")]
        sets = [torch.stack([read_rgb(Picture(path)) for path in paths]) for paths in sets]
        write_network(self.path("net.safetensors"), network)
        exact = read_network(self.path("net.safetensors"), TINY).double()
        subprocess.run([SEMROVER, "eval", "fid", self.path("drives/a/color"), self.path("large/color"), "--features",
                        self.path("net.safetensors"), "--save-features", self.path("kept")], check=True,
                       stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for name, pixels in zip("ab", sets):
            engine = safetensors_file.read(self.path(f"kept/{name}.safetensors"))["features"]
            with torch.no_grad():
                own = exact(resized(pixels.double()))
            self.assertEqual(engine.shape, own.shape)
            self.assertGreater(float(own.std(0).max()), 0.1)  # pictures differ
            self.assertLess(float((engine - own).abs().max() / own.abs().max()), 2e-6, name)


if __name__ == "__main__":
    unittest.main()
