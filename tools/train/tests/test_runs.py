# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What all recipes share: a run that is stopped, gone on with, or begun twice, and what they keep between runs."""
import contextlib
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from unittest import mock

import numpy as np
import torch
from PIL import Image

from recipe import RUN
from semtrain import latents, model_folder, safetensors_file
from semtrain.content import digest, digest_of_folder, keep_made_of
from semtrain.curve import draw_curve
from semtrain.frames import find_drives, splats_of
from semtrain.grids import Grids
from semtrain.json_file import read_json, write_json
from semtrain.nets.vae import AutoencoderKL
from semtrain.run_folder import RunFolder
from semtrain.safetensors_file import read_header
from semtrain.streets import make_street
from test_recipes_asd import VAE, draw_drive, put_radius
from test_transformer import TINY, train, write_street

ENVIRONMENT = {**os.environ, "PYTHON": os.environ.get("PYTHON", "/usr/bin/python3")}


class InAFolder(unittest.TestCase):
    def setUp(self):
        self.holder = tempfile.TemporaryDirectory()

    def tearDown(self):
        self.holder.cleanup()

    def path(self, *parts):
        return os.path.join(self.holder.name, *parts)


class ARun(InAFolder):
    def setUp(self):
        super().setUp()
        write_street(self.path("a.sgrid"))

    def start(self, steps, folder="run"):
        return subprocess.Popen(
            [RUN, "transformer", "--config", "small", "-o", self.path(folder), "--threads", "1", "--grids",
             self.path("a.sgrid"), *TINY, "--set", f"steps={steps}", "--set", "save_minutes=0.0001"],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=ENVIRONMENT)

    def when_it_has_saved(self, started, folder="run"):
        for _ in range(1200):
            if os.path.exists(self.path(folder, "checkpoint.safetensors")):
                return
            self.assertIsNone(started.poll(), "it ended before it saved")
            time.sleep(0.05)
        self.fail("no checkpoint in a minute")

    def step(self, folder="run"):
        return int(read_header(self.path(folder, "checkpoint.safetensors"))[1]["step"])

    def test_that_is_stopped_saves_and_ends_with_130_and_one_that_finishes_with_0(self):
        for number in (signal.SIGTERM, signal.SIGINT):
            folder = f"run-{number}"
            started = self.start(100000, folder)
            self.when_it_has_saved(started, folder)
            started.send_signal(number)
            out = started.communicate(timeout=60)[0]
            self.assertEqual(started.returncode, 130, out)
            self.assertIn(f"stopped at step {self.step(folder)} of 100000; the same command goes on", out)
            finished = self.start(self.step(folder) + 2, folder)
            finished.communicate(timeout=60)
            self.assertEqual(finished.returncode, 0)

    def test_is_the_only_one_in_its_folder(self):
        first = self.start(100000)
        try:
            self.when_it_has_saved(first)
            second = self.start(100000)
            out = second.communicate(timeout=60)[0]
            self.assertEqual(second.returncode, 1)
            self.assertIn(f"another process trains in {self.path('run')}", out)
        finally:
            first.kill()
            first.communicate()
        RunFolder(self.path("run")).release()  # the lock is gone with its process

    def test_goes_on_with_its_own_settings_alone(self):
        train(self.path("a.sgrid"), self.path("run"), 2)
        for name, value in (("learning_rate", "0.1"), ("seed", "99"), ("batch", "3"), ("set_size", "[5,6]")):
            with self.assertRaisesRegex(AssertionError, f"was begun with {name} = .*, now it is"):
                train(self.path("a.sgrid"), self.path("run"), 4, "--set", f"{name}={value}")
            self.assertEqual(self.step(), 2)
            self.assertNotEqual(str(read_json(self.path("run/config.json"))[name]), value)
        train(self.path("a.sgrid"), self.path("run"), 4, "--set", "mantissa_bits=6", "--set", "minutes=9")
        self.assertEqual(self.step(), 4)

    def test_draws_no_curve_where_matplotlib_is_not_installed(self):
        with open(self.path("log.jsonl"), "w") as file:
            file.write('{"step": 1, "loss": 1}\n{"step": 2, "loss": 0.5}\n')
        with mock.patch.dict(sys.modules, {"matplotlib": None}), contextlib.redirect_stdout(io.StringIO()) as out:
            draw_curve(self.path("log.jsonl"), self.path("curve.png"))
        self.assertIn("curve.png is not drawn: matplotlib is not installed", out.getvalue())
        self.assertFalse(os.path.exists(self.path("curve.png")))
        draw_curve(self.path("log.jsonl"), self.path("curve.png"))
        self.assertTrue(os.path.exists(self.path("curve.png")))


