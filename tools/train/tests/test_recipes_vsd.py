# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The recipe vsd on two made drives of three frames of 64 x 48."""
import contextlib
import io
import json
import os
import subprocess
import tempfile
import unittest

import torch
from PIL import Image

from semtrain import safetensors_file, vae, vsd
from semtrain.draws import draws
from semtrain.frames import find_drives
from semtrain.latents import load_vae, sequences
from semtrain.nets.video_unet import UNetSpatioTemporalConditionModel
from semtrain.nets.video_vae import AutoencoderKLTemporalDecoder
from semtrain.trainer import CHECKPOINT
from test_recipes_asd import COMMON, VAE, draw_drive

VSD = {**COMMON, "in_channels": 9, "out_channels": 4, "block_out_channels": [32, 32], "layers_per_block": 1,
       "down_block_types": ["DownBlockSpatioTemporal", "CrossAttnDownBlockSpatioTemporal"],
       "up_block_types": ["CrossAttnUpBlockSpatioTemporal", "UpBlockSpatioTemporal"], "num_attention_heads": [1, 2],
       "cross_attention_dim": 8, "addition_time_embed_dim": 8, "projection_class_embeddings_input_dim": 24,
       "num_frames": 3, "text_tokens": 1, "train_text": True, "crop": [6, 6], "batch": 2, "mirror": True,
       "dropout": 0.3, "sigma_mean": 0.7, "sigma_deviation": 1.6,
       "defaults": {"num_inference_steps": 2, "guidance_scale": 1.5, "first_guidance_scale": 1.0, "window_frames": 2,
                    "window_overlap": 1, "decode_frames": 2, "added_time_ids": [6, 127, 0.02]}}


