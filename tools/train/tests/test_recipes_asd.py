# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The recipes vae and asd on two made drives of three frames of 64 x 48."""
import contextlib
import io
import json
import os
import shutil
import subprocess
import tempfile
import unittest

import numpy as np
import torch
from PIL import Image

from semtrain import asd, empty_prompt, measure_frames, model_folder, one_step_asd, safetensors_file, vae
from semtrain.denoising import alphas_cumprod
from semtrain.draws import draws, generator
from semtrain.frames import find_drives
from semtrain.json_file import read_json, write_json
from semtrain.latents import sequences
from semtrain.trainer import CHECKPOINT
from test_empty_prompt import write_text_encoder

COMMON = {"steps": 4, "learning_rate": 3e-3, "warmup": 1, "decay": 0.0, "ema": 0.5, "precision": "fp32",
          "seed": 1, "device": "cpu", "encode_batch": 2}
VAE = {**COMMON, "latent_channels": 4, "block_out_channels": [8, 8, 16, 16], "layers_per_block": 1,
       "norm_num_groups": 4, "mid_block_add_attention": False, "use_quant_conv": False, "use_post_quant_conv": False,
       "force_upcast": False, "crop": 32, "batch": 4, "buffer_share": 0.25, "detail_weight": 1.0, "color_weight": 1.0,
       "kl_weight": 1e-4, "train": "both", "latent_noise": 0.0}
ASD = {**COMMON, "in_channels": 13, "out_channels": 4, "block_out_channels": [16, 16], "layers_per_block": 1,
       "down_block_types": ["DownBlock2D", "CrossAttnDownBlock2D"], "mid_block_type": "UNetMidBlock2DCrossAttn",
       "up_block_types": ["CrossAttnUpBlock2D", "UpBlock2D"], "attention_head_dim": 2, "cross_attention_dim": 8,
       "norm_num_groups": 4, "text_tokens": 1, "train_text": True, "crop": [6, 6], "batch": 4, "mirror": True,
       "dropout": 0.3, "first_share": 0.1, "previous_noise": [0.3, 0.7], "weighting": "v", "prediction_type": "v_prediction",
       "timestep_spacing": "trailing", "timestep_power": 0.8, "few_steps": [2], "sampler_share": 0.5,
       "defaults": {"num_inference_steps": 2, "guidance_scale": 1.5, "previous_noise": 0.3}}


ONE_STEP = {**COMMON, "text_tokens": 1, "train_text": True, "crop": [6, 6], "batch": 4, "mirror": True, "chained": 0.5,
            "first_share": 0.0, "error_weight": 1.0, "feature_weight": 1.0, "discriminator_weight": 0.2}


def put_radius(drive, radius):
    """what `semrover render` says of the splats of DRIVE/buffer"""
    write_json(os.path.join(drive, "buffer", "run.json"), {"settings": {"drive": {"splat_radius": str(radius)}}})


def draw_drive(folder, seed):
    """a slope of colours that moves from frame to frame; its buffer has holes"""
    random = np.random.default_rng(seed)
    for part in ("color", "buffer/color", "buffer/visible"):
        os.makedirs(os.path.join(folder, part))
    y, x = np.mgrid[0:48, 0:64]
    for number in range(3):
        truth = np.stack([4 * x, 5 * y, 2 * (x + y) + 20 * number], -1).clip(0, 255).astype(np.uint8)
        seen = random.random((48, 64)) < 0.7
        pictures = {"color": truth, "buffer/color": truth * seen[..., None], "buffer/visible": seen * np.uint8(255)}
        for part, picture in pictures.items():
            Image.fromarray(picture).save(os.path.join(folder, part, f"{number:06d}.png"))


