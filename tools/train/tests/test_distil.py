# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
"""The sampler as the recipes know it, and a student that gives in one pass what a teacher gives in several."""
import contextlib
import io
import os
import shutil
import subprocess
import tempfile
import unittest

import torch

import golden
from recipe import run_recipe
from semtrain import adapter, measure_distilled, safetensors_file
from semtrain.distil import Distillation, Teacher
from semtrain.draws import Draws
from semtrain.grids import Grids, LocalSets
from semtrain.json_file import read_json, write_json
from semtrain.model_folder import read_component
from semtrain.nets.transformer import VoxfieldTransformer
from semtrain.program import semrover_path
from semtrain.regenerate import load_transformer
from semtrain.sampler import Guidance, guided_x0, linear_alphas, posterior, steps_of, timesteps_of
from test_transformer import train, write_street

LINEAR = {"_class_name": "DDPMScheduler", "num_train_timesteps": 1000, "beta_start": 1e-4, "beta_end": 0.02,
          "beta_schedule": "linear"}
TINY = ["--config", "distil", "--set", "batch=4", "--set", "set_size=[12,16]", "--set", "warmup=2", "--set",
        "precision=fp32", "--set", "learning_rate=0.002", "--set", "ema=0.9"]


class TheSampler(unittest.TestCase):
    def test_visits_the_timesteps_that_the_engine_does(self):
        self.assertEqual(timesteps_of(1000, 4, "quadratic").tolist(), [999, 561, 249, 61])  # 562.5 to even, less 1
        self.assertEqual(timesteps_of(1000, 4, "trailing").tolist(), [999, 749, 499, 249])
        halved = timesteps_of(1000, 16, "quadratic")
        for _ in range(2):  # a student's are every other one of its teacher's
            halved = halved[::2]
            self.assertEqual(halved.tolist(), timesteps_of(1000, len(halved), "quadratic").tolist())

    def test_steps_as_diffusers_does(self):
        case, t = golden.read_case("scheduler_ddpm_sample")
        alphas = linear_alphas(case["params"]).double()
        x, levels = t["input.sample"].double(), [*alphas[t["expect.timesteps"].long()], torch.ones(()).double()]
        for i, (a, b) in enumerate(zip(levels, levels[1:])):
            of_x0, of_x, variance = posterior(a, b)
            noise = t["input.noise"][i] if i + 2 < len(levels) else 0
            x = of_x0 * t["input.model_outputs"][i].double().clamp(-1, 1) + of_x * x + variance.sqrt() * noise
            torch.testing.assert_close(x, t["expect.states"][i + 1].double(), atol=1e-4, rtol=0)

    def test_adds_what_x0_leaves_out_to_the_fresh_noise(self):
        errors = {"timestep_spacing": "quadratic", "variance_type": "analytic",
                  "prediction_errors": [[61, 0.0, 0.01], [561, 0.1, 0.03]]}
        plain, analytic = steps_of({**LINEAR, "timestep_spacing": "quadratic"}, 4), steps_of({**LINEAR, **errors}, 4)
        more = analytic.fresh.square() - plain.fresh.square()
        between = torch.tensor([[0.1, 0.03], [0.1, 0.03], [0.0376, 0.01752], [0, 0]])
        expected = analytic.of_x0[:, None].square() * between
        torch.testing.assert_close(more, expected, atol=1e-6, rtol=0)
        self.assertEqual(analytic.fresh[-1].tolist(), [0, 0])

    def test_refuses_another_sampler(self):
        for change in ({"_class_name": "DDIMScheduler"}, {"beta_schedule": "squaredcos_cap_v2"},
                       {"variance_type": "fixed_large"}, {"timestep_spacing": "leading"}):
            with self.assertRaises(SystemExit):
                steps_of({**LINEAR, "timestep_spacing": "quadratic", **change}, 4)


class Guided(unittest.TestCase):
    def test_compares_with_an_unconditioned_pass_that_sees_little_where_a_timestep_is_guided(self):
        torch.manual_seed(1)
        model = VoxfieldTransformer(2, 2, 16, 4, pos_embed_dim=8, condition=["tint"]).eval()
        centers = (torch.stack(torch.meshgrid(*[torch.arange(3.0)] * 3, indexing="ij"), -1).reshape(1, 27, 3).double()
                   * 0.6).repeat(2, 1, 1)
        x, labels, valid = torch.randn(2, 27, 24) / 4, torch.full((2, 27), 2), torch.ones(2, 27, dtype=torch.bool)
        condition, t = torch.rand(2, 27, 4), torch.tensor([300, 800])
        with torch.no_grad():
            conditioned = model(x, labels, centers, valid, t, condition)
            nothing = torch.zeros_like(condition)
            blind = {radius: model(x, torch.full_like(labels, 20), centers, valid, t, nothing, radius)
                     for radius in (None, 0.6, 9)}
            for radius in blind:
                got = guided_x0(model, Guidance(2, 0, 700, radius), x, labels, centers, valid, t, condition)
                expected = torch.stack([(2 * conditioned - blind[radius])[0], conditioned[1]]).clamp(-1, 1)
                torch.testing.assert_close(got, expected, atol=1e-5, rtol=0)
        self.assertTrue(torch.equal(blind[None], blind[9]))  # the attention radius stays
        self.assertGreater(float((blind[None] - blind[0.6]).abs().max()), 1e-3)