class Recipes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.holder = tempfile.TemporaryDirectory()
        cls.folder = cls.holder.name
        for i in range(2):
            draw_drive(cls.path("frames", str(i)), i)
        for name, config in (("vae", VAE), ("vsd", VSD)):
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

    def train_vsd(self, output, *more):
        self.train(vsd, "vsd", output, "--vae", self.path("of_vae", "vae"), *more)

    def state(self, output):
        return safetensors_file.read(self.path(output, CHECKPOINT))

    def batches(self, **changes):
        all_sequences = sequences(self.path("of_vae", "vae"), find_drives(self.path("frames")), self.path("measured"),
                                  VSD)
        return vsd.Batches(all_sequences, {**VSD, **changes}, load_vae(self.path("of_vae", "vae")).config)

    def test_it_learns_what_it_sees(self):
        self.train_vsd("learned", "--set", "steps=60")
        batches = self.batches()
        torch.manual_seed(1)
        model = vsd.Renderer(VSD)

        def error():
            return sum(float(vsd.step_loss(model, batches.make(s), VSD, draws(VSD, s, 1))[0])
                       for s in range(1000, 1008))
        with torch.no_grad():
            before = error()
            model.load_state_dict({n[6:]: t for n, t in self.state("learned").items() if n.startswith("model.")})
            self.assertLess(error(), 0.75 * before)

    def test_a_batch_has_windows_of_frames_in_a_row_and_hides_the_visibility_of_some(self):
        truth, buffer, visible = self.batches(batch=64).make(0)
        self.assertEqual(tuple(truth.shape), (64, 3, 4, 6, 6))
        hidden = visible.flatten(1).abs().sum(1) == 0
        self.assertTrue(0.15 < hidden.float().mean() < 0.45)
        self.assertGreater(float(buffer[hidden].abs().min(0).values.max()), 0)
        all_sequences = sequences(self.path("of_vae", "vae"), find_drives(self.path("frames")), self.path("measured"),
                                  VSD)
        self.assertEqual(len(self.batches(num_frames=2).starts), 2 * len(all_sequences))
        all_sequences[0].first[1] = True  # a frame is missing in front of it
        whole = vsd.Batches(all_sequences, {**VSD, "num_frames": 2}, {"scaling_factor": 1.0})
        self.assertEqual(len(whole.starts), 2 * len(all_sequences) - 1)

    def test_buffers_are_seen_as_the_vae_gives_them(self):
        autoencoder = load_vae(self.path("of_vae", "vae"))
        image = torch.rand(1, 3, 48, 64) * 2 - 1
        with torch.no_grad():
            back = vsd.unscaled(autoencoder.encode_scaled(image), autoencoder.config)
            self.assertLess(float((back - autoencoder.moments(image)[0]).abs().max()), 1e-4)

    def test_a_run_that_is_continued_has_the_weights_of_one_that_was_not_interrupted(self):
        self.train_vsd("whole", "--set", "steps=4")
        self.train_vsd("parts", "--set", "steps=2")
        self.train_vsd("parts", "--set", "steps=4")
        whole, parts = self.state("whole"), self.state("parts")
        self.assertEqual(set(whole), set(parts))
        self.assertEqual([n for n in whole if not torch.equal(whole[n], parts[n])], [])

    def test_it_widens_a_plain_video_unet_with_zeros_and_keeps_the_images_channels(self):
        self.train_vsd("plain", "--set", "steps=1")
        file = self.path("plain", "renderer", "diffusion_pytorch_model.safetensors")
        narrow = safetensors_file.read(file)
        narrow["conv_in.weight"] = narrow["conv_in.weight"][:, :8]
        safetensors_file.write(file, narrow)
        config = dict(VSD)
        wide = vsd.read_init(self.path("plain"), config)["unet.conv_in.weight"]
        self.assertEqual(tuple(wide.shape), (32, 9, 3, 3))
        self.assertTrue(torch.equal(wide[:, :8], narrow["conv_in.weight"].float()))
        self.assertEqual(float(wide[:, 8:].abs().max()), 0)

    def put_svd(self, folder):
        """Stable Video Diffusion as the hub has it, but narrow: configs with its fields, fp16 files, 8 channels in"""
        unet = {"_class_name": "UNetSpatioTemporalConditionModel", "_diffusers_version": "0.24.0.dev0",
                "addition_time_embed_dim": 8, "block_out_channels": [32, 64], "cross_attention_dim": 16,
                "down_block_types": ["CrossAttnDownBlockSpatioTemporal", "DownBlockSpatioTemporal"], "in_channels": 8,
                "layers_per_block": 1, "num_attention_heads": [2, 4], "num_frames": 25, "out_channels": 4,
                "projection_class_embeddings_input_dim": 24, "sample_size": 96, "transformer_layers_per_block": 1,
                "up_block_types": ["UpBlockSpatioTemporal", "CrossAttnUpBlockSpatioTemporal"]}
        levels = ["DownEncoderBlock2D"] * 4
        of_videos = {"_class_name": "AutoencoderKLTemporalDecoder", "block_out_channels": [32] * 4,
                     "down_block_types": levels, "force_upcast": True, "in_channels": 3, "latent_channels": 4,
                     "layers_per_block": 1, "out_channels": 3, "sample_size": 768, "scaling_factor": 0.18215}
        torch.manual_seed(2)
        for part, config, network in (("unet", unet, UNetSpatioTemporalConditionModel),
                                      ("vae", of_videos, AutoencoderKLTemporalDecoder)):
            os.makedirs(os.path.join(folder, part))
            with open(os.path.join(folder, part, "config.json"), "w") as file:
                json.dump(config, file)
            safetensors_file.write(os.path.join(folder, part, "diffusion_pytorch_model.fp16.safetensors"),
                                   {name: t.half() for name, t in network(config).state_dict().items()})
        return unet

    def test_stable_video_diffusion_as_the_hub_has_it_trains_in_one_command(self):
        unet = self.put_svd(self.path("svd"))
        begin = safetensors_file.read(self.path("svd", "unet", "diffusion_pytorch_model.fp16.safetensors"))
        self.train(vsd, "vsd", "of_svd", "--init", self.path("svd"), "--set", "steps=1", "--set", "learning_rate=0")
        self.assertEqual(os.listdir(self.path("of_svd", "vae")), os.listdir(self.path("svd", "vae")))
        with open(self.path("of_svd", "renderer", "config.json")) as file:
            config = json.load(file)
        self.assertEqual((config["in_channels"], config["num_frames"]), (9, 3))
        for name in ("block_out_channels", "cross_attention_dim", "num_attention_heads", "down_block_types"):
            self.assertEqual(config[name], unet[name])
        made = safetensors_file.read(self.path("of_svd", "renderer", "diffusion_pytorch_model.safetensors"))
        self.assertEqual(set(made), set(begin))
        for name, tensor in made.items():
            kept = tensor[:, :8] if name == "conv_in.weight" else tensor
            self.assertTrue(torch.equal(kept, begin[name]), name)
        self.assertEqual(float(made["conv_in.weight"][:, 8].abs().max()), 0)
        if os.environ.get("SEMROVER"):
            self.refine("of_svd", "svd_refined")

    def test_without_a_vae_it_says_so(self):
        with self.assertRaisesRegex(SystemExit, "--vae is missing$"):
            self.train(vsd, "vsd", "no_vae")
        os.makedirs(self.path("bare"), exist_ok=True)
        with self.assertRaisesRegex(SystemExit, "--vae is missing, and .*bare has no vae/"):
            self.train(vsd, "vsd", "no_vae", "--init", self.path("bare"))

    def refine(self, model, output):
        done = subprocess.run([os.environ["SEMROVER"], "refine", self.path("frames", "0", "buffer"), "-m",
                               self.path(model), "-o", self.path(output), "--json"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["frames"], 3)

    def test_the_engine_loads_the_folder_and_draws_a_drive_with_it(self):
        self.train_vsd("model", "--held-out", self.path("frames"))
        self.assertTrue(os.path.exists(self.path("model", "held_out_2.png")))
        if not os.environ.get("SEMROVER"):
            self.skipTest("SEMROVER names no engine")
        self.refine("model", "refined")
        with Image.open(self.path("refined", "frames", "000002.png")) as picture:
            self.assertEqual(picture.size, (64, 48))


if __name__ == "__main__":
    unittest.main()
