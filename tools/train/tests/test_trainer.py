# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""What does not change a run: how its batches are divided, among how many processes, what is computed again, and when
it was killed."""
import contextlib
import io
import json
import multiprocessing
import os
import random
import re
import signal
import socket
import subprocess
import sys
import time
import unittest
from unittest import mock

import torch
from torch.nn import functional as F

from recipe import RUN
from semtrain import asd, latents, memory, model_folder, processes, safetensors_file, settings, transformer, vae, vsd
from semtrain.draws import Draws
from semtrain.frames import find_drives
from semtrain.grids import Grids, LocalSets
from semtrain.json_file import read_json, write_json
from semtrain.nets import attention, recompute
from semtrain.nets.transformer import VoxfieldTransformer
from semtrain.run_folder import RunFolder
from semtrain.trainer import Trainer
from test_recipes_asd import ASD, VAE, draw_drive
from test_recipes_vsd import VSD
from test_runs import ENVIRONMENT, InAFolder
from test_transformer import TINY, write_street

FORK = multiprocessing.get_context("fork")  # no import of torch a process


class Attention(unittest.TestCase):
    def test_by_the_fused_kernel_is_what_it_is_written_out(self):
        private = getattr(F, "_scaled_dot_product_attention", None)  # what PyTorch 1.13 has under this name alone
        fused = getattr(F, "scaled_dot_product_attention", None) or (lambda q, k, v, mask: private(q, k, v, mask)[0])
        torch.manual_seed(1)
        q, k, v = (torch.randn(2, 3, n, 16, requires_grad=True) for n in (20, 30, 30))
        masked = torch.zeros(2, 1, 20, 30).masked_fill_(torch.rand(2, 1, 20, 30) < 0.5, -1e9)
        for q, k, v, mask in ((q, k, v, None), (q, k, v, masked), (q[:, 0], k[:, 0], v[:, 0], None)):
            with mock.patch.object(F, "scaled_dot_product_attention", fused, create=True):
                found = self.result(attention.fused, q, k, v, mask)
            for a, b in zip(found, self.result(attention.written_out, q, k, v, mask)):
                torch.testing.assert_close(a, b, atol=2e-6, rtol=1e-5)
        self.assertEqual(attention.attention_of is attention.fused, hasattr(F, "scaled_dot_product_attention"))

    @staticmethod
    def result(function, *arguments):
        out = function(*arguments)
        return [out, *torch.autograd.grad(out.square().sum(), arguments[:3])]


class Draw(unittest.TestCase):
    def test_gives_a_part_the_numbers_that_it_has_in_the_batch(self):
        def drawn(part):
            own = Draws(torch.Generator().manual_seed(3), 6, part)
            return own.normal((5, 7)), own.uniform(), own.below(1000)
        for whole, *parts in zip(*(drawn(part) for part in (None, range(0, 2), range(2, 6)))):
            self.assertTrue(torch.equal(whole, torch.cat(parts)))


class Recompute(unittest.TestCase):
    def check(self, model, loss):
        """its loss and gradients are the same, and each of its blocks is computed once more"""
        def result():
            model.zero_grad()
            loss(model).backward()
            return [p.grad.clone() for p in model.parameters() if p.grad is not None]
        expected, runs = result(), []
        for block in recompute.blocks_of(model):
            block.register_forward_hook(lambda *_: runs.append(None))
            block.forward = mock.Mock(side_effect=block.forward)
        blocks = list(recompute.blocks_of(model))
        inner = [block.forward for block in blocks]
        recompute.recompute_blocks(model)
        for a, b in zip(result(), expected, strict=True):
            self.assertTrue(torch.equal(a, b))
        self.assertTrue(blocks and all(forward.call_count == 2 for forward in inner))
        self.assertEqual(len(runs), len(blocks))

    def setUp(self):
        torch.manual_seed(1)

    def test_of_the_transformer_changes_nothing(self):
        model, x = VoxfieldTransformer(2, 2, 16, 4, pos_embed_dim=8), torch.randn(2, 9, 24)
        centers, valid = torch.randn(2, 9, 3).double(), torch.ones(2, 9, dtype=torch.bool)
        self.check(model, lambda m: (m(x, torch.ones(2, 9).long(), centers, valid, torch.tensor([3, 500])) - x)
                   .square().mean())

    def test_of_the_renderers_and_the_vae_changes_nothing(self):
        latents, shares, t = torch.randn(3, 2, 4, 6, 6), torch.rand(2, 1, 6, 6), torch.tensor([3, 500])
        self.check(asd.Renderer(ASD), lambda m: m(*latents, shares, t).square().mean())
        videos, shares, sigma = torch.randn(2, 2, 3, 4, 6, 6), torch.rand(2, 3, 1, 6, 6), torch.tensor([0.1, 2])
        self.check(vsd.Renderer(VSD), lambda m: m(*videos, shares, sigma).square().mean())
        image = torch.randn(2, 3, 16, 16)
        self.check(vae.AutoencoderKL({**VAE, "mid_block_add_attention": True}),
                   lambda m: (m.decode(m.moments(image)[0]) - image).square().mean())

    def test_of_a_network_without_such_blocks_is_refused(self):
        with self.assertRaisesRegex(SystemExit, "recompute: this network has no block of these: JointBlock"):
            recompute.recompute_blocks(torch.nn.Linear(2, 2))


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def in_process(environment, output, function, *arguments):
    """what a process that was forked does: the function, its output to a file"""
    os.environ.update(environment)
    with open(output, "w", buffering=1) as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
        sys.stdout = sys.stderr = file
        try:
            function(*arguments)
        except SystemExit as end:
            if isinstance(end.code, str):
                print(end.code)
            os._exit(end.code if isinstance(end.code, int) else 1)
        os._exit(0)


class ARun(InAFolder):
    """of a tiny transformer"""

    def setUp(self):
        super().setUp()
        write_street(self.path("a.sgrid"))
        write_street(self.path("held.sgrid"), seed=1)
        torch.set_num_threads(1)

    def words(self, folder, *more):
        return ["transformer", "--config", "small", "-o", self.path(folder), "--threads", "1", "--grids",
                self.path("a.sgrid"), *TINY, "--set", "steps=12", "--set", "known_share=0.5", *more]

    def train(self, folder, *more):
        with mock.patch.object(sys, "argv", self.words(folder, *more)):
            transformer.main()

    def trained(self, folder, *more):
        """-> {name: tensor} of its checkpoint, and the rows of its log"""
        with contextlib.redirect_stdout(io.StringIO()):
            self.train(folder, *more)
        return self.state(folder)

    def state(self, folder):
        with open(self.path(folder, "log.jsonl")) as file:
            return safetensors_file.read(self.path(folder, "checkpoint.safetensors")), [json.loads(x) for x in file]

    def start(self, environments, *arguments, train=None):
        """a process for each -> [(process, file of what it prints)]"""
        started = []
        for i, environment in enumerate(environments):
            output = self.path(f"output{time.monotonic_ns()}-{i}")
            open(output, "w").close()
            process = FORK.Process(target=in_process, args=(environment, output, train or self.train, *arguments))
            process.start()
            started.append((process, output))
        return started

    def finish(self, started):
        """-> [(exit code, what it printed)]"""
        out = []
        for process, output in started:
            process.join(60)
            if process.is_alive():
                process.kill()
            with open(output) as file:
                out.append((process.exitcode, file.read()))
        return out

    def two(self):
        """environments of two processes as torchrun gives them"""
        common = {"WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(free_port())}
        return [{**common, "RANK": str(i), "LOCAL_RANK": str(i)} for i in range(2)]

    def two_by_srun(self):
        common = {"SLURM_JOB_ID": str(free_port()), "SLURM_STEP_ID": "0", "SLURM_STEP_NUM_TASKS": "2",
                  "SLURM_STEP_NODELIST": "localhost"}
        return [{**common, "SLURM_PROCID": str(i), "SLURM_LOCALID": str(i)} for i in range(2)]

    def assert_equal(self, found, expected, tolerance=0.0):
        self.assertEqual(set(found), set(expected))
        for name, tensor in expected.items():
            torch.testing.assert_close(found[name], tensor, atol=tolerance, rtol=0, msg=name)

    def test_accumulates_what_the_whole_batch_gives(self):
        whole, log = self.trained("whole")
        for parts in (2, 4):
            found, found_log = self.trained(f"in{parts}", "--set", f"accumulate={parts}", "--set",
                                            f"workers={parts // 4}")
            # sums in another order; Adam's first steps, which divide by the gradient, make more of that
            self.assert_equal(found, whole, 2e-5)
            self.assertAlmostEqual(found_log[-1]["loss"], log[-1]["loss"], 5)
        with self.assertRaisesRegex(SystemExit, "batch 4: expected a multiple of 3, 1 processes times 3"):
            self.trained("in3", "--set", "accumulate=3")

    def test_by_two_processes_has_the_bits_of_two_parts_and_goes_on_with_one(self):
        parts, log = self.trained("parts", "--set", "accumulate=2")
        for by, environments in (("torchrun", self.two()), ("srun", self.two_by_srun())):
            started = self.start(environments, by)
            (code, out), other = self.finish(started)
            self.assertEqual((code, other), (0, (0, "")), out)
            found, found_log = self.state(by)
            self.assert_equal(found, parts)
            self.assertEqual([row["loss"] for row in found_log], [row["loss"] for row in log])
        self.trained("resumed", "--set", "minutes=0.000001", "--set", "accumulate=2")
        begun = self.finish(self.start(self.two(), "resumed", "--set", "minutes=0.000001"))
        self.assertEqual([code for code, _ in begun], [0, 0])
        found = self.trained("resumed", "--set", "accumulate=2")[0]
        self.assert_equal(found, parts)
        self.assertEqual([row["step"] for row in self.state("resumed")[1]], [1, 2, 12])

    def test_of_a_renderer_by_two_processes_has_the_bits_of_two_parts(self):
        torch.manual_seed(1)
        autoencoder = vae.AutoencoderKL(VAE)
        model_folder.write_component(self.path("vae"), autoencoder.config_json(), autoencoder.state_dict())
        for i in range(2):
            draw_drive(self.path("frames", str(i)), i)
        write_json(self.path("asd.json"), ASD)

        def train(folder, *more):
            asd.main(["-o", self.path(folder), "--config", self.path("asd.json"), "--threads", "1", "--frames",
                      self.path("frames"), "--vae", self.path("vae"), *more])
        with contextlib.redirect_stdout(io.StringIO()):
            train("parts", "--set", "accumulate=2")
        with mock.patch.object(processes, "SMALL", 256):  # some go together, others each alone
            (code, out), other = self.finish(self.start(self.two(), "two", train=train))
        self.assertEqual((code, other), (0, (0, "")), out)
        self.assert_equal(self.state("two")[0], self.state("parts")[0])
        encoded = [safetensors_file.read(self.path(folder, "latents", name)) for folder in ("parts", "two")
                   for name in sorted(os.listdir(self.path(folder, "latents")))]
        self.assertEqual(len(encoded), 2 * 4)
        for one, both in zip(encoded[:4], encoded[4:]):
            self.assert_equal(both, one)
        with open(self.path("frames", "1", "color", "000001.png"), "r+b") as file:
            file.truncate(60)
        (code, out), (other, more) = self.finish(self.start(self.two(), "broken", train=train))
        self.assertEqual((code, other), (1, 1), out + more)  # which one of them read it

    def test_is_started_by_torchrun(self):
        torchrun = ["-m", "torch.distributed.run", "--standalone", "--nproc_per_node=2", "--no_python",
                    "--redirects=2", "--tee=2", RUN]  # PyTorch 1.13 under Python 3.11 trips over its own defaults
        done = subprocess.run([ENVIRONMENT["PYTHON"], *torchrun, *self.words("run", "--set", "accumulate=2")],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=ENVIRONMENT)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertEqual(done.stdout.count("step 12 "), 1, done.stdout)
        self.assert_equal(self.state("run")[0], self.trained("alone", "--set", "accumulate=4")[0], 2e-5)

    def test_by_two_processes_stops_at_one_step_when_one_of_them_is_told_to(self):
        started = self.start(self.two(), "run", "--set", "steps=100000", "--set", "save_minutes=0")
        while not os.path.exists(self.path("run", "checkpoint.safetensors")):
            self.assertTrue(started[0][0].is_alive())
            time.sleep(0.02)
        os.kill(started[1][0].pid, signal.SIGTERM)
        (code, out), other = self.finish(started)
        self.assertEqual((code, other), (130, (130, "")), out)
        self.assertIn("stopped at step", out)

    def test_by_two_processes_is_refused_in_both_where_it_is_in_one(self):
        self.trained("run")
        with open(os.devnull, "w") as file, contextlib.redirect_stderr(file):
            (code, out), other = self.finish(self.start(self.two(), "run", "--set", "learning_rate=0.1"))
        self.assertEqual((code, other), (1, (1, "")))
        self.assertIn("was begun with learning_rate", out)

    def test_that_is_killed_at_any_moment_ends_as_one_that_was_not(self):
        draw, kills, resumed_at = random.Random(1), int(os.environ.get("KILLS", "6")), set()
        steps, path = ["--set", f"steps={20 * kills}", "--set", "keep=3"], self.path("killed", "checkpoint.safetensors")
        whole, _ = self.trained("whole", *steps)
        for kill in range(kills):
            started = self.start([{}], "killed", *steps, "--set", "save_minutes=0")
            for _ in range(kill % 4):  # some before the first checkpoint, some while later ones are written
                before = os.stat(path).st_ino if os.path.exists(path) else 0
                while (os.stat(path).st_ino if os.path.exists(path) else 0) == before:
                    self.assertTrue(started[0][0].is_alive())
                    time.sleep(0.002)
            time.sleep(draw.uniform(0, 0.03 if kill % 4 else 0.3))
            started[0][0].kill()
            (code, out), = self.finish(started)
            self.assertEqual(code, -signal.SIGKILL, out)
            resumed_at.update(re.findall(r"continuing .* at step (\d+)", out))
        self.assertEqual(self.finish(self.start([{}], "killed", *steps))[0][0], 0)
        self.assert_equal(self.state("killed")[0], whole)
        self.assertGreater(len(resumed_at), kills / 3)

    def test_keeps_as_many_checkpoints_as_it_is_told_to(self):
        def kept():
            return sorted(name for name in os.listdir(self.path("run")) if name.endswith(".safetensors"))
        place = RunFolder(self.path("run"))
        for step in range(1, 6):
            place.write_checkpoint({"a": torch.tensor([step])}, step, 3)
        self.assertEqual(kept(), ["checkpoint-000000003.safetensors", "checkpoint-000000004.safetensors",
                                  "checkpoint.safetensors"])
        self.assertEqual(int(safetensors_file.read(self.path("run", "checkpoint-000000004.safetensors"))["a"]), 4)
        place.write_checkpoint({"a": torch.tensor([6])}, 6, 1)
        self.assertEqual(kept(), ["checkpoint.safetensors"])

    def test_logs_the_loss_of_what_it_does_not_train_on(self):
        for folder, steps in (("a", 1), ("b", 150)):
            self.trained(folder, "--held-out", self.path("held.sgrid"), "--set", f"steps={steps}", "--set", "ema=0.9",
                         "--set", "learning_rate=0.003")
        first, last = (self.state(folder)[1][-1] for folder in "ab")
        self.assertEqual((set(first), last["step"]), ({"step", "held_out"}, 150))
        self.assertLess(last["held_out"], 0.7 * first["held_out"])
        # with the averaged weights, which the training goes on without
        config = read_json(self.path("b", "config.json"))
        model = VoxfieldTransformer(**config["network"])
        held = transformer.loss_of(LocalSets(Grids([self.path("held.sgrid")], self.path("c")), config), config)
        with contextlib.redirect_stdout(io.StringIO()):
            trainer = Trainer(self.path("b"), model, config, None)
        before = {name: p.clone() for name, p in model.named_parameters()}
        self.assertAlmostEqual(trainer._held_out_loss(held), last["held_out"], 6)
        self.assert_equal(dict(model.named_parameters()), before)
        model.load_state_dict(trainer.average)
        self.assertAlmostEqual(sum(float(held(model, step)[0]) for step in range(8)) / 8, last["held_out"], 6)

    def test_shows_what_it_logs_in_tensorboard_where_that_is_installed(self):
        with mock.patch.dict(sys.modules, {"torch.utils.tensorboard": None}):
            with self.assertRaisesRegex(SystemExit, "tensorboard=true: .*; pip install tensorboard"):
                self.trained("without", "--set", "tensorboard=true")
        board = mock.Mock()
        with mock.patch.dict(sys.modules, {"torch.utils.tensorboard": board}):
            log = self.trained("with", "--set", "tensorboard=true")[1]
        board.SummaryWriter.assert_called_once_with(self.path("with", "tensorboard"))
        shown = {call.args for call in board.SummaryWriter().add_scalar.call_args_list}
        self.assertEqual(shown, {(name, value, row["step"]) for row in log for name, value in row.items()
                                 if name != "step"})


class AStep(InAFolder):
    def gradients(self, model, loss, parts):
        """-> the loss and the gradients of a step, summed over its parts"""
        model.zero_grad()
        losses = [loss(model, 3, part)[0] / len(parts) for part in parts]
        for of_part in losses:
            of_part.backward()
        return [sum(float(x) for x in losses)] + [p.grad.clone() for p in model.parameters() if p.grad is not None]

    def check(self, model, loss, batch):
        whole = self.gradients(model, loss, [range(batch)])
        halves = [range(0, batch // 2), range(batch // 2, batch)]
        for found, expected in zip(self.gradients(model, loss, halves), whole, strict=True):
            torch.testing.assert_close(found, expected, atol=1e-6, rtol=1e-4)

    def test_of_the_renderers_and_the_vae_is_what_its_parts_come_to(self):
        torch.manual_seed(1)
        drive = latents.Sequence([{"truth": torch.randn(4, 4, 8, 8), "buffer": torch.randn(4, 4, 8, 8),
                                   "visible": torch.rand(4, 1, 8, 8)}], [True, False, False, False])
        self.check(asd.Renderer(ASD), asd.loss_of(asd.Batches([drive], ASD), ASD), 4)
        self.check(vsd.Renderer(VSD), vsd.loss_of(vsd.Batches([drive], VSD, {"scaling_factor": 0.5}), VSD), 2)
        draw_drive(self.path("frames"), 1)
        self.check(vae.AutoencoderKL(VAE), vae.loss_of(vae.Pictures(find_drives(self.path("frames"))), VAE), 4)

    def test_of_a_network_with_batch_norms_is_not_divided(self):
        config = {**settings.COMMON, "batch": 4, "accumulate": 2, "steps": 1, "learning_rate": 1}
        with self.assertRaisesRegex(SystemExit, "this network has batch norms"):
            Trainer(self.path("run"), torch.nn.BatchNorm1d(3), config, None)


class Memory(unittest.TestCase):
    def test_of_the_renderers_at_the_papers_sizes_is_that_of_one_card(self):
        for recipe, most in (("asd", 22), ("vsd", 76)):
            config = settings.resolve(recipe, settings.parser(recipe, "").parse_args(["-o", "", "--threads", "1"]))
            fixed, activations = memory.bytes_of(recipe, config)
            held = {how: (sum(fixed.values()) + size) / memory.GIB for how, size in activations.items()}
            self.assertLess(held["attention fused, blocks recomputed"], most)
            self.assertGreater(held["attention fused"], most)
            if recipe == "asd":
                text = 77 * 768
                self.assertEqual(fixed, {"weights": 4 * (859546884 + text), "gradients": 4 * 859546884,
                                         "Adam": 8 * 859546884, "average": 4 * (859546884 + text)})

    def test_of_attention_is_its_matrix(self):
        with memory.OnMeta():
            q, k, v = (torch.empty(2, 3, n, 8, requires_grad=True) for n in (20, 30, 30))
            model = torch.nn.Module()
            model.forward = lambda: attention.attend(q, k, v)
            held = [memory.Kept(model, (), attend).whole() for attend in (attention.written_out,
                                                                          memory.FusedAttention.apply)]
        rows = 2 * 3 * 4
        both = rows * 8 * (20 + 30 + 30)
        self.assertAlmostEqual(held[0], both + rows * 20 * 30, delta=8)  # the scale
        self.assertEqual(held[1], both + rows * (20 * 8 + 20))


class Places(unittest.TestCase):
    SRUN = {"SLURM_JOB_ID": "1234", "SLURM_STEP_ID": "2", "SLURM_STEP_NUM_TASKS": "16", "SLURM_PROCID": "9",
            "SLURM_LOCALID": "1", "SLURM_STEP_NODELIST": "gpu[07,09-10],cpu1"}

    def test_are_what_the_launcher_says(self):
        found = processes.rendezvous(self.SRUN)
        self.assertEqual({**found, "MASTER_PORT": None}, {"RANK": "9", "WORLD_SIZE": "16", "LOCAL_RANK": "1",
                                                          "MASTER_ADDR": "gpu07", "MASTER_PORT": None})
        given = {"MASTER_ADDR": "10.0.0.1", "MASTER_PORT": "29500"}
        self.assertLess(given.items(), processes.rendezvous({**self.SRUN, **given}).items())
        other = processes.rendezvous({**self.SRUN, "SLURM_STEP_ID": "3"})
        self.assertNotEqual(other["MASTER_PORT"], found["MASTER_PORT"])
        self.assertEqual(processes.rendezvous({"SLURM_NTASKS": "16", "SLURM_PROCID": "0"}), {})  # a batch script
        torchrun = {"RANK": "1", "WORLD_SIZE": "2", "LOCAL_RANK": "1", "MASTER_ADDR": "n1", "MASTER_PORT": "1"}
        self.assertEqual(processes.rendezvous({**self.SRUN, **torchrun}), torchrun)

    def test_of_nodes_are_read_from_slurms_short_form(self):
        for nodes, first in (("n1", "n1"), ("gpu[07-09,12],login", "gpu07"), ("a-[1,3]-ib", "a-1-ib"),
                             ("r[2-3]n[05-08]", "r2n05"), ("b,a[1-2]", "b")):
            self.assertEqual(processes.first_host(nodes), first)


if __name__ == "__main__":
    unittest.main()