class TheRecipe(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.grid = cls.path("a.sgrid")
        write_street(cls.grid)
        train(cls.grid, cls.path("first"), 120, "--set", "learning_rate=0.01", "--set", "ema=0.9", "--set",
              "known_share=0.75")
        cls.teacher, cls.semantic = cls.path("first/model"), cls.path("semantic.sgrid")
        semantic = {name: t for name, t in safetensors_file.read(cls.grid).items() if name in ("cells", "labels")}
        safetensors_file.write(cls.semantic, semantic, {"voxel_size": "0.6", "points_per_voxel": "4"})
        index = read_json(os.path.join(cls.teacher, "model_index.json"))
        index["defaults"].update(num_inference_steps=4, guidance_scale=2.5, guidance_until=900, guidance_radius=0.6,
                                 known_tokens="clean")
        write_json(os.path.join(cls.teacher, "model_index.json"), index)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def path(cls, name):
        return os.path.join(cls.folder.name, name)

    def distil(self, name, steps, *more, teacher=None):
        return run_recipe("distil", self.path(name), "--grids", self.grid, "--teacher", teacher or self.teacher, *TINY,
                          "--set", f"steps={steps}", *more)

    def errors(self, *students, teacher=None, count=1):
        """of places and colours, all timesteps: the teacher's one pass, then the students'"""
        config = {**measure_distilled.CONFIG, **LINEAR, "set_size": [14, 14], "teacher_steps": count}
        teacher = Teacher(teacher or self.teacher, "cpu")
        config["network"] = {"voxel_size": 0.6, "num_classes": 20}
        drawn = Distillation(teacher, LocalSets(Grids([self.grid], self.path("held")), config), config)
        models = [measure_distilled.load_transformer(os.path.join(folder, "voxfield_transformer"))
                  for folder in (teacher.folder, *students)]
        return measure_distilled.errors_of(models, drawn, 4).nan_to_num().mean(1).sum(1).tolist()

    def test_learns_what_the_teacher_gives_with_guidance_and_the_engine_runs_it_without(self):
        self.distil("student", 150)
        before, after = self.errors(self.path("student/model"))
        self.assertLess(after, 0.5 * before)
        defaults = read_json(self.path("student/model/model_index.json"))["defaults"]
        self.assertEqual(defaults["guidance_scale"], 1)
        self.assertEqual((defaults["num_inference_steps"], defaults["distilled_steps"]), (4, 4))
        self.assertFalse({"guidance_until", "guidance_radius"} & set(defaults))
        subprocess.run([semrover_path(), "generate", self.semantic, "-m", self.path("student/model"), "-o",
                        self.path("made.sgrid"), "--quiet"], check=True)
        made = safetensors_file.read(self.path("made.sgrid"))
        colors = made["colors"].float().mean((1, 2))
        floor, wall = colors[made["labels"] == 0].mean(), colors[made["labels"] == 2].mean()
        self.assertGreater(float(wall - floor), 20)  # walls are bright

    def test_halves_the_steps_of_a_student(self):
        self.distil("whole", 60)
        self.distil("half", 100, "--set", "teacher_steps=2", teacher=self.path("whole/model"))
        before, after = self.errors(self.path("half/model"), teacher=self.path("whole/model"), count=2)
        self.assertLess(after, 0.8 * before)
        self.assertEqual(read_json(self.path("half/model/model_index.json"))["defaults"]["num_inference_steps"], 2)
        with self.assertRaisesRegex(AssertionError, "teacher_steps 3: the teacher takes 4 steps"):
            self.distil("third", 1, "--set", "teacher_steps=3")

    def test_two_steps_of_the_teacher_have_the_mean_of_one_with_the_x0_that_is_given(self):
        class Constant(torch.nn.Module):
            config = {"num_classes": 20}

            def forward(self, x, *_):
                return torch.full_like(x, 0.3)

        teacher = Teacher(self.teacher, "cpu")
        teacher.model, x = Constant(), torch.randn(2, 5, 24)
        first, known = torch.tensor([0, 2]), torch.zeros(2, 5, dtype=torch.bool)
        random = Draws(torch.Generator().manual_seed(1), 2)
        labels, condition = torch.zeros(2, 5, dtype=torch.long), torch.zeros(2, 5, 0)
        x0 = teacher.x0_of(first, 2, x, known, random, labels, torch.zeros(2, 5, 3), ~known, condition)
        torch.testing.assert_close(x0, torch.full_like(x, 0.3))  # one x0 throughout is that x0

    def test_what_a_student_has_learnt_is_an_adapter_beside_its_teachers_weights(self):
        self.distil("apart", 100)
        base, student = (os.path.join(folder, "voxfield_transformer")
                         for folder in (self.teacher, self.path("apart/model")))
        errors = []
        for rank in (1, 4, 64):
            folder = self.path(f"rank{rank}/voxfield_transformer")
            with contextlib.redirect_stdout(io.StringIO()):
                adapter.main(["-o", folder, "--base", base, "--trained", student, "--rank", str(rank)])
            for name, tensor in read_component(base)[1].items():
                self.assertTrue(torch.equal(tensor, read_component(folder)[1][name]), name)
            errors.append(self.errors(self.path(f"rank{rank}"))[1])
        before, after = self.errors(self.path("apart/model"))
        self.assertTrue(before > errors[0] > errors[1] > errors[2], (before, errors))
        self.assertLess(errors[2], 0.5 * (before + after))  # but for biases it is the student
        whole, of_student = load_transformer(folder).state_dict(), load_transformer(student).state_dict()
        for name, tensor in of_student.items():
            if name.startswith("transformer_blocks.0.attn.") and name.endswith("weight"):
                torch.testing.assert_close(whole[name], tensor, atol=2e-3, rtol=0)
        subprocess.run([semrover_path(), "generate", self.semantic, "-m", self.path("rank4/voxfield_transformer"), "-o",
                        self.path("adapted.sgrid"), "--steps", "2", "--quiet"], check=True)

    def test_a_preset_of_the_teacher_says_how_it_samples_and_with_which_adapter(self):
        folder = self.path("with-preset")
        shutil.copytree(self.teacher, folder)
        weights, index = os.path.join(folder, "voxfield_transformer"), os.path.join(folder, "model_index.json")
        name = next(n for n, t in read_component(weights)[1].items() if n.endswith("to_q.weight") and t.dim() == 2)
        layer, (rows, columns) = name[:-len(".weight")], read_component(weights)[1][name].shape
        safetensors_file.write(os.path.join(weights, "other.safetensors"), {
            layer + ".lora_A.weight": torch.ones(1, columns), layer + ".lora_B.weight": torch.ones(rows, 1)})
        about = read_json(index)
        about["defaults"]["distilled_steps"] = 4
        write_json(index, {**about, "presets": {"many": {
            "adapter": "other.safetensors", "num_inference_steps": 8, "guidance_scale": 3.0, "distilled_steps": None}}})
        plain, many = Teacher(folder, "cpu"), Teacher(folder + ":many", "cpu")
        self.assertEqual((len(plain.steps.timesteps), plain.guidance.scale), (4, 2.5))
        self.assertEqual((len(many.steps.timesteps), many.guidance.scale, many.guidance.radius), (8, 3.0, 0.6))
        self.assertNotIn("distilled_steps", many.defaults)
        added = many.model.state_dict()[name] - plain.model.state_dict()[name]
        torch.testing.assert_close(added, torch.ones_like(added))
        with self.assertRaisesRegex(SystemExit, "has no preset few"):
            Teacher(folder + ":few", "cpu")

    def test_goes_on_where_it_stopped(self):
        whole = self.distil("run", 12)
        self.distil("parts", 12, "--set", "minutes=0.000001")
        self.assertEqual(safetensors_file.read_header(self.path("parts/checkpoint.safetensors"))[1]["step"], "1")
        for name, tensor in self.distil("parts", 12).items():
            self.assertTrue(torch.equal(tensor, whole[name]), name)

    def test_refuses_a_teacher_that_sees_known_cells_with_noise(self):
        index = os.path.join(self.teacher, "model_index.json")
        about = read_json(index)
        write_json(index, {**about, "defaults": {**about["defaults"], "known_tokens": "noised"}})
        try:
            with self.assertRaisesRegex(AssertionError, "expected a model whose known_tokens are clean"):
                self.distil("noised", 1)
        finally:
            write_json(index, about)


if __name__ == "__main__":
    unittest.main()