def with_bytes_of_another_time(path, change):
    """changes a file, and leaves its size and the time of its last change as they were"""
    before = os.stat(path)
    change(path)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


class WhatIsKept(InAFolder):
    def test_has_keys_of_contents(self):
        for name, text in (("a", "1"), ("b", "2"), ("c", "1")):
            with open(self.path(name), "w") as file:
                file.write(text)
        a, b, c, none = (self.path(name) for name in ("a", "b", "c", "none"))
        self.assertEqual(digest([a, b]), digest([c, b]))
        keys = [digest(paths, about) for paths, about in
                (([a], ""), ([b], ""), ([a, b], ""), ([b, a], ""), ([a], "x"), ([a, none], ""), ([none], ""))]
        self.assertEqual(len(set(keys)), len(keys))

    def test_of_grids_is_made_anew_when_points_or_objects_change(self):
        grid = self.path("a.sgrid")
        write_street(grid)
        first = Grids([grid], self.path("cache"))
        self.assertTrue((first.owners < 0).all())

        def redden(path):
            t, metadata = safetensors_file.read(path), read_header(path)[1]
            t["colors"][:] = torch.tensor([255, 0, 0], dtype=torch.uint8)
            safetensors_file.write(path, t, metadata)

        with_bytes_of_another_time(grid, redden)
        again = Grids([grid], self.path("cache"))
        colors = again.tokens.astype(np.float32).reshape(-1, 6)[:, 3:]
        np.testing.assert_allclose(colors, np.broadcast_to([1, -1, -1], colors.shape), atol=1e-3)
        self.assertFalse(np.array_equal(first.tokens, again.tokens))  # who has the former ones mapped keeps them
        write_json(self.path("objects.json"), {"format": "semrover.objects", "version": 1, "objects": [
            {"class": "building", "center": [1.8, 3.9, 0.9], "size": [3.6, 0.6, 1.8], "heading": 0}]})
        self.assertTrue((Grids([grid], self.path("cache")).owners >= 0).any())

    def test_of_pictures_is_encoded_anew_when_one_of_them_changes(self):
        torch.manual_seed(1)
        vae = AutoencoderKL(VAE)
        model_folder.write_component(self.path("vae"), vae.config_json(), vae.state_dict())
        draw_drive(self.path("frames", "0"), 1)

        def buffers():
            return latents.sequences(self.path("vae"), find_drives(self.path("frames")), self.path("cache"),
                                     {"device": "cpu", "encode_batch": 2}, False)[0]

        first, files = buffers(), os.listdir(self.path("cache"))
        self.assertTrue(torch.equal(buffers().buffer[:], first.buffer[:]))
        self.assertEqual(os.listdir(self.path("cache")), files)
        for part, kept in (("buffer/color", "buffer"), ("buffer/visible", "visible"), ("color", "truth")):
            before = getattr(buffers(), kept)[:]

            def blacken(path):
                with Image.open(path) as picture:
                    Image.new(picture.mode, picture.size).save(path)

            with_bytes_of_another_time(self.path("frames", "0", part, "000001.png"), blacken)
            changed = (getattr(buffers(), kept)[:] != before).flatten(1).any(1)
            self.assertEqual(changed.tolist(), [False, True, False], part)