def put_path(folder):
    """a camera that moves 0.1 m a frame, and a wall 5 m ahead of it"""
    os.makedirs(os.path.join(folder, "depth"))
    frames = []
    for number in range(3):
        Image.fromarray(np.full((48, 64), 5000 - 100 * number, np.uint16)).save(
            os.path.join(folder, "depth", f"{number:06d}.png"))
        pose = np.diag([1.0, -1, -1, 1])
        pose[2, 3] = 0.1 * number
        frames.append({"file_path": f"color/{number:06d}.png", "transform_matrix": pose.tolist()})
    with open(os.path.join(folder, "transforms.json"), "w") as file:
        json.dump({"w": 64, "h": 48, "fl_x": 40, "fl_y": 40, "cx": 32, "cy": 24, "frames": frames}, file)


class Recipes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.holder = tempfile.TemporaryDirectory()
        cls.folder = cls.holder.name
        for i in range(2):
            draw_drive(cls.path("frames", str(i)), i)
            put_radius(cls.path("frames", str(i)), "auto")
        for name, config in (("vae", VAE), ("asd", ASD), ("one_step", ONE_STEP)):
            with open(cls.path(name + ".json"), "w") as file:
                json.dump(config, file)
        cls.train(vae, "vae", "of_vae", "--set", "steps=60")

    @classmethod
    def tearDownClass(cls):
        cls.holder.cleanup()

    @classmethod
    def path(cls, *parts):
        return os.path.join(cls.folder, *parts)

    @classmethod
    def train(cls, recipe, name, output, *more):
        with contextlib.redirect_stdout(io.StringIO()):
            recipe.main(["-o", cls.path(output), "--config", cls.path(name + ".json"), "--threads", "1", "--frames",
                         cls.path("frames"), *more])

    def train_asd(self, output, *more):
        self.train(asd, "asd", output, "--vae", self.path("of_vae", "vae"), *more)

    def state(self, output):
        return safetensors_file.read(self.path(output, CHECKPOINT))

    def weights(self, output):
        return {name[6:]: t for name, t in self.state(output).items() if name.startswith("model.")}

    def check_that_continuing_changes_nothing(self, train, name):
        train(name + "_whole", "--set", "steps=4")
        train(name + "_parts", "--set", "steps=2")
        train(name + "_parts", "--set", "steps=4")
        whole, parts = self.state(name + "_whole"), self.state(name + "_parts")
        self.assertEqual(set(whole), set(parts))
        self.assertEqual([n for n in whole if not torch.equal(whole[n], parts[n])], [])

    def run_engine(self, *arguments):
        engine = os.environ.get("SEMROVER")
        if not engine:
            self.skipTest("SEMROVER names no engine")
        done = subprocess.run([engine, *arguments], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_vae_learns_what_it_sees(self):
        with contextlib.redirect_stdout(io.StringIO()):
            pictures = vae.Pictures(find_drives(self.path("frames")))
        images, noise = pictures.crops(VAE, 1000), torch.zeros(4, 4, 4, 4)
        torch.manual_seed(1)
        model = vae.AutoencoderKL(VAE)
        before = vae.step_loss(model, images, VAE, noise)[1]["rec"]
        model.load_state_dict(self.weights("of_vae"))
        self.assertLess(vae.step_loss(model, images, VAE, noise)[1]["rec"], 0.6 * before)

    def test_a_decoder_trained_alone_leaves_every_latent_as_it_was(self):
        before = self.path("of_vae", "vae")
        self.train(vae, "vae", "decoder", "--init", before, "--set", "train=decoder", "--set", "latent_noise=0.1")
        after = self.path("decoder", "vae")
        (config, old), (now, new) = (model_folder.read_component(folder) for folder in (before, after))
        self.assertEqual(config, now)
        same = {name for name in old if torch.equal(old[name], new[name])}
        self.assertEqual({name for name in old if name.startswith("encoder.")},
                         {name for name in same if name.startswith("encoder.")})
        self.assertTrue({name for name in old if name.startswith("decoder.")} - same)

    def test_latents_have_mean_zero_and_deviation_one(self):
        drives = find_drives(self.path("frames"))
        all_sequences = sequences(self.path("of_vae", "vae"), drives, self.path("measured"), ASD)
        self.assertEqual(len(all_sequences), 4)
        self.assertEqual(all_sequences[0].first, [True, False, False])
        first = torch.cat([s.truth[:1].flatten() for s in all_sequences[:2]])
        self.assertAlmostEqual(float(first.mean()), 0, places=2)
        self.assertAlmostEqual(float(first.std()), 1, places=2)

    def test_asd_learns_what_it_sees(self):
        self.train_asd("learned", "--set", "steps=80")
        batches = asd.Batches(sequences(self.path("of_vae", "vae"), find_drives(self.path("frames")),
                                        self.path("learned", "latents"), ASD), ASD)
        torch.manual_seed(1)
        model = asd.Renderer(ASD)

        def error():
            return sum(asd.step_loss(model, batches.make(s), alphas_cumprod(), ASD, draws(ASD, s, 1))[1]["eps"]
                       for s in range(1000, 1008))
        with torch.no_grad():
            before = error()
            model.load_state_dict(self.weights("learned"))
            self.assertLess(error(), 0.6 * before)

    def test_timesteps_are_those_of_short_samplers_in_their_share_and_spread_otherwise(self):
        config = {**ASD, "few_steps": [2, 3], "sampler_share": 0.75}
        t = asd.draw_timesteps(4000, config, generator(config, 1)).tolist()
        self.assertAlmostEqual(t.count(999) / 4000, 0.75 * (1 / 2 + 1 / 3) / 2, delta=0.03)
        self.assertAlmostEqual(t.count(499) / 4000, 0.75 / 4, delta=0.03)
        self.assertGreater(len(set(t)), 500)
        spread = asd.draw_timesteps(4000, {**config, "sampler_share": 0.0}, generator(config, 1))
        self.assertAlmostEqual(float((spread < 1000 * 0.5 ** 0.8).float().mean()), 0.5, delta=0.01)

    def test_a_batch_hides_previous_and_visibility_together(self):
        config = {**ASD, "batch": 64}
        batches = asd.Batches(sequences(self.path("of_vae", "vae"), find_drives(self.path("frames")),
                                        self.path("measured"), config), config)
        _, previous, buffer, visible = batches.make(0)
        hidden = visible.flatten(1).abs().sum(1) == 0
        self.assertEqual(float(previous[hidden].abs().max()), 0)
        self.assertTrue(0.15 < hidden.float().mean() < 0.45)
        self.assertGreater(float(buffer[hidden].abs().max()), 0)
        alone = (previous.flatten(1).abs().sum(1) == 0) & ~hidden  # first frames of drives and the share of others
        self.assertTrue(0.1 < alone.float().mean() < 0.5)

    def test_vae_that_is_continued_has_the_weights_of_one_that_was_not_interrupted(self):
        self.check_that_continuing_changes_nothing(lambda *a: self.train(vae, "vae", *a), "vae")

    def test_asd_that_is_continued_has_the_weights_of_one_that_was_not_interrupted(self):
        self.check_that_continuing_changes_nothing(self.train_asd, "asd")

    def test_asd_starts_from_another_renderer(self):
        self.train_asd("begin", "--set", "steps=2")
        self.train_asd("onward", "--init", self.path("begin"), "--set", "steps=1", "--set", "learning_rate=0")
        begin = safetensors_file.read(self.path("begin", "renderer", "diffusion_pytorch_model.safetensors"))
        for name, tensor in self.weights("onward").items():
            if name.startswith("unet."):
                self.assertTrue(torch.equal(tensor.half(), begin[name[5:]]), name)

    def test_asd_widens_a_plain_stable_diffusion_unet_with_zeros(self):
        self.train_asd("plain", "--set", "steps=1")
        os.rename(self.path("plain", "renderer"), self.path("plain", "unet"))
        file = self.path("plain", "unet", "diffusion_pytorch_model.safetensors")
        narrow = safetensors_file.read(file)
        narrow["conv_in.weight"] = narrow["conv_in.weight"][:, :4]
        safetensors_file.write(file, narrow)
        config = dict(ASD)
        wide = asd.read_init(self.path("plain"), config)["unet.conv_in.weight"]
        self.assertEqual(tuple(wide.shape), (16, 13, 3, 3))
        self.assertTrue(torch.equal(wide[:, :4], narrow["conv_in.weight"].float()))
        self.assertEqual(float(wide[:, 4:].abs().max()), 0)
        shutil.rmtree(self.path("plain", "conditioning"))
        width = config["cross_attention_dim"]
        self.assertEqual(float(asd.read_init(self.path("plain"), config)["text"].abs().max()), 0)
        write_text_encoder(self.path("plain"), width)
        text = asd.read_init(self.path("plain"), config)["text"]
        self.assertTrue(torch.equal(text, empty_prompt.embedding_of(self.path("plain"))))
        self.assertEqual(config["text_tokens"], text.shape[1])
        write_text_encoder(self.path("plain"), width + 8)
        with self.assertRaisesRegex(SystemExit, f"the text has {width + 8} channels, the UNet expects {width}"):
            asd.read_init(self.path("plain"), config)

    def train_one_step(self, output, *more):
        self.train(one_step_asd, "one_step", output, "--init", self.path("begun"), *more)

    def one_step_of(self, folder):
        """a renderer of a model folder, which draws in one step, and its pairs, whose previous frames are true"""
        config = {**ONE_STEP, "chained": 0.0, "batch": 16}
        made = sequences(self.path("of_vae", "vae"), find_drives(self.path("frames")), self.path("measured"), config)
        state, _ = one_step_asd.one_step_init(folder, config)
        torch.manual_seed(1)
        model = one_step_asd.OneStep(config)
        model.load_state_dict({n: t.float() for n, t in state.items()}, strict=False)
        return model, one_step_asd.Pairs(made, 0.3, config), config

    def one_step_error(self, folder):
        model, pairs, config = self.one_step_of(folder)
        with torch.no_grad():
            return float(one_step_asd.error_of_held_out(pairs, config)(model, 1000, None)[0])

    def test_one_step_is_learned_from_true_frames(self):
        self.train_asd("begun", "--set", "steps=60", "--set", "few_steps=[2]")
        self.train_one_step("one", "--set", "steps=80", "--held-out", self.path("frames"))
        before, after = (self.one_step_error(self.path(name)) for name in ("begun", "one"))
        self.assertLess(after, 0.7 * before)
        defaults = read_json(self.path("one", "model_index.json"))["defaults"]["renderer"]
        self.assertEqual((defaults["num_inference_steps"], defaults["guidance_scale"]), (1, 1))
        self.assertEqual(defaults["splat_radius"], "auto")
        self.check_that_continuing_changes_nothing(self.train_one_step, "one")
        self.run_engine("refine", self.path("frames", "0", "buffer"), "-m", self.path("one"), "-o",
                        self.path("in_one_step"), "--frames", "0:1", "--quiet")
        self.check_who_learns_of_what(*self.one_step_of(self.path("one")))
        scheduler = self.path("begun", "scheduler", "scheduler_config.json")
        write_json(scheduler, {**read_json(scheduler), "timestep_spacing": "leading"})
        with self.assertRaisesRegex(SystemExit, "'timestep_spacing': 'trailing'"):
            self.train_one_step("refused")

    def check_who_learns_of_what(self, model, pairs, config):
        """the discriminator learns to tell latents apart, the renderer to look true to it; neither of the other's"""
        made, truth, condition, _ = one_step_asd.drawn(model, pairs, config, 0, None)

        def learns(loss):
            model.zero_grad(set_to_none=True)
            loss.backward(retain_graph=True)
            grads = {name: p.grad for name, p in model.named_parameters() if p.grad is not None}
            return {name.startswith(one_step_asd.DISCRIMINATOR) for name, grad in grads.items() if grad.any()}

        features, doubted = one_step_asd.likeness_loss(model, made, truth, condition)
        self.assertEqual([learns(features), learns(doubted)], [{False}] * 2)
        told_apart = one_step_asd.discriminator_loss(model, made, truth, condition)
        self.assertEqual(learns(told_apart), {True})
        adam = torch.optim.Adam(model.discriminator.parameters(), lr=3e-3)
        for _ in range(30):
            adam.zero_grad()
            one_step_asd.discriminator_loss(model, made, truth, condition).backward()
            adam.step()
        self.assertLess(float(one_step_asd.discriminator_loss(model, made, truth, condition)), 0.5 * float(told_apart))
        self.assertEqual(float(one_step_asd.likeness_loss(model, truth, truth, condition)[0]), 0)

    def test_pairs_are_neighbours_and_first_frames_have_no_previous(self):
        made = sequences(self.path("of_vae", "vae"), find_drives(self.path("frames")), self.path("measured"), ONE_STEP)
        config = {**ONE_STEP, "batch": 64, "crop": list(made[0].truth.shape[2:])}
        (before, *_), _, _, has_previous, *_ = one_step_asd.Pairs(made, 0.3, {**config, "first_share": 1.0}).make(0)
        self.assertFalse(before.any() or has_previous.any())
        (previous, buffer, _), truth, _, has_previous, this, _, of_this, _ = one_step_asd.Pairs(made, 0.0, config).make(0)
        first, before_first = ~has_previous.flatten(), previous.flatten(1).abs().sum(1) == 0
        self.assertTrue(0.1 < first.float().mean() < 0.6)
        for i in range(64):
            s, n = next((s, n) for s in made for n in range(3) if torch.equal(s.buffer[n], this[i]))
            self.assertEqual(bool(first[i]), n == 0)
            self.assertTrue(torch.equal(buffer[i], s.buffer[max(n - 1, 0)]))
            self.assertTrue(torch.equal(truth[i], s.truth[max(n - 1, 0)]))
            self.assertTrue(torch.equal(of_this[i], s.truth[n]))
            self.assertEqual(bool(before_first[i]), n < 2)

    def test_the_engine_loads_the_folder_and_draws_a_frame_with_it(self):
        self.train_asd("model", "--held-out", self.path("frames"))
        self.assertTrue(os.path.exists(self.path("model", "held_out.png")))
        self.assertEqual(read_json(self.path("model", "model_index.json"))["defaults"]["renderer"]["splat_radius"], "auto")
        self.run_engine("inspect", self.path("model"))
        self.run_engine("refine", self.path("frames", "0", "buffer"), "-m", self.path("model"), "-o",
                        self.path("refined"), "--frames", "0:0")
        with Image.open(self.path("refined", "frames", "000000.png")) as picture:
            self.assertEqual(picture.size, (64, 48))

    def test_frames_are_measured_seen_and_beside_from_one_before_and_alone(self):
        self.train_asd("measured_model", "--set", "steps=1")
        self.run_engine("--version")
        for folder in (("held", "0"), ("held", "0", "shifted")):
            draw_drive(self.path(*folder), 7)
            put_path(self.path(*folder))
        # a run that was stopped before its last frame
        stopped = self.path("measures", "seen-refined.runs", "0")
        self.run_engine("refine", self.path("held", "0", "buffer"), "-m", self.path("measured_model"), "-o", stopped,
                        "--seed", "1", "--quiet")
        write_json(os.path.join(stopped, "run.json"),
                   {**read_json(os.path.join(stopped, "run.json")), "state": "running"})
        os.remove(os.path.join(stopped, "frames", "000002.png"))
        with contextlib.redirect_stdout(io.StringIO()) as out:
            measure_frames.main([self.path("held"), "-m", self.path("measured_model"), "-o", self.path("measures")])
        rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in out.getvalue().splitlines()[2:]]
        self.assertEqual([row[:2] for row in rows],
                         [[pose, how] for pose in ("seen", "shifted") for how in ("splats", "refined", "alone")])
        self.assertEqual(rows[0][2:4], rows[3][2:4])  # the same pictures
        self.assertNotEqual(rows[1][2:], rows[2][2:])
        self.assertEqual(len({row[7] for row in rows[:3]}), 1)
        first, alone = (self.path("measures", f"seen-{how}", "0", "color", "000000.png")
                        for how in ("refined", "alone"))
        with open(first, "rb") as a, open(alone, "rb") as b:
            self.assertEqual(a.read(), b.read())


if __name__ == "__main__":
    unittest.main()