class Results(InAFolder):
    def test_of_other_inputs_are_refused_by_name(self):
        keep_made_of(self.path("out"), {"model a": "1", "cuts": "2"})
        keep_made_of(self.path("out"), {"model a": "1", "model b": "3"})  # one more
        for about, line in (({"model b": "4"}, "with model b 3, now it is 4"), ({"cuts": "3"}, "with cuts 2, now")):
            with self.assertRaisesRegex(SystemExit, f"out was made {line}"):
                keep_made_of(self.path("out"), about)
        self.assertEqual(read_json(self.path("out/made_of.json")), {"model a": "1", "model b": "3", "cuts": "2"})

    def test_of_a_folder_are_named_by_all_of_its_files(self):
        def put(name, text):
            os.makedirs(os.path.dirname(self.path("of", name)), exist_ok=True)
            with open(self.path("of", name), "w") as file:
                file.write(text)
            return digest_of_folder(self.path("of"))
        keys = [put("a", "1"), put("b/c", "1"), put("b/c", "2"), put("b/d", "2")]
        self.assertEqual(len(set(keys)), 4)
        self.assertEqual(put("b/d", "2"), keys[-1])

    def test_a_street_of_another_length_or_placement_is_not_taken_for_what_was_asked(self):
        write_street(self.path("truth.sgrid"))
        with mock.patch("semtrain.streets.semrover") as engine:
            self.assertFalse(make_street(self.holder.name, 1, 60, placement="canonical"))
            for length, placement in ((40, "canonical"), (60, "shifted")):
                with self.assertRaisesRegex(SystemExit, "was made with (length 60.0|placement canonical), now it is"):
                    make_street(self.holder.name, 1, length, placement=placement)
            engine.assert_not_called()


class SplatsOfBuffers(InAFolder):
    def drives(self, *radii):
        for i, radius in enumerate(radii):
            draw_drive(self.path("frames", str(i)), i)
            if radius is not None:
                put_radius(self.path("frames", str(i)), radius)
        return find_drives(self.path("frames"))

    def test_are_what_the_model_says(self):
        drives = self.drives("auto", "auto")
        self.assertEqual(splats_of(drives, {"a": 1, "splat_radius": 0.5}), {"a": 1, "splat_radius": "auto"})
        for i in range(2):
            put_radius(self.path("frames", str(i)), 0.03)
        self.assertEqual(splats_of(drives, {}), {"splat_radius": 0.03})

    def test_of_two_kinds_are_refused(self):
        with self.assertRaisesRegex(SystemExit, "frames/0 was drawn with splat_radius auto, .*frames/1 with 0.04"):
            splats_of(self.drives("auto", 0.04), {})

    def test_of_which_some_are_unknown_are_refused(self):
        with self.assertRaisesRegex(SystemExit, "frames/0 was drawn with splat_radius auto, .*frames/1 with unknown"):
            splats_of(self.drives("auto", None), {})

    def test_that_nobody_knows_are_left_to_the_settings_with_a_line(self):
        with contextlib.redirect_stdout(io.StringIO()) as out:
            self.assertEqual(splats_of(self.drives(None, None), {"splat_radius": "auto"}), {"splat_radius": "auto"})
        self.assertIn("no buffer/run.json says with which --splat-radius", out.getvalue())


class AComponentOfOtherPrograms(InAFolder):
    def write(self, rename=lambda name: name, file=model_folder.WEIGHTS):
        torch.manual_seed(1)
        vae = AutoencoderKL({**VAE, "mid_block_add_attention": True})
        model_folder.write_component(self.path("vae"), vae.config_json(), vae.state_dict())
        state = safetensors_file.read(self.path("vae", model_folder.WEIGHTS))
        os.remove(self.path("vae", model_folder.WEIGHTS))
        renamed = {rename(name): t for name, t in state.items()}
        safetensors_file.write(self.path("vae", file), renamed)
        return state, renamed

    def test_may_have_the_names_that_attention_had_in_2022(self):
        def old(name):
            for now, then in (("to_q", "query"), ("to_k", "key"), ("to_v", "value"), ("to_out.0", "proj_attn")):
                name = name.replace(f".{now}.", f".{then}.")
            return name

        state, renamed = self.write(old)
        self.assertEqual(len(state.keys() - renamed.keys()), 16)  # four layers each of encoder and decoder
        loaded = latents.load_vae(self.path("vae")).state_dict()
        for name, tensor in state.items():
            self.assertTrue(torch.equal(loaded[name], tensor.float()), name)

    def test_may_have_fp16_weights_alone(self):
        state, _ = self.write(file="diffusion_pytorch_model.fp16.safetensors")
        loaded = latents.load_vae(self.path("vae")).state_dict()
        self.assertTrue(all(torch.equal(loaded[name], tensor.float()) for name, tensor in state.items()))

    def test_in_another_file_is_refused_with_what_reads_it(self):
        self.write(file="diffusion_pytorch_model-00001-of-00001.safetensors")
        with self.assertRaisesRegex(SystemExit, "vae: expected diffusion_pytorch_model.safetensors or .*fp16.*convert"):
            latents.load_vae(self.path("vae"))


if __name__ == "__main__":
    unittest.main()
